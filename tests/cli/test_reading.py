"""How the commands are told what a file holds, and what they tell of it."""

import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from edgel import Cloud, io
from edgel._cli import app

RUNNER = CliRunner(env={"COLUMNS": "200"})
CUBE = "".join(f"{x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
MESH = (
    "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nelement face 6\n"
    f"property list uchar int vertex_indices\nend_header\n{CUBE}"
    "4 0 1 3 2\n4 4 6 7 5\n4 0 4 5 1\n4 2 3 7 6\n4 0 2 6 4\n4 1 5 7 3\n"
)


def run(*words):
    result = RUNNER.invoke(app, [str(word) for word in words])
    return result.exit_code, result.stdout, result.stderr


def test_columns(tmp_path):
    (tmp_path / "a.txt").write_text("7 1 2 3 0.5\n8 4 5 6 0.25\n")
    code, _, said = run("convert", tmp_path / "a.txt", tmp_path / "b.npz", "--columns", "_,x,y,z,reflectance")
    assert code == 0, said
    cloud = io.read(tmp_path / "b.npz")
    assert cloud.xyz.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert list(cloud.attributes) == ["reflectance"]
    code, _, said = run("info", tmp_path / "a.txt", "--columns", "x,y")
    assert code == 2
    assert "--columns: x,y: x, y and z have to be among the names" in said
    code, _, said = run("info", tmp_path / "b.npz", "--columns", "x,y,z")
    assert code == 2
    assert "is no text" in said
    (tmp_path / "a.txt").write_text("1 2 3\n4 5 6\n")
    code, _, said = run("convert", tmp_path / "a.txt", tmp_path / "a.txt", "--columns", "x,y,z")
    assert code == 2
    assert "is the input itself" in said


def test_a_mesh(tmp_path):
    (tmp_path / "a.ply").write_text(MESH)
    for words in (["info"], ["convert"]):
        more = [] if words == ["info"] else [tmp_path / "b.xyz"]
        code, shown, said = run(*words, tmp_path / "a.ply", *more)
        assert code == 0
        assert "a mesh of 6 faces" in shown + said
        assert "--sample-mesh" in shown + said
    pytest.importorskip("trimesh", reason="the extra mesh is not installed")
    code, _, said = run("detect", tmp_path / "a.ply", "--sample-mesh", 3000, "-o", tmp_path / "b.ply")
    assert code == 0, said
    assert "a mesh of" not in said
    found = io.read(tmp_path / "b.ply").xyz
    on_edge = (np.minimum(np.abs(found), np.abs(found - 1)) < 0.1).sum(axis=1) >= 2
    assert on_edge.mean() > 0.9
    code, _, said = run("detect", tmp_path / "a.ply", "--sample-mesh", 3000, "--all", "-o", tmp_path / "a.ply")
    assert code == 2
    assert "is the input itself" in said
    assert (tmp_path / "a.ply").read_text() == MESH
    code, _, said = run("info", tmp_path / "a.ply", "--sample-mesh", 0)
    assert code == 2
    assert "--sample-mesh: expected a number of points" in said


def test_the_camera_beside_an_image(tmp_path):
    Image.fromarray(np.full((12, 16), 1000, np.uint16)).save(tmp_path / "a.png")
    (tmp_path / "intrinsics.json").write_text('{"fx": 20, "fy": 20, "cx": 8, "cy": 6}')
    code, shown, _ = run("info", tmp_path / "a.png")
    assert code == 0
    assert "intrinsics.json: fx 20" in shown
    code, _, said = run("convert", tmp_path / "a.png", tmp_path / "a.pcd")
    assert code == 0
    assert "intrinsics.json: fx 20" in said


@pytest.mark.parametrize("command", ["convert", "normals"])
def test_what_a_format_cannot_hold_is_told_once(tmp_path, command):
    xyz = np.random.default_rng(0).random((50, 3))
    for name in "ab":
        io.write(tmp_path / f"{name}.npz", Cloud(xyz, {"id": np.arange(50), "tree": np.full(50, 2**60)}))
    to = [] if command == "convert" else ["-o"]
    code, _, said = run(command, tmp_path / "a.npz", *to, tmp_path / "a.ply")
    assert code == 0, said
    assert said.count("tree: left out") == 1
    assert "fits no type of PLY" in said
    assert run(command, tmp_path / "a.npz", *to, tmp_path / "a.ply", "--quiet") == (0, "", "")
    code, shown, said = run(command, tmp_path / "a.npz", *to, tmp_path / "a.ply", "--json")
    lost = json.loads(shown)["lost"]
    assert ([line for line in lost if "tree" in line], "left out" in said) == (lost, False)
    assert len(lost) == 1
    several = [tmp_path / "a.npz", tmp_path / "b.npz", *to, f"{tmp_path}/out/", "--format", "ply", "--workers", "2"]
    code, _, said = run(command, *several)
    assert (code, said.count("tree: left out")) == (0, 2)


def test_of_a_folder_only_what_an_option_is_for(tmp_path):
    (tmp_path / "a.txt").write_text("7 1 2 3\n8 4 5 6\n9 4 5 7\n")
    io.write(tmp_path / "b.ply", Cloud(np.eye(3)))
    code, shown, said = run("info", tmp_path, "--columns", "_,x,y,z", "--json")
    assert (code, [json.loads(line)["input"] for line in shown.splitlines()]) == (0, [str(tmp_path / "a.txt")]), said
    (tmp_path / "a.txt").unlink()
    code, _, said = run("info", tmp_path, "--columns", "_,x,y,z")
    assert (code, "is a folder without clouds for --columns" in said) == (3, True)
