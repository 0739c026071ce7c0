"""What the commands write: never less over the input, nothing over an existing file with --no-clobber, names kept."""

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import edgel
from edgel import io
from edgel._cli import app

PAPER = ("--method", "paper")


def run(*words):
    result = CliRunner(env={"COLUMNS": "200"}).invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture
def scan(tmp_path):
    x, y = np.meshgrid(np.arange(50) / 10, np.arange(50) / 10)
    path = tmp_path / "scan.ply"
    cloud = edgel.Cloud(np.c_[x.ravel(), y.ravel(), 2.0 * (x.ravel() > 2.45)], {"label": np.arange(2500)})
    io.write(path, cloud)
    return path


@pytest.fixture(scope="module")
def cases() -> Path:
    folder = Path(os.environ.get("EDGEL_CASES", Path(__file__).parents[3] / "shared" / "cases"))
    if not folder.is_dir():
        pytest.skip(f"small cases not found in {folder}; set EDGEL_CASES")
    return folder


def other_names(scan, suffix=".ply"):
    """The same file by another spelling, a symbolic link, a hard link, and a link to its folder."""
    folder = scan.parent
    (folder / f"soft{suffix}").symlink_to(scan)
    os.link(scan, folder / f"hard{suffix}")
    (folder / "inner").mkdir()
    (folder / "around").symlink_to(folder)
    soft, hard = folder / f"soft{suffix}", folder / f"hard{suffix}"
    return [scan, f"{folder}/inner/../scan.ply", soft, hard, folder / "around" / "scan.ply"]


def test_edge_points_never_replace_the_scan(scan):
    before = scan.read_bytes()
    for name in other_names(scan):
        for more in ((), ("--crop", 0, 0, 0, 1, 1, 1)):
            result = run("detect", scan, "-o", name, *PAPER, *more)
            assert result.exit_code == 2
            assert "is the input" in result.stderr
            assert "add --all" in result.stderr
            assert scan.read_bytes() == before


def test_another_format_never_replaces_the_scan(scan):
    before = scan.read_bytes()
    for suffix in (".xyz", ".npz"):
        link = scan.parent / f"link{suffix}"
        link.symlink_to(scan)
        for words in (["convert", scan, link], ["normals", scan, "-o", link], ["detect", scan, "--all", "-o", link]):
            result = run(*words)
            assert result.exit_code == 2
            assert "name another file" in result.stderr
            assert scan.read_bytes() == before


def test_a_picture_never_replaces_the_input(scan):
    before = scan.read_bytes()
    assert run("render", scan, "-o", scan).exit_code == 2
    (scan.parent / "picture.png").symlink_to(scan)
    assert run("render", scan, "-o", scan.parent / "picture.png").exit_code == 2
    depth, camera = scan.parent / "depth.png", scan.parent / "camera.json"
    Image.fromarray(np.full((30, 40), 2000, np.uint16)).save(depth)
    camera.write_text('{"fx": 30, "fy": 30, "cx": 20, "cy": 15}')
    assert run("render", depth, "--intrinsics", camera, "-o", depth).exit_code == 2
    (scan.parent / "camera.png").symlink_to(camera)
    assert run("render", depth, "--intrinsics", camera, "-o", scan.parent / "camera.png").exit_code == 2
    assert scan.read_bytes() == before
    assert camera.read_text().startswith('{"fx"')
    with Image.open(depth) as image:
        assert image.size == (40, 30)


def test_a_report_never_replaces_the_input(scan):
    before = scan.read_bytes()
    folder = scan.parent / "report"
    for name in ("report.html", "scan-figure-1.png"):
        folder.mkdir()
        (folder / name).symlink_to(scan)
        result = run("detect", scan, "--report", folder, *PAPER)
        assert result.exit_code == 2
        assert "name another folder" in result.stderr
        (folder / name).unlink()
        folder.rmdir()
    assert scan.read_bytes() == before


def test_the_shells_redirections_are_seen_through(scan):
    before = scan.read_bytes()
    command = [sys.executable, "-m", "edgel", "detect", "-", "-o", str(scan), *PAPER]
    with scan.open("rb") as file:
        done = subprocess.run(command, stdin=file, capture_output=True, check=False)
    assert done.returncode == 2
    with scan.open("ab") as file:
        command = [sys.executable, "-m", "edgel", "convert", str(scan), "-"]
        done = subprocess.run(command, stdout=file, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, b"stdout: is the input" in done.stderr) == (2, True)
    assert scan.read_bytes() == before


