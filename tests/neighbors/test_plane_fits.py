"""Plane fits to the neighbours of eight points in step, against the naive ones."""

import naive
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.normals import fit_planes, fit_planes_within
from edgel._neighbors.queries import at_places, every_point

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS, st.integers(3, 60), st.integers(3, 20), st.booleans())
def test_planes_are_those_of_the_naive_neighbours(seed, count, k, lattice):
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 4, (count, 3)).astype(float) if lattice else rng.normal(size=(count, 3))
    k = min(k, count)
    index = build_index(points)
    found = fit_planes(index, every_point(index), k)
    for p in range(0, count, 5):
        near = points[naive.nearest(points.tolist(), points[p].tolist(), k)]
        normal, offset, residual, s = naive.plane(near)
        assert np.isnan(found.offset[p]) == (s[1] ** 2 <= 1e-12 * (s**2).sum())
        if s[1] ** 2 - s[2] ** 2 > 1e-6 * s[0] ** 2:
            assert found.residual[p] == pytest.approx(residual, abs=1e-9)
            assert abs(found.normals[p] @ normal) == pytest.approx(1, abs=1e-9)
            assert abs(found.offset[p]) == pytest.approx(abs(offset), abs=1e-6)


@given(SEEDS, st.sampled_from([1, 7, 8, 9, 200]), st.integers(3, 20))
@example(1893, 200, 3)  # exactly k within the reach of a group
def test_some_of_the_points_have_the_planes_of_all(seed, some, k):
    rng = np.random.default_rng(seed)
    index = build_index(rng.normal(size=(300, 3)) * [1, 1, 0.01])
    places = np.sort(rng.permutation(300)[:some])
    targets = rng.permutation(some)
    planes, distances = fit_planes_within(index, at_places(index, places, targets), k)
    everywhere = fit_planes(index, every_point(index), k)
    np.testing.assert_array_equal(planes.normals[targets], everywhere.normals[index.order[places]])
    np.testing.assert_array_equal(planes.residual[targets], everywhere.residual[index.order[places]])
    reach = knn(index, np.ascontiguousarray(index.xyz[:, places].T), k + 1).distances
    assert (distances[targets] >= reach[:, k - 1] * (1 - 1e-12)).all()
    assert (distances[targets] < reach[:, k] * (1 + 1e-12)).all()
