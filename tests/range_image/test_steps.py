"""Steps in depth have a near and a far side, voids have rims, and slopes, folds, noise and outliers have neither."""

import naive
import numpy as np
import pytest
from range_images import KINDS, grid, holes, image_of, smoothed, white

from edgel._range_image.facet_fits import fit_facets
from edgel._range_image.rays import trace_rays
from edgel._range_image.steps import BRIDGE, BRIDGED, find_rims, find_steps, find_voids
from edgel._range_image.stray import without_stray

SHAPE = (60, 80)
ROW, COL = grid(*SHAPE)
NEAR, FAR = 2, 4  # OCCLUDING, OCCLUDED
INSIDE = (np.abs(ROW) < 26) & (np.abs(COL) < 36)


def found(kind, height, pitch=(1.0, 1.0)):
    """Sides (H, W) of the steps that are likely, 0 elsewhere, and rims (H, W)."""
    rays = without_stray(trace_rays(*image_of(kind, height, pitch)))
    void = find_voids(rays)
    level, side = find_steps(rays, fit_facets(rays), void)
    return np.where(level >= 1, side, 0), find_rims(rays.near, void)


def stair(height=10.0, noise=0.0, seed=2):
    """A slanted floor whose left half is raised."""
    return 0.3 * COL - 0.2 * ROW + height * (COL < 0) + noise * white(SHAPE, seed)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("kind", KINDS)
def test_a_stair_has_a_near_and_a_far_side(kind, noise):
    side, _ = found(kind, stair(noise=noise))
    for flag, column in ((NEAR, 39), (FAR, 40)):
        flagged, wanted = side == flag, np.zeros(SHAPE, bool)
        wanted[:, column] = True
        assert (flagged & wanted).sum() >= 0.95 * wanted.sum()
        assert (flagged & ~wanted).sum() <= 0.05 * wanted.sum()


def test_a_slanting_stair_too():
    """Every pixel of 4 neighbours on the other side is flagged, and no other."""
    up = COL + 0.4 * ROW < 0.1
    side, _ = found("parallel", 0.3 * COL + 10.0 * up + 0.1 * white(SHAPE))
    padded = np.pad(up, 1, mode="edge")
    around = [padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]]
    assert ((side == NEAR) == up & ~np.logical_and.reduce(around))[INSIDE].mean() > 0.998
    assert ((side == FAR) == ~up & np.logical_or.reduce(around))[INSIDE].mean() > 0.998


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("slope", [0.0, 1.0, 4.0])
def test_slanted_planes_have_none(slope, noise):
    side, rim = found("parallel", slope * (0.8 * COL - 0.6 * ROW) + noise * white(SHAPE))
    assert not side.any()
    assert not rim.any()


def test_what_a_camera_sees_at_a_glancing_angle_has_none():
    """A plane at up to 80 degrees from the front."""
    depth = 100 / (1 + 1.7 * COL / 90)
    height = np.where((depth > 0) & (depth < 300), 100 - depth, np.nan)
    for noise in (0.0, 0.05):
        side, _ = found("pinhole", height + noise * white(SHAPE), (100 / 90, 100 / 90))
        assert not side.any()


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("shift", [0.05, 0.3, 0.6])
def test_a_pipe_seen_from_its_side_turns_away_in_rims_and_no_steps(shift, noise):
    height = np.sqrt(np.clip(1200 * (26 + shift - np.abs(ROW)), 0, None)) + noise * white(SHAPE)
    side, rim = found("parallel", np.where(INSIDE, height, np.nan))
    assert not side.any()
    assert np.array_equal(rim, INSIDE & ((np.abs(ROW) > 25) | (np.abs(COL) > 35)))


def test_a_plate_before_a_slanted_wall():
    depth = 100 / (1 + 1.0 * COL / 90)
    plate = (np.abs(COL) < 10) & (np.abs(ROW) < 12)
    side, _ = found("pinhole", 100 - np.where(plate, 50.0, depth), (100 / 90, 100 / 90))
    assert np.array_equal(side == NEAR, plate & ~((np.abs(COL) < 9) & (np.abs(ROW) < 11)))
    around = ~plate & (((np.abs(COL) < 11) & (np.abs(ROW) < 12)) | ((np.abs(COL) < 10) & (np.abs(ROW) < 13)))
    assert np.array_equal(side == FAR, around)


@pytest.mark.parametrize("sign", [-1, 1])
def test_folds_are_none(sign):
    for noise in (0.0, 0.1, 0.3):
        assert not found("parallel", sign * 3 * np.abs(COL + 0.3 * ROW) + noise * white(SHAPE))[0].any()


