"""Leaves of an octree: those of the obvious way, and the same in a part of a cloud."""

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.octree import FEWEST, LEVELS, MOST, build_octree


def leaves_of(xyz, size):
    """The leaves as sets of points."""
    index = build_index(np.ascontiguousarray(xyz, dtype=np.float64))
    octree = build_octree(index, size)
    assert np.array_equal(np.sort(octree.places), np.arange(len(xyz)))
    points = index.order[octree.places]
    return {frozenset(part.tolist()) for part in np.split(points, octree.starts[1:-1])}


def surface(count, seed=0):
    """A wavy sheet, denser towards one side, about the origin."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1, 1, (2, count))
    x = np.sign(x) * np.abs(x) ** 3
    return np.column_stack([40 * x, 25 * y, np.sin(9 * x) + 0.02 * rng.standard_normal(count)])


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.5, 4.0, 64.0]), st.integers(1, 3))
def test_leaves_are_those_of_the_obvious_way(seed, size, dimensions):
    rng = np.random.default_rng(seed)
    xyz = np.zeros((300, 3))
    xyz[:, :dimensions] = rng.normal(0, rng.uniform(0.1, 20), (300, dimensions))
    xyz[:100] = xyz[rng.integers(0, 300, 100)]  # some at one place
    assert leaves_of(xyz, size) == naive.octree_leaves(xyz.tolist(), size, MOST, FEWEST, LEVELS)


def test_leaves_of_a_part_are_those_of_the_whole():
    xyz = surface(20_000) + [512_345.0, 5_401_234.5, 88.0]  # as in UTM
    size = 4.0
    part = np.flatnonzero((xyz[:, 0] >= 512_328.0) & (xyz[:, 0] < 512_352.0))  # whole cells
    inside = {
        frozenset(np.searchsorted(part, list(leaf)).tolist()) for leaf in leaves_of(xyz, size) if leaf <= set(part)
    }
    assert 1_000 < len(part) < 19_000
    assert leaves_of(xyz[part], size) == inside


def test_neither_order_nor_density_matters():
    xyz = surface(5_000)
    shuffled = np.random.default_rng(1).permutation(len(xyz))
    mixed = {frozenset(shuffled[list(leaf)].tolist()) for leaf in leaves_of(xyz[shuffled], 8.0)}
    assert mixed == leaves_of(xyz, 8.0)
    sizes = [len(leaf) for leaf in leaves_of(xyz, 8.0)]
    assert max(sizes) <= MOST + 7 * FEWEST
    assert np.median(sizes) > FEWEST


@pytest.mark.parametrize("far", [1e30, -1e30, 1e-12, 3.0])
def test_points_at_one_place_are_one_leaf(far):
    assert leaves_of(np.full((500, 3), far), 1.0) == {frozenset(range(500))}


def test_points_far_apart_are_leaves_of_their_own():
    assert len(leaves_of(np.arange(60.0).reshape(20, 3) * 1e9, 1.0)) == 20
