"""Outlines of views: steps in depth, rims beside voids, and what is neither."""

import naive
import numpy as np
import pytest

from edgel._range_image.facets import _without_isolated, local_planes, noise_level
from edgel._range_image.outline import Outline, beside_void, level_gaps, outlines
from edgel._range_image.range_image import RangeImage, organized, orthographic
from edgel.edges import EdgeKind

DOWN = np.array([0.0, 0.0, -1.0])
RNG = np.random.default_rng(5)
STEPS = EdgeKind.OCCLUDING | EdgeKind.OCCLUDED


def heights(z):
    """Points of a height map, pitch 1, row-major; NaN heights left out."""
    y, x = np.mgrid[: z.shape[0], : z.shape[1]].astype(float)
    xyz = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return xyz[np.isfinite(xyz[:, 2])]


def found(xyz):
    """What counts by default: strength of a half or more."""
    outline = outlines(orthographic(xyz, DOWN), xyz)
    sure = outline.strength >= 0.5
    return Outline(np.where(sure, outline.kind, 0), np.where(sure, outline.strength, 0))


def stair(noise=0.0, height=10.0):
    """A slanted floor whose left half is raised."""
    y, x = np.mgrid[:60, :80]
    return 0.3 * x - 0.2 * y + height * (x < 40) + noise * np.random.default_rng(2).standard_normal(x.shape)


def inside(xyz):
    return (xyz[:, :2] > 3).all(axis=1) & (xyz[:, 0] < 76) & (xyz[:, 1] < 56)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("slope", [0.0, 1.0, 4.0])
def test_a_slanted_plane_has_its_rim_only(slope, noise):
    xyz = heights(stair(noise, height=0.0) * 1.0 + slope * np.mgrid[:60, :80][1])
    outline = found(xyz)
    assert not outline.kind[inside(xyz)].any()
    rim = (xyz[:, 0] % 79 == 0) | (xyz[:, 1] % 59 == 0)
    assert ((outline.kind & EdgeKind.BOUNDARY) > 0).tolist() == rim.tolist()


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3, 1.0])
def test_a_step_has_a_near_and_a_far_side(noise):
    xyz = heights(stair(noise))
    outline = found(xyz)
    for side, column in ((EdgeKind.OCCLUDING, 39), (EdgeKind.OCCLUDED, 40)):
        flagged = inside(xyz) & ((outline.kind & side) > 0)
        wanted = inside(xyz) & (xyz[:, 0] == column)
        assert (flagged & wanted).sum() >= 0.95 * wanted.sum()
        assert (flagged & ~wanted).sum() <= 0.05 * wanted.sum()
    assert ((outline.strength > 0) == (outline.kind > 0)).all()
    assert outline.strength.max() <= 1


def test_a_fold_is_no_step():
    x = np.mgrid[:60, :80][1]
    xyz = heights(-3.0 * np.abs(x - 40.4))
    assert not found(xyz).kind[inside(xyz)].any()


@pytest.mark.parametrize("share", [0.01, 0.05])
def test_points_floating_alone_are_no_edge(share):
    z = stair(0.1, height=0.0)
    out = np.random.default_rng(7).random(z.shape) < share
    z[out] = np.random.default_rng(8).uniform(-20, 40, out.sum())
    xyz = heights(z)
    assert np.count_nonzero(found(xyz).kind[inside(xyz)]) <= 10


def test_small_holes_are_bridged_and_wide_ones_are_not():
    z = stair(height=0.0)
    z[np.random.default_rng(1).random(z.shape) < 0.05] = np.nan
    z[20:22, 10:30] = np.nan
    clean = z.copy()
    clean[35:45, 50:60] = np.nan
    xyz = heights(z)
    assert not found(xyz).kind[inside(xyz)].any()
    xyz = heights(clean)
    kind = found(xyz).kind
    near = (np.abs(xyz[:, 0] - 54.5) < 6) & (np.abs(xyz[:, 1] - 39.5) < 6)
    assert (kind[near] == EdgeKind.BOUNDARY).sum() >= 36
    assert not kind[inside(xyz) & ~near & ((np.abs(xyz[:, :2] - (54.5, 39.5)) > 8).any(axis=1))].any()