@pytest.mark.parametrize("share", [0.01, 0.05])
def test_outliers_are_none(share):
    out = holes(SHAPE, share)
    height = np.where(out, np.random.default_rng(8).uniform(-20, 40, SHAPE), stair(0.0, 0.1))
    side, rim = found("parallel", height)
    assert np.count_nonzero(side) <= 10
    assert not rim.any()


def test_a_small_step_is_none():
    """Less than 2 spacings."""
    assert not found("parallel", stair(height=1.5))[0].any()
    assert found("parallel", stair(height=3.0))[0].any()


def test_small_holes_are_bridged_and_wide_ones_have_rims():
    height = stair(height=0.0)
    height[holes(SHAPE, 0.05)] = np.nan
    height[20:22, 10:30] = np.nan
    side, rim = found("parallel", height)
    assert not side.any()
    assert not rim.any()
    height[35:45, 50:60] = np.nan
    side, rim = found("parallel", height)
    near = np.zeros(SHAPE, bool)
    near[32:48, 47:63] = True
    assert rim[near].sum() >= 36
    assert not rim[~near].any()
    assert not side.any()


@pytest.mark.parametrize("wide", range(1, BRIDGE + 1))
def test_a_step_across_a_small_hole_is_a_step(wide):
    height = stair()
    height[:, 40 - wide // 2 : 40 - wide // 2 + wide] = np.nan
    side, rim = found("parallel", height)
    assert not rim.any()
    first, last = 39 - wide // 2, 40 - wide // 2 + wide
    assert (side[3:-3, first] == NEAR).all()
    assert (side[3:-3, last] == FAR).all()
    assert not np.delete(side, [first, last], axis=1).any()


def test_across_a_void_there_is_no_step():
    height = stair()
    height[:, 38:44] = np.nan
    side, rim = found("parallel", height)
    assert not side.any()
    assert rim[:, [37, 44]].all()
    assert rim.sum() == 2 * SHAPE[0]


def test_smoothed_noise_and_smeared_steps():
    """A sensor that matches windows: the step spreads over pixels, and its noise alone makes none."""
    noise = 0.5 * smoothed(SHAPE, 5)
    assert not found("parallel", 0.3 * ROW + noise)[0].any()
    smeared = np.clip(COL + 0.5, -1, 1) * -6.0 + 0.3 * ROW + noise
    side, _ = found("parallel", smeared)
    rows = (side == NEAR).any(axis=1) & (side == FAR).any(axis=1)
    assert rows[3:-3].mean() > 0.9
    assert np.abs(COL[side > 0]).max() < 4
    assert (COL[side == NEAR] < 2).all()
    assert (COL[side == FAR] > -2).all()


def test_rounded_depths_give_none():
    for step in (1.0, 2.5):
        assert not found("parallel", step * np.round((0.9 * COL - 0.8 * ROW) / step))[0].any()


def test_lines_far_apart():
    side, rim = found("spherical", stair(noise=0.1), (3.0, 1.0))
    assert (side[3:-3, 39] == NEAR).mean() > 0.95
    assert (side[3:-3, 40] == FAR).mean() > 0.95
    assert not rim.any()


@pytest.mark.parametrize("pitch", [(1.0, 1.0), (2.5, 1.0), (1.0, 2.5)])
@pytest.mark.parametrize("share", [0.5, 0.8])
def test_voids_and_rims_equal_naive(pitch, share):
    shape = (40, 50)  # more than two bands
    hole = holes(shape, share)
    hole[15:18, 20:28] = True
    rays = trace_rays(*image_of("parallel", np.where(hole, np.nan, 0.0), pitch))
    size = {1.0: (BRIDGE + 1,) * 2, 2.5: (1, BRIDGED + 1), 0.4: (BRIDGED + 1, 1)}[pitch[0] / pitch[1]]
    void = find_voids(rays)
    assert np.array_equal(void > 0, naive.voids(hole, size))
    assert void.any()
    assert np.array_equal(find_rims(rays.near, void), naive.rims(hole, void > 0))


def test_threads_do_not_matter(monkeypatch):
    answers = []
    for threads in ("1", "2"):
        monkeypatch.setenv("EDGEL_NUM_THREADS", threads)
        answers.append(found("pinhole", stair(noise=0.3)))
    assert np.array_equal(answers[0], answers[1])


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (2, 2), (3, 3)])
def test_small_images(shape):
    for height in (np.zeros(shape), np.full(shape, np.nan)):
        side, rim = found("pinhole", height)
        assert not side.any()
        assert not rim.any()
