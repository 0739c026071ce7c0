"""Thinning to one point a voxel, and the median spacing."""

import numpy as np
import pytest
from hall import roof

from edgel._neighbors.spacing import median_spacing
from edgel._neighbors.thinning import thin


def test_thinning_keeps_one_point_a_voxel_whatever_the_order():
    rng = np.random.default_rng(0)
    xyz = np.concatenate([rng.random((3000, 3)), rng.integers(0, 5, (500, 3)) / 5.0])  # the latter with many ties
    rows = thin(xyz, 0.1)
    cells = np.floor((xyz - xyz.min(axis=0)) / 0.1)
    assert len(rows) == len(np.unique(cells, axis=0)) == len(np.unique(cells[rows], axis=0))
    order = rng.permutation(len(xyz))
    shuffled = xyz[order][thin(xyz[order], 0.1)]
    np.testing.assert_array_equal(np.unique(shuffled, axis=0), np.unique(xyz[rows], axis=0))


def test_thinning_far_apart_points_does_not_overflow():
    xyz = np.array([[0.0, 0, 0], [1e9, 1e9, 1e9], [-1e9, 5, 1e9], [0.1, 0, 0]])
    assert len(thin(xyz, 1.0)) == 3


def test_thinning_leaves_out_what_is_not_finite():
    xyz = np.vstack([[np.nan] * 3, roof()])
    assert thin(xyz, 1e-3)[0] == 1


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan])
def test_bad_sizes_are_refused(size):
    with pytest.raises(ValueError, match="size"):
        thin(roof(), size)


def test_median_spacing_does_not_count_repeats():
    assert median_spacing(np.repeat(roof(0.0), 2, axis=0)) == 0.0
    assert median_spacing(np.vstack([roof(0.0), roof(0.0)[:50]])) == 1.0
