import naive
import numpy as np
import pytest
from scipy.spatial import KDTree

import edgel
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.normals import by_offset, fit_nearest, fit_planes
from edgel._neighbors.queries import at_points


def surface(n=2000, seed=0, noise=0.01):
    rng = np.random.default_rng(seed)
    xy = rng.random((n, 2)) * 10
    return np.c_[xy, np.sin(xy[:, 0]) + 0.3 * xy[:, 1]] + rng.normal(0, noise, (n, 3))


def angle(a, b):
    """Angle between lines, accurate near 0."""
    return np.arcsin(np.clip(np.linalg.norm(np.cross(a, b), axis=-1), 0, 1))


@pytest.mark.parametrize("shift", [[0, 0, 0], [5e5, 5e6, 300]])
@pytest.mark.parametrize("k", [4, 16, 50])
def test_planes_are_those_of_an_svd(k, shift):
    points = surface() + np.array(shift)
    found = edgel.estimate_normals(points, num_neighbors=k)
    centred = points - points.mean(axis=0)  # the oracle's own rounding must not decide at UTM coordinates
    _, rows = KDTree(centred).query(centred, k)
    compared = 0
    for p in range(0, len(points), 7):
        normal, offset, residual, s = naive.plane(centred[np.asarray(rows)[p]])
        if s[1] ** 2 - s[2] ** 2 < 1e-3 * s[0] ** 2:  # a degenerate neighbourhood has no one normal
            continue
        compared += 1
        assert angle(normal, found.normals[p]) < 1e-6
        offset = abs(offset + normal @ points.mean(axis=0))
        assert abs(found.offset[p]) == pytest.approx(offset, rel=1e-9, abs=1e-6)
        assert found.residual[p] == pytest.approx(residual, rel=1e-6, abs=1e-12)
        assert found.variation[p] == pytest.approx(s[2] ** 2 / (s**2).sum(), rel=1e-6, abs=1e-12)
    assert compared > 250
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, rtol=1e-12)


def test_the_offset_belongs_to_the_plane():
    points = surface() + [100, 200, 300]
    found = edgel.estimate_normals(points)
    assert np.abs((found.normals * points).sum(axis=1) - found.offset).max() < 0.2


def test_rows_asked_for_are_those_of_all():
    points = surface()
    everywhere = edgel.estimate_normals(points)
    at = np.random.default_rng(0).permutation(len(points))[:300]
    some = edgel.estimate_normals(points, at=at)
    mask = np.zeros(len(points), bool)
    mask[at] = True
    masked = edgel.estimate_normals(points, at=mask)
    for name in ("normals", "offset", "residual", "variation"):
        np.testing.assert_array_equal(getattr(some, name), getattr(everywhere, name)[at])
        np.testing.assert_array_equal(getattr(masked, name), getattr(everywhere, name)[mask])


def test_no_rows_asked_for_gives_none():
    found = edgel.estimate_normals(surface(), at=[])
    assert len(found) == 0
    assert found.normals.shape == (0, 3)


def test_order_and_threads_change_nothing(monkeypatch):
    grid = np.stack(np.meshgrid(np.arange(40.0), np.arange(40.0), [0.0]), axis=-1).reshape(-1, 3)
    grid[:, 2] = np.abs(grid[:, 0] - 20)  # a lattice: every neighbourhood has ties
    expected = edgel.estimate_normals(grid)
    order = np.random.default_rng(0).permutation(len(grid))
    monkeypatch.setenv("EDGEL_NUM_THREADS", "3")
    shuffled = edgel.estimate_normals(grid[order])
    np.testing.assert_array_equal(shuffled.normals, expected.normals[order])
    np.testing.assert_array_equal(shuffled.residual, expected.residual[order])


def test_normals_turn_to_the_viewpoint():
    rng = np.random.default_rng(0)
    sphere = rng.normal(size=(4000, 3))
    sphere = 3 * sphere / np.linalg.norm(sphere, axis=1, keepdims=True) + [10, 0, 0]
    inside = edgel.estimate_normals(sphere, viewpoint=[10, 0, 0])
    assert ((inside.normals * ([10, 0, 0] - sphere)).sum(axis=1) > 0).all()
    above = edgel.estimate_normals(sphere)
    assert (above.normals[:, 2] >= 0).all()
    known = edgel.estimate_normals(edgel.Cloud(sphere, viewpoint=np.array([10.0, 0, 0])))
    np.testing.assert_array_equal(known.normals, inside.normals)
    paper = by_offset(above)
    assert (paper.offset >= 0).all()
    np.testing.assert_array_equal(np.abs(paper.normals), np.abs(above.normals))


def test_degenerate_neighbourhoods_have_no_normal():
    line = np.c_[np.arange(50.0), np.zeros(50), np.zeros(50)]
    spot = np.ones((50, 3))
    for points in (line, spot, line + [5e6, 5e6, 0], line @ np.linalg.qr(np.random.default_rng(0).random((3, 3)))[0]):
        found = edgel.estimate_normals(points)
        assert np.isnan(found.normals).all()
        assert found.num_undefined == 50


def test_points_that_are_not_finite_have_no_normal_and_disturb_none():
    points = surface(500)
    holes = np.insert(points, [0, 100, 500], np.nan, axis=0)
    found = edgel.estimate_normals(holes)
    finite = np.isfinite(holes[:, 0])
    assert np.isnan(found.normals[~finite]).all()
    np.testing.assert_array_equal(found.normals[finite], edgel.estimate_normals(points).normals)


def test_fewer_points_than_neighbours_are_all_used():
    points = np.array([[0.0, 0, 1], [1, 0, 1], [0, 1, 1]])
    np.testing.assert_allclose(edgel.estimate_normals(points).normals, [[0, 0, 1]] * 3, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"num_neighbors": 2}, ValueError, "num_neighbors"),
        ({"num_neighbors": 5.5}, ValueError, "num_neighbors"),
        ({"at": [2000]}, ValueError, "0..1999"),
        ({"at": [-1]}, ValueError, "0..1999"),
        ({"at": [0.5]}, TypeError, "row numbers"),
        ({"at": np.zeros(3, bool)}, ValueError, "mask"),
        ({"viewpoint": [0, 0]}, ValueError, "viewpoint"),
        ({"viewpoint": [0, 0, np.nan]}, ValueError, "viewpoint"),
    ],
)
def test_wrong_options_are_named(options, error, message):
    with pytest.raises(error, match=message):
        edgel.estimate_normals(surface(), **options)


def test_planes_by_nearness_are_those_of_the_tree_and_the_same_in_a_part():
    rng = np.random.default_rng(5)
    xyz = np.column_stack([*rng.uniform(0, 40, (2, 3000)), 0.05 * rng.standard_normal(3000)]) + [5e5, 5e6, 100]
    asked = np.flatnonzero(np.abs(xyz[:, 0] - 500_010) < 4)
    whole, part = build_index(xyz), np.flatnonzero(xyz[:, 0] < 500_020)
    planes, wanted = (fit(whole, at_points(whole, asked), 16) for fit in (fit_nearest, fit_planes))
    for name, near in (("normals", 1e-9), ("offset", 1e-3), ("residual", 1e-9), ("variation", 1e-9)):
        np.testing.assert_allclose(getattr(planes, name), getattr(wanted, name), atol=near)
    index = build_index(np.ascontiguousarray(xyz[part]))
    again = fit_nearest(index, at_points(index, np.searchsorted(part, asked)), 16)
    for name in ("normals", "offset", "residual", "variation"):
        assert getattr(again, name).tobytes() == getattr(planes, name).tobytes()
