"""The k-d tree, and the selection and sorting that it is built with."""

import numpy as np
import pytest
from alone import alone
from hypothesis import given
from hypothesis import strategies as st
from test_knn import cloud

from edgel._neighbors.kdtree import BUCKET, bounds, build_index, node_start
from edgel._neighbors.selection import quantile, sort_places, value_at

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS, st.integers(1, 3000), st.sampled_from([2, 10, 10**9]))
def test_the_value_at_a_rank_is_that_of_the_sorted_keys(seed, count, values):
    rng = np.random.default_rng(seed)
    keys = rng.integers(0, values, count + 5) / 7
    rank = int(rng.integers(count))
    assert alone(value_at)(rank, keys, 5, count, np.empty(count + 24)) == np.sort(keys[5:])[rank]


@given(SEEDS, st.integers(0, 200))
def test_places_are_sorted_by_all_three_coordinates(seed, count):
    xyz = np.random.default_rng(seed).integers(0, 4, (count, 3)).astype(float)
    x, y, z, order = *np.ascontiguousarray(xyz.T), np.arange(count)
    alone(sort_places)(x, y, z, order, 0, count)
    expected = sorted(map(tuple, xyz.tolist()))
    assert list(zip(x.tolist(), y.tolist(), z.tolist(), strict=True)) == expected
    np.testing.assert_array_equal(xyz[order], np.reshape(expected, (-1, 3)))


@given(SEEDS, st.integers(1, 400), st.booleans())
def test_the_layout_of_a_tree_does_not_depend_on_the_order_of_the_points(seed, count, lattice):
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 6, (count, 3)).astype(float) if lattice else rng.normal(size=(count, 3))
    a, b = build_index(points), build_index(rng.permutation(points))
    np.testing.assert_array_equal(a.xyz, b.xyz)
    np.testing.assert_array_equal(a.boxes, b.boxes)
    np.testing.assert_array_equal(a.blocks, b.blocks)


@pytest.mark.parametrize("n", [1, 2, 16, 17, 65, 70_001])
def test_index_holds_every_point_once_and_its_boxes_hold_the_points(n):
    points = cloud("uniform", n)
    index = build_index(points)
    assert sorted(index.order.tolist()) == list(range(n))
    np.testing.assert_array_equal(index.xyz.T, points[index.order])
    lower, upper = bounds(points)
    np.testing.assert_array_equal(lower, points.min(axis=0))
    np.testing.assert_array_equal(upper, points.max(axis=0))
    leaves = len(index.boxes) // 2
    for leaf in np.random.default_rng(0).integers(0, leaves, 20):
        inside = index.xyz[:, node_start(leaf, n, leaves) : node_start(leaf + 1, n, leaves)]
        assert 0 < inside.shape[1] <= BUCKET
        np.testing.assert_array_equal(index.boxes[leaves + leaf], np.r_[inside.min(axis=1), inside.max(axis=1)])
    np.testing.assert_array_equal(index.boxes[1], np.r_[lower, upper])


@given(SEEDS, st.integers(1, 300), st.sampled_from([0.0, 0.25, 0.5, 1.0]))
def test_quantiles_are_numpys(seed, count, share):
    values = np.random.default_rng(seed).integers(0, 50, count + 3) / 7
    expected = np.quantile(values[:count], share)
    assert alone(quantile)(values, count, share) == pytest.approx(expected, rel=1e-14)
