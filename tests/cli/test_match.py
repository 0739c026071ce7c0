"""``edgel match``: a part in place, as points, as a picture and as JSON, and what is not there."""

import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import edgel
from edgel import synth
from edgel._cli import app
from edgel._cli.errors import ExitCode

SPACING = 1.6


def run(*words):
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.mark.parametrize("part", ["missing.stl", "missing.ply", "broken.ply"])
def test_a_part_that_cannot_be_read_is_named(tmp_path, part):
    edgel.write(tmp_path / "scan.ply", synth.sample(synth.stepped_block(), spacing=6.0).cloud)
    (tmp_path / "broken.ply").write_text("no PLY")
    done = run("match", tmp_path / "scan.ply", tmp_path / part)
    assert done.exit_code == ExitCode.INPUT
    assert part in done.stderr
    assert "internal" not in done.stderr


@pytest.fixture(scope="module")
def scene():
    return synth.view(synth.stepped_block(), projection="pinhole", spacing=SPACING, noise=0.2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, scene):
    trimesh = pytest.importorskip("trimesh", reason="the extra mesh is not installed")
    folder = tmp_path_factory.mktemp("match")
    edgel.write(folder / "scan.pcd", scene.cloud)
    for name in ("part.stl", "part.ply"):
        solid = synth.stepped_block()
        trimesh.Trimesh(solid.vertices, solid.triangles, process=False).export(folder / name)
    edgel.write(folder / "ball.ply", synth.sample(synth.sphere(), pattern="blue_noise", spacing=1.5).cloud)
    return folder


@pytest.mark.parametrize("part", ["part.stl", "part.ply"])
def test_a_part_is_put_in_place(folder, scene, part):
    done = run(
        "match",
        folder / "scan.pcd",
        folder / part,
        "-o",
        folder / "aligned.ply",
        "--picture",
        folder / "match.png",
        "--json",
    )
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["schema"] == "edgel.match"
    (one,) = facts["found"]
    assert np.abs(np.array(one["T_target_source"]) - scene.pose).max() < SPACING
    placed = edgel.read(folder / "aligned.ply")
    there = (placed.xyz - scene.pose[:3, 3]) @ scene.pose[:3, :3]
    solid = synth.stepped_block()
    assert np.abs(there.min(axis=0) - solid.vertices.min(axis=0)).max() < SPACING
    assert np.abs(there.max(axis=0) - solid.vertices.max(axis=0)).max() < SPACING
    picture = np.asarray(Image.open(folder / "match.png")).astype(int)
    orange = (picture[..., 0] - picture[..., 2]) > 60
    assert 0.01 < orange.mean() < 0.9


def test_all_that_json_says_is_documented(folder):
    from pathlib import Path

    document = Path(__file__).parents[2] / "docs" / "command-line.md"
    if not document.is_file():
        pytest.skip("the source distribution has no docs")
    told = document.read_text().split("### `edgel.match`")[1].split("###")[0]
    facts = json.loads(run("match", folder / "scan.pcd", folder / "part.stl", "--json").stdout)
    names = (set(facts) | set(facts["found"][0])) - {"schema", "schema_version"}
    assert names == {line.split("`")[1] for line in told.splitlines() if line.startswith("| `")}


def test_what_is_not_there_is_not_found(folder):
    done = run("match", folder / "ball.ply", folder / "part.stl", "-o", folder / "none.ply")
    assert done.exit_code == 4
    assert "not found in" in done.output
    assert not (folder / "none.ply").exists()


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("scan.pcd", "none.stl"), 3, "none.stl"),
        (("part.stl", "scan.pcd"), 2, "the scan comes first"),
        (("scan.pcd", "part.stl", "--scale", "0"), 2, "--scale"),
        (("scan.pcd", "part.stl", "--most", "0"), 2, "--most"),
        (("scan.pcd", "ball.ply", "--most", "2"), 2, "for meshes and STEP"),
        (("scan.pcd", "part.stl", "--picture", "a.jpg"), 2, "png"),
        (("scan.pcd", "part.ply", "-o", "part.ply"), 2, "is the input itself"),
        (("scan.pcd", "part.ply", "--picture", "part.ply"), 2, "is the input itself"),
    ],
)
def test_wrong_words(folder, monkeypatch, words, code, message):
    monkeypatch.chdir(folder)
    done = run("match", *words)
    assert done.exit_code == code, done.output
    assert message in done.output
