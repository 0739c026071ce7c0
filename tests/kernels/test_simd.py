"""The engine below the neighbours: lanes, ranks, and eight searches and plane fits in step, against the obvious."""

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numba import njit
from numba.core.errors import TypingError

from edgel import lanes
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.normals import fit_planes, plane_fits_within
from edgel._neighbors.plane_fits import smallest_eigenpairs
from edgel._neighbors.selection import sort_places, value_at

EIGHT = arrays(np.float64, 8, elements=st.floats(-1e6, 1e6))
SEEDS = st.integers(0, 2**32 - 1)


@njit
def _operate(a, b, out):
    x, y = lanes.load(a, 0), lanes.load(b, 0)
    results = (
        x + y,
        x - y,
        x * y,
        x / (y * y + 1.0),
        lanes.smaller(x, y),
        lanes.larger(x, y),
        lanes.magnitude(x),
        lanes.root(lanes.magnitude(x)),
        lanes.multiply_add(x, y, lanes.spread(1.0)),
        lanes.where((x < y) & (x <= 5.0) | (x > y) & (y >= 0.0) | (x == y), x, y),
        lanes.as_floats(lanes.counted(lanes.counts_of(2) + lanes.counts_of(3), x < y)),
    )
    for i in range(len(results)):
        lanes.store(out, 8 * i, results[i])
    return lanes.smallest_of(x), lanes.largest_of(x), lanes.bits(x < y)


@given(EIGHT, EIGHT)
def test_lanes_do_what_numpy_does(a, b):
    out = np.empty(88)
    least, most, flags = _operate(a, b, out)
    expected = [
        a + b,
        a - b,
        a * b,
        a / (b * b + 1),
        np.minimum(a, b),
        np.maximum(a, b),
        np.abs(a),
        np.sqrt(np.abs(a)),
        a * b + 1,
        np.where((a < b) & (a <= 5) | (a > b) & (b >= 0) | (a == b), a, b),
        5.0 + (a < b),
    ]
    np.testing.assert_allclose(out.reshape(-1, 8), expected, rtol=1e-13, atol=1e-3)
    assert (least, most) == (a.min(), a.max())
    assert flags == sum(1 << i for i in range(8) if a[i] < b[i])


def test_lanes_refuse_what_is_not_contiguous():
    with pytest.raises(TypingError, match="contiguous"):
        _operate(np.zeros(16)[::2], np.zeros(8), np.empty(88))


@given(SEEDS, st.integers(1, 3000), st.sampled_from([2, 10, 10**9]))
def test_the_value_at_a_rank_is_that_of_the_sorted_keys(seed, count, values):
    rng = np.random.default_rng(seed)
    keys = rng.integers(0, values, count + 5) / 7
    rank = int(rng.integers(count))
    assert value_at(rank, keys, 5, count, np.empty(count + 24)) == np.sort(keys[5:])[rank]


@given(SEEDS, st.integers(0, 200))
def test_places_are_sorted_by_all_three_coordinates(seed, count):
    xyz = np.random.default_rng(seed).integers(0, 4, (count, 3)).astype(float)
    x, y, z, order = *np.ascontiguousarray(xyz.T), np.arange(count)
    sort_places(x, y, z, order, 0, count)
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


@given(SEEDS, st.integers(3, 60), st.integers(3, 20), st.booleans())
def test_planes_are_those_of_the_naive_neighbours(seed, count, k, lattice):
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 4, (count, 3)).astype(float) if lattice else rng.normal(size=(count, 3))
    k = min(k, count)
    index = build_index(points)
    found = fit_planes(index, index, k)
    for p in range(0, count, 5):
        near = points[naive.nearest(points.tolist(), points[p].tolist(), k)]
        normal, offset, residual, s = naive.plane(near)
        assert np.isnan(found.offset[p]) == (s[1] ** 2 <= 1e-12 * (s**2).sum())
        if s[1] ** 2 - s[2] ** 2 > 1e-6 * s[0] ** 2:
            assert found.residual[p] == pytest.approx(residual, abs=1e-9)
            assert abs(found.normals[p] @ normal) == pytest.approx(1, abs=1e-9)
            assert abs(found.offset[p]) == pytest.approx(abs(offset), abs=1e-6)


@given(SEEDS, st.sampled_from([1, 7, 8, 9, 200]), st.integers(3, 20))
def test_some_of_the_points_have_the_planes_of_all(seed, some, k):
    rng = np.random.default_rng(seed)
    index = build_index(rng.normal(size=(300, 3)) * [1, 1, 0.01])
    places = np.sort(rng.permutation(300)[:some])
    rows = rng.permutation(some)
    planes, distances = plane_fits_within(index, places, rows, k)
    everywhere = fit_planes(index, index, k)
    np.testing.assert_array_equal(planes.normals[rows], everywhere.normals[index.order[places]])
    np.testing.assert_array_equal(planes.residual[rows], everywhere.residual[index.order[places]])
    reach = knn(index, np.ascontiguousarray(index.xyz[:, places].T), k + 1).distances
    assert (distances[rows] >= reach[:, k - 1] * (1 - 1e-12)).all()
    assert (distances[rows] < reach[:, k] * (1 + 1e-12)).all()


@njit
def _eigenpairs(matrices, out):
    xx, xy, xz = lanes.load(matrices, 0), lanes.load(matrices, 8), lanes.load(matrices, 16)
    yy, yz, zz = lanes.load(matrices, 24), lanes.load(matrices, 32), lanes.load(matrices, 40)
    results = smallest_eigenpairs(xx, xy, xz, yy, yz, zz)
    for i in range(5):
        lanes.store(out, 8 * i, results[i])


@given(SEEDS, st.sampled_from([1e-6, 1.0, 1e6]), st.floats(0, 1), st.sampled_from([0.0, 1e-10, 1e-8, 1e-6, 1e-4, 1.0]))
def test_eigenpairs_are_those_of_lapack(seed, scale, least, middle):
    rng = np.random.default_rng(seed)
    turns = np.linalg.qr(rng.normal(size=(8, 3, 3)))[0]
    values = np.array([least * middle, middle, 1.0]) * rng.uniform(0.5, 1, (8, 3))
    m = scale * (turns * values[:, None]) @ turns.transpose(0, 2, 1)
    out = np.empty(40)
    _eigenpairs(np.concatenate([m[:, i, j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]), out)
    smallest, second, *vector = out.reshape(5, 8)
    vector = np.array(vector).T
    expected, vectors = np.linalg.eigh(m)
    size = expected[:, 2]
    gap = expected[:, 1] - expected[:, 0]
    # Two smallest eigenvalues very near each other are not always told apart, nor need be: either normal will do.
    apart, near = gap > 0.01 * size, 1e-3 if middle == 1 else 1e-5
    assert (np.abs(smallest - expected[:, 0]) < np.where(apart, 1e-14, near) * size).all()
    assert (np.abs(second - expected[:, 1]) < near * size).all()
    np.testing.assert_allclose(np.linalg.norm(vector, axis=1), 1, rtol=1e-12)
    turn = np.linalg.norm(np.cross(vector, vectors[:, :, 0]), axis=1)
    assert (turn * gap < 1e-12 * size)[apart].all()
    across = np.abs((vector * vectors[:, :, 2]).sum(axis=1))
    assert (across * (size - expected[:, 1]) < 5e-3 * size).all()  # on a line, any direction across it will do
