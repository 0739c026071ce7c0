"""``edgel render``: the picture of what detect finds, and what it says when something is wrong."""

import numpy as np
import pytest
from by_hand import grid
from PIL import Image
from typer.testing import CliRunner

import edgel
from edgel import Cloud, plot
from edgel._cli import app


def run(*words):
    return CliRunner(env={"COLUMNS": "200"}).invoke(app, ["render", *map(str, words)])


@pytest.fixture(scope="module")
def roof(tmp_path_factory):
    path = tmp_path_factory.mktemp("render") / "roof.ply"
    xyz = grid(40, 40)
    edgel.write(path, Cloud(xyz - np.column_stack([np.zeros((1600, 2)), np.abs(xyz[:, 0] - 20)])))
    return path


def test_render_draws_what_detect_finds(roof, tmp_path):
    out = tmp_path / "roof.png"
    result = run(
        roof, "-o", out, "--kinds", "crease", "--size", "480x360", "--background", "dark", "--direction", "0,1,-1"
    )
    assert result.exit_code == 0, result.output
    cloud = edgel.read(roof)
    edges = edgel.detect(cloud, kinds="crease")
    wanted = plot.picture(cloud, edges, size=(480, 360), background="dark", direction=(0, 1, -1))
    with Image.open(out) as image:
        np.testing.assert_array_equal(np.asarray(image), wanted)
    for words in ("crease", "drawing", f"{out}: the picture, 480 x 360 pixels"):
        assert words in result.stderr


def test_render_leaves_out_what_is_weak(roof, tmp_path):
    strength = edgel.paper.detect(edgel.read(roof)).strength
    least = float(np.median(strength))
    result = run(roof, "-o", tmp_path / "out.png", "--method", "paper", "--min-strength", least)
    assert result.exit_code == 0
    said = result.stderr.split("edge points")[1].split()[0]
    assert int(said.replace(",", "")) == np.count_nonzero(strength >= least) < len(strength)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["-o", "out.jpg"], 2),
        (["-o", "none/out.png"], 5),
        (["-o", "out.png", "--size", "big"], 2),
        (["-o", "out.png", "--size", "20x20"], 2),
        (["-o", "out.png", "--direction", "1,x,0"], 2),
        (["-o", "out.png", "--direction", "left"], 2),
        (["-o", "out.png", "--color-by", "rgb"], 2),
        (["-o", "out.png", "--min-strength", "2"], 2),
        (["-o", "out.png", "--kinds", "wood"], 2),
    ],
)
def test_render_says_what_is_wrong(roof, tmp_path, monkeypatch, words, code):
    monkeypatch.chdir(tmp_path)
    result = run(roof, *words)
    assert result.exit_code == code
    assert words[-1].split("/")[0] in result.stderr or words[-2] in result.stderr
    assert list(tmp_path.iterdir()) == []