def test_a_mesh_is_not_replaced_by_its_vertices(tmp_path):
    path = tmp_path / "mesh.ply"
    header = "ply\nformat ascii 1.0\nelement vertex 4\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_text(header + "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n")
    before = path.read_bytes()
    result = run("convert", path, path)
    assert result.exit_code == 5
    assert "1 of element face: left out" in result.stderr
    assert path.read_bytes() == before
    assert "element face: left out" in run("convert", path, tmp_path / "copy.ply").stderr


def test_what_npz_keeps_beside_the_points_is_not_lost_in_place(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, xyz=np.random.default_rng(0).random((50, 3)), calibration=np.eye(4))
    before = path.read_bytes()
    result = run("convert", path, path)
    assert (result.exit_code, "calibration: left out" in result.stderr) == (5, True)
    assert path.read_bytes() == before


def test_all_over_the_input_keeps_every_attribute_and_again(scan):
    for again in range(3):
        assert run("detect", scan, "-o", scan, "--all", *PAPER).exit_code == 0
        cloud = io.read(scan)
        assert np.array_equal(cloud.attributes["label"], np.arange(2500))
        assert ("input_nx" in cloud.attributes) == (again > 0)
        assert ("input_nx_2" in cloud.attributes) == (again > 1)


def test_no_clobber(scan, tmp_path):
    for suffix, words in {
        ".ply": ["detect", scan, *PAPER, "-o"],
        ".pcd": ["normals", scan, "-o"],
        ".npz": ["convert", scan],
        ".png": ["render", scan, *PAPER, "-o"],
    }.items():
        path = tmp_path / f"there{suffix}"
        path.write_bytes(b"old")
        result = run(*words, path, "--no-clobber")
        assert result.exit_code == 5
        assert "is there already" in result.stderr
        assert path.read_bytes() == b"old"
        assert run(*words, tmp_path / f"new{suffix}", "--no-clobber").exit_code == 0
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "scan-figure-4.png").write_bytes(b"old")
    assert run("detect", scan, *PAPER, "--report", tmp_path / "report", "--no-clobber").exit_code == 5
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "elbow.ply").write_bytes(b"old")
    assert run("demo", "-o", tmp_path / "demo", "--no-clobber").exit_code == 5
    assert (tmp_path / "demo" / "elbow.ply").read_bytes() == b"old"


@pytest.mark.skipif(sys.platform == "win32", reason="named pipes of POSIX")
def test_convert_into_a_named_pipe_ends(scan):
    pipe, copy = scan.parent / "pipe.xyz", scan.parent / "copy.xyz"
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: copy.write_bytes(pipe.read_bytes()))
    reader.start()
    assert run("convert", scan, pipe).exit_code == 0
    reader.join()
    assert len(io.read(copy)) == 2500


def test_stdout_by_its_name_is_refused(scan):
    result = run("convert", scan, "/dev/stdout")
    assert result.exit_code == 2
    assert "has no extension" in result.stderr


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".las", ".csv", ".npz"])
@pytest.mark.parametrize("command", ["detect", "detect --all", "normals"])
def test_own_normals_are_kept_under_another_name_and_said(cases, tmp_path, suffix, command):
    path, out = cases / "own_normals.ply", tmp_path / f"out{suffix}"
    result = run(*command.split()[:1], path, *command.split()[1:], "-o", out)
    assert result.exit_code == 0
    assert "the input's own nx, ny, nz: kept as input_nx, input_ny, input_nz" in result.stderr
    own, found = io.read(path), io.read(out)
    rows = edgel.detect(own).index if command == "detect" else slice(None)
    for axis in ("nx", "ny", "nz"):
        assert np.array_equal(found.attributes[f"input_{axis}"], own.attributes[axis][rows])
        assert axis in found.attributes


def test_json_names_what_was_renamed(cases, tmp_path):
    found = json.loads(run("detect", cases / "own_normals.ply", "-o", tmp_path / "a.ply", "--json").stdout)
    assert found["renamed"] == {"nx": "input_nx", "ny": "input_ny", "nz": "input_nz"}


@pytest.mark.parametrize("suffix", io.WRITERS)
def test_an_empty_answer_with_a_vector_attribute(cases, tmp_path, suffix):
    if suffix == ".e57":
        pytest.importorskip("pye57", reason="the extra e57 is not installed")
    out = tmp_path / f"none{suffix}"
    result = run("detect", cases / "no_edges_vector_attribute.npz", "-o", out, "--min-strength", "0.999")
    assert result.exit_code == 0, result.stderr
    assert len(io.read(out)) == 0
