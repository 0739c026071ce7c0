"""Curves of a tiled result: those of the whole cloud, with nothing cut at a seam."""

import numpy as np
import pytest
from typer.testing import CliRunner

import edgel
from edgel import tiled
from edgel._cli import app
from edgel._cli.errors import ExitCode


def test_curves_of_tiles_are_those_of_the_whole(files, strip, tmp_path):
    out = tmp_path / "out"
    tiled.detect(files, out, tile_points=3000, min_strength=0.15)
    assert tiled.is_run(out)
    cloud, edges = tiled.surroundings(out)
    assert len(cloud) <= len(strip)
    assert edges.num_points == len(cloud)
    mine = edgel.curves.trace(cloud, edges)
    whole = edgel.curves.trace(strip, edgel.detect(strip, method="surface", min_strength=0.15))
    assert len(mine) == len(whole) > 50
    first, second = (curves.vertices[np.lexsort(curves.vertices.round(5).T)] for curves in (mine, whole))
    np.testing.assert_allclose(first, second, atol=1e-6)

    table = tmp_path / "lines.csv"
    result = CliRunner().invoke(app, ["lines", str(out), "-o", str(table)])
    assert result.exit_code == 0, result.output
    assert len(table.read_text().splitlines()) == 1 + len(mine)
    for option in (["--kinds", "crease"], ["--columns", "x,y,z"]):
        refused = CliRunner().invoke(app, ["lines", str(out), "-o", str(table), *option])
        assert refused.exit_code == ExitCode.USAGE
        assert f"{option[0]}: is for edges that are yet to be found" in refused.stderr


def test_a_file_of_two_points_is_a_part_too(strip, tmp_path):
    names = [str(tmp_path / "street.npy"), str(tmp_path / "two.npy")]
    np.save(names[0], strip[:-2])
    np.save(names[1], strip[-2:])
    out = tmp_path / "out"
    tiled.detect(names, out, min_strength=0.15)
    cloud, edges = tiled.surroundings(out)
    assert len(edges) == len(edgel.detect(strip, method="surface", min_strength=0.15))
    assert edges.num_points == len(cloud)


def test_a_run_whose_state_is_gone_is_named(tmp_path):
    assert not tiled.is_run(tmp_path)
    (tmp_path / "manifest.json").write_text('{"name": "of another program"}')
    assert not tiled.is_run(tmp_path)
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(FileNotFoundError, match="as-one again"):
        tiled.surroundings(tmp_path)
