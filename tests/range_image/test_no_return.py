"""Shots without a return that were written as points."""

import numpy as np
import pytest
from test_range_image import camera

import edgel


def frame(missing):
    xyz = camera(rows=50, cols=60)
    xyz[20:30, 15:40] = missing
    xyz[:, 45:] += (0, 0, 60)
    return xyz


@pytest.mark.parametrize("place", [(0, 0, 0), (-1, -1, -1), (9999, 9999, 9999)])
def test_a_place_that_stands_for_nothing_is_taken_as_nothing(place):
    found = edgel.detect(frame(place))
    wanted = edgel.detect(frame(np.nan))
    for name in ("index", "kind", "strength", "position", "normals"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    assert found.reason == f"{wanted.reason}; 250 at {' '.join(map(str, place))} taken as no return"
    assert found.num_dropped == 0


def test_depth_zero_of_a_height_map():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    heights = np.stack([x, y, 80 + rng.normal(0, 0.3, x.shape)], axis=-1)
    heights[10:15, 10:20, 2] = 0
    assert "50 at z = 0 taken as no return" in edgel.detect(heights).reason


def test_a_floor_at_zero_is_a_floor():
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    for height in (10.0, 8 + x / 2):
        block = np.stack([x, y, np.where((x > 10) & (x < 30), height, 0)], axis=-1)
        assert "no return" not in edgel.detect(block).reason


def test_a_list_with_many_points_in_the_sensor():
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, 50, (2, 2000))
    roof = np.column_stack([x, y, 20 - 0.7 * np.abs(x - 24)])
    found = edgel.detect(np.concatenate([np.zeros((40, 3)), roof]))
    wanted = edgel.detect(roof)
    assert np.array_equal(found.index, wanted.index + 40)
    assert "40 at 0 0 0 taken as no return" in found.reason
    assert "no return" not in edgel.detect(np.concatenate([np.zeros((2, 3)), roof])).reason


def test_nothing_but_no_returns_is_left_as_it_is():
    with pytest.raises(ValueError, match="one line or spot"):
        edgel.detect(np.zeros((10, 10, 3)))


def test_the_case_of_zeros(shared_data):
    cases = shared_data.parent / "cases"
    zero, nan = (edgel.detect(edgel.io.read(cases / f"no_return_{name}.pcd")) for name in ("zero", "nan"))
    assert np.array_equal(zero.index, nan.index)
    assert np.array_equal(zero.kind, nan.kind)
    assert "482 at 0 0 0" in zero.reason