def test_a_step_across_a_small_hole_is_a_step():
    z = stair()
    z[:, 39:41] = np.nan
    xyz = heights(z)
    kind = found(xyz).kind
    assert (kind[inside(xyz) & (xyz[:, 0] == 38)] & EdgeKind.OCCLUDING).all()
    assert (kind[inside(xyz) & (xyz[:, 0] == 41)] & EdgeKind.OCCLUDED).all()


def test_rounded_depths_give_no_steps():
    y, x = np.mgrid[:120, :160]
    xyz = heights(2.5 * np.round((0.9 * x - 0.8 * y) / 2.5))
    assert level_gaps(xyz, DOWN) == pytest.approx(np.full(len(xyz), 2.5))
    assert not np.any(found(xyz).kind & STEPS)


def test_a_camera_sees_the_same():
    """A plane that a camera sees at 80 degrees from the front, and a plate before it."""
    v, u = np.mgrid[:80, :100]
    rays = np.stack([(u - 49.7) / 90, (v - 39.6) / 90, np.ones(u.shape)], axis=-1)
    depth = 100 / (1 + 1.7 * rays[..., 0])
    plate = (abs(u - 50) <= 10) & (abs(v - 40) <= 12)
    xyz = (rays * np.where(plate, 50.0, depth)[..., None]).reshape(-1, 3)
    kind = outlines(organized(xyz, np.arange(len(xyz)), plate.shape), xyz).kind.reshape(plate.shape)
    assert np.array_equal(kind == EdgeKind.OCCLUDING, plate & ~((abs(u - 50) < 10) & (abs(v - 40) < 12)))
    around = ~plate & (((abs(u - 50) <= 11) & (abs(v - 40) <= 12)) | ((abs(u - 50) <= 10) & (abs(v - 40) <= 13)))
    assert np.array_equal(kind == EdgeKind.OCCLUDED, around)


def test_order_threads_and_place_do_not_matter(monkeypatch):
    xyz = heights(np.round(stair(0.3), 3))
    first = found(xyz)
    order = np.random.default_rng(3).permutation(len(xyz))
    monkeypatch.setenv("EDGEL_NUM_THREADS", "1")
    assert np.array_equal(found(xyz[order]).kind, first.kind[order])
    moved = found(xyz + (512_000, 4_096_000, 1024))
    assert np.mean(moved.kind == first.kind) > 0.999


def test_noise_level_is_measured():
    xyz = heights(stair(0.5))
    level = noise_level(orthographic(xyz, DOWN))
    assert np.median(level) == pytest.approx(0.5, rel=0.15)


def test_nothing_but_a_few_points():
    for xyz in (np.eye(3), np.zeros((3, 3)), np.arange(30.0).reshape(10, 3)):
        outline = found(xyz)
        assert outline.kind.shape == outline.strength.shape == (len(xyz),)


def test_kernels_equal_naive():
    depth = stair(0.2)[:14, 30:46]
    depth[RNG.random(depth.shape) < 0.1] = np.nan
    close = np.full(depth.shape, 1.5)
    kept = np.full(depth.shape, np.nan)
    _without_isolated(0, len(depth), depth, close, kept)
    assert np.array_equal(kept, naive.held(depth, close), equal_nan=True)
    known = np.flatnonzero(~np.isnan(depth))
    planes = local_planes(depth, np.full(depth.shape, 0.2), known, False, 3)
    for (row, col), plane in zip(np.argwhere(~np.isnan(depth)), planes, strict=True):
        assert plane[:4] == pytest.approx(naive.facet(depth, 0.2, row, col, 3), abs=1e-9)
    hole = RNG.random((40, 50)) < 0.7
    assert np.array_equal(beside_void(np.where(hole, np.nan, 1.0)), naive.beside_void(hole))


def test_an_empty_image_has_no_edge():
    nothing = RangeImage(np.full((5, 5), np.nan), np.full((5, 5), -1), "organized", (1.0, 1.0), None, DOWN, np.zeros(0))
    assert len(outlines(nothing, np.zeros((0, 3))).kind) == 0
