"""`edgel detect --as-one`: files that are parts of one cloud."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import edgel
from edgel._cli import app


@pytest.fixture
def parts(tmp_path):
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 60, (2, 4000))
    roof = np.column_stack([x, y, -0.6 * np.abs(x - 31)])
    for name, part in (("west", roof[x < 25]), ("east", roof[x >= 25])):
        edgel.write(tmp_path / f"{name}.ply", edgel.Cloud(part))
    return roof, [str(tmp_path / f"{name}.ply") for name in ("west", "east")]


def run(*words):
    return CliRunner().invoke(app, ["detect", *words])


def test_parts_are_one_cloud(parts, tmp_path):
    _, files = parts
    whole = edgel.detect(np.concatenate([edgel.read(file).xyz for file in files]), method="surface")
    result = run(*files, "-o", str(tmp_path / "out"), "--as-one", "--json", "--format", "laz", "-q")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["schema"] == "edgel.detect"
    assert said["inputs"] == files
    assert said["num_edges"] == len(whole) == sum(len(edgel.read(file)) for file in said["outputs"])
    assert (tmp_path / "out" / "edges.vpc").exists()
    again = run(*files, "-o", str(tmp_path / "out"), "--as-one")  # goes on, and has nothing to do
    assert again.exit_code == 0
    assert "edge points" in again.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--as-one"], "add -o DIR"),
        (["--as-one", "-o", "out", "--method", "spherical"], "--as-one looks at the surface"),
        (["--as-one", "-o", "out", "--where", "z > 0"], "--where: is not for --as-one"),
        (["--as-one", "-o", "out", "--all"], "--all: is not for --as-one"),
        (["--as-one", "-o", "out", "--scale", "2"], "--scale: is not for --as-one"),
        (["--as-one", "-o", "out", "--kinds", "color"], "--kinds: color"),
        (["-o", "out/", "--tile-points", "5e6"], "--tile-points: is for --as-one"),
        (["-o", "out/", "--overwrite"], "--overwrite: is for --as-one"),
    ],
)
def test_what_does_not_go_together_is_wrong_usage(parts, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    result = run(*parts[1], *words)
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.split())


def test_other_options_on_the_same_folder_are_refused(parts, tmp_path):
    out = str(tmp_path / "out")
    assert run(*parts[1], "-o", out, "--as-one", "-q").exit_code == 0
    result = run(*parts[1], "-o", out, "--as-one", "-q", "--min-strength", "0.3")
    assert result.exit_code == 4
    assert "--overwrite" in result.stderr
    assert run(*parts[1], "-o", out, "--as-one", "-q", "--min-strength", "0.3", "--overwrite").exit_code == 0
