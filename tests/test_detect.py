"""The default detector: what it must find today, and what must hold of any detector."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import edgel
from edgel import EdgeKind


def box(spacing=0.02, seed=0):
    """The faces of a unit cube, each a jittered lattice that stays a little inside the face."""
    rng = np.random.default_rng(seed)
    a = np.arange(0, 1 + spacing / 2, spacing)
    u, v = (g.ravel() for g in np.meshgrid(a, a))
    faces = [np.c_[u, v, np.full_like(u, w)][:, axes] for w in (0.0, 1.0) for axes in ([0, 1, 2], [0, 2, 1], [2, 0, 1])]
    points = np.concatenate(faces) + rng.uniform(-0.05, 0.05, (6 * len(u), 3)) * spacing
    return np.unique(np.round(points, 9), axis=0)


def to_nearest_cube_edge(points):
    gap = np.sort(np.minimum(np.abs(points), np.abs(points - 1)), axis=1)
    return np.hypot(gap[:, 0], gap[:, 1])


def assert_well_formed(found, points):
    """What holds of every answer, whatever the detector."""
    num = len(found)
    shapes = {"index": (num,), "kind": (num,), "strength": (num,), "position": (num, 3), "direction": (num, 3)}
    shapes |= {"normals": (num, 2, 3), "angle": (num,), "convex": (num,)}
    types = {"index": np.int64, "kind": np.uint8, "convex": np.int8}
    for name, shape in shapes.items():
        values = getattr(found, name)
        assert values.shape == shape, name
        assert values.dtype == types.get(name, np.float64), name
    assert (np.diff(found.index) > 0).all()
    assert (found.kind > 0).all()
    assert ((found.strength > 0) & (found.strength <= 1)).all()
    assert np.isfinite(points.reshape(-1, 3)[found.index]).all()
    assert np.isfinite(found.position).all()
    for units in (found.direction, found.normals[:, 0], found.normals[:, 1]):
        known = ~np.isnan(units).any(axis=1)
        assert np.isnan(units[~known]).all()
        np.testing.assert_allclose(np.linalg.norm(units[known], axis=1), 1)
    two = ~np.isnan(found.normals[:, :, 0]).any(axis=1)
    assert not np.isnan(found.normals[~np.isnan(found.normals[:, 1, 0]), 0]).any()
    assert (two | np.isnan(found.angle)).all()
    assert ((found.angle >= 0) & (found.angle <= np.pi) | np.isnan(found.angle)).all()
    assert np.isin(found.convex, (-1, 0, 1)).all()
    assert found.num_without_normal == np.isnan(found.normals[:, 0]).any(axis=1).sum()
    assert found.method in {"surface", "organized", "orthographic", "pinhole", "spherical", "paper"}


def test_the_creases_of_a_cube_are_found():
    points = box()
    found = edgel.detect(points)
    crease = found.index[(found.kind & EdgeKind.CREASE) > 0]
    assert to_nearest_cube_edge(points[crease]).max() < 0.02
    true = to_nearest_cube_edge(points) < 0.003
    assert np.isin(np.flatnonzero(true), crease).mean() > 0.9


def test_the_boundary_of_a_sheet_is_found_and_nothing_else():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(60.0), np.arange(40.0))
    sheet = np.c_[x.ravel(), y.ravel(), 0.02 * x.ravel() ** 2] + rng.uniform(-0.1, 0.1, (2400, 3)) * [1, 1, 0]
    found = edgel.detect(sheet)
    border = (x == 0) | (x == 59) | (y == 0) | (y == 39)
    assert (found.kind == EdgeKind.BOUNDARY).all()
    assert np.isin(np.flatnonzero(border.ravel()), found.index).mean() > 0.95
    near = (x <= 1) | (x >= 58) | (y <= 1) | (y >= 38)
    assert near.ravel()[found.index].mean() > 0.99


def test_a_sphere_has_none():
    z = np.linspace(-1, 1, 5001)[1:-1]
    turn = np.arange(len(z)) * np.pi * (3 - np.sqrt(5))  # a spiral that spreads points evenly
    r = np.sqrt(1 - z**2)
    assert len(edgel.detect(np.c_[r * np.cos(turn), r * np.sin(turn), z])) == 0


def test_a_plane_parallel_to_z_is_like_any_other():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    flat = np.c_[x.ravel(), y.ravel(), np.zeros(900)] + rng.uniform(-0.1, 0.1, (900, 3)) * [1, 1, 0]
    expected = edgel.detect(flat)
    assert 0 < len(expected) < 200
    np.testing.assert_array_equal(edgel.detect(flat[:, [2, 0, 1]]).index, expected.index)


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_motion_scale_and_order_change_nothing(seed):
    rng = np.random.default_rng(seed)
    points = box(0.05)
    expected = edgel.detect(points)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    moved = edgel.detect(1000 * points @ q.T + rng.uniform(-1e4, 1e4, 3))
    # Motion rounds coordinates, which only decides where a point lies on a threshold.
    assert len(np.setxor1d(moved.index, expected.index)) <= 0.005 * len(expected)
    order = rng.permutation(len(points))
    shuffled = edgel.detect(points[order])
    np.testing.assert_array_equal(np.sort(order[shuffled.index]), expected.index)


def test_any_number_of_threads_gives_the_same(monkeypatch):
    points = box()
    monkeypatch.setenv("EDGEL_NUM_THREADS", "1")
    one = edgel.detect(points)
    monkeypatch.setenv("EDGEL_NUM_THREADS", "4")
    four = edgel.detect(points)
    for name in ("index", "kind", "strength", "normals"):
        np.testing.assert_array_equal(getattr(one, name), getattr(four, name))


def test_the_answer_is_well_formed():
    points = np.insert(box()[len(box()) // 3 :], 7, np.nan, axis=0)  # cut open: creases and a boundary
    found = edgel.detect(points, viewpoint=[0.5, 0.5, 9], method="surface")
    assert (np.diff(found.index) > 0).all()
    assert found.index.min() >= 0
    assert found.index.max() < len(points)
    assert np.isfinite(points[found.index]).all()
    assert ((found.strength > 0) & (found.strength <= 1)).all()
    assert found.num_dropped == 1
    first = found.normals[:, 0]
    np.testing.assert_allclose(np.linalg.norm(first, axis=1), 1)
    assert ((([0.5, 0.5, 9] - points[found.index]) * first).sum(axis=1) >= 0).all()
    everywhere = edgel.estimate_normals(points, viewpoint=[0.5, 0.5, 9])
    alone = np.isnan(found.normals[:, 1, 0])  # elsewhere each face has its own fit
    assert alone.any()
    np.testing.assert_allclose(first[alone], everywhere.normals[found.index][alone], atol=1e-9)
    assert_well_formed(found, points)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.empty((0, 3)), "at least 3"),
        (np.zeros((2, 3)), "at least 3"),
        (np.ones((50, 3)), "one line or spot"),
        (np.c_[np.arange(50.0), np.zeros((50, 2))], "one line or spot"),
        (np.full((50, 3), np.inf), "0 finite points of 50"),
        (np.zeros((3, 50)), "points.T"),
    ],
)
def test_bad_input_is_named_with_its_remedy(points, message):
    with pytest.raises(ValueError, match=message):
        edgel.detect(points)


def test_three_points_and_repeats_are_answered():
    assert edgel.detect(np.eye(3)).num_points == 3
    points = np.repeat(box(0.1), 5, axis=0)
    found = edgel.detect(points)
    assert found.num_points == len(points)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "best"}, "method: expected one of auto"),
        ({"method": "paper"}, "method: .*published method is edgel.paper.detect"),
        ({"scale": 0.5}, "scale: expected 1"),
        ({"scale": np.nan}, "scale: expected 1"),
        ({"min_strength": 0}, "min_strength: expected a number above 0"),
        ({"min_strength": 1.5}, "min_strength: expected a number above 0"),
        ({"kinds": "sharp"}, "kinds: 'sharp' is unknown; choose from boundary"),
        ({"kinds": ["crease", "image"]}, "kinds: 'image' is unknown"),
        ({"kinds": EdgeKind.IMAGE}, "kinds: expected some of boundary"),
        ({"kinds": []}, "kinds: none is asked for"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        edgel.detect(box(0.1), **options)


def test_names_of_kinds_are_names():
    with pytest.raises(TypeError, match="kinds: expected EdgeKind flags or names"):
        edgel.detect(box(0.1), kinds=[8])  # pyright: ignore[reportArgumentType]


def test_only_the_kinds_asked_for_are_answered():
    points = box()[: 2 * len(box()) // 3]  # cut open: it has a boundary too
    every = edgel.detect(points)
    assert every.method == "surface"
    assert every.reason
    assert sum(every.count_kinds().values()) >= len(every)
    for kind in (EdgeKind.BOUNDARY, EdgeKind.CREASE):
        name = str(kind.name).lower()
        found = edgel.detect(points, kinds=kind)
        of_kind = (every.kind & kind) > 0
        assert found.count_kinds() == {name: of_kind.sum()}
        np.testing.assert_array_equal(found.index, every.index[of_kind])
        np.testing.assert_array_equal(edgel.detect(points, kinds=[name.upper()]).index, found.index)
        assert_well_formed(found, points)
    with pytest.raises(ValueError, match="red, green and blue"):
        edgel.detect(points, kinds="color")


@pytest.mark.parametrize("organized", [False, True])
def test_a_lower_strength_adds_points_and_changes_none(organized):
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.arange(60.0), np.arange(50.0))
    points = np.stack([x, y, np.abs(x - 25) + 9 * (y > 30)], axis=-1) + 0.15 * rng.standard_normal((50, 60, 3))
    points = points if organized else points.reshape(-1, 3)
    faint = edgel.detect(points, min_strength=0.2)
    plain = edgel.detect(points)
    assert faint.strength.min() >= 0.2
    assert len(faint) > len(plain) > 0
    kept = faint.take(faint.strength >= 0.5)
    for name in ("index", "kind", "strength", "position", "direction", "normals", "angle", "convex"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(plain, name), err_msg=name)
