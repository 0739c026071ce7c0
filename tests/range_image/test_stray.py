"""Points floating alone do not show; edges, wires, steep and noisy surfaces do."""

import naive
import numpy as np
import pytest
from range_images import KINDS, grid, holes, image_of, white

from edgel._range_image.rays import trace_rays
from edgel._range_image.stray import CLOSE, HELD, ON_LINE, without_stray

SHAPE = (60, 70)
ROW, COL = grid(*SHAPE)


def kept(kind, height, pitch=(1.0, 1.0)):
    return np.isfinite(without_stray(trace_rays(*image_of(kind, height, pitch))).near)


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("share", [0.01, 0.05])
@pytest.mark.parametrize("kind", KINDS)
def test_outliers_are_dropped(kind, share, noise):
    height = 0.5 * COL + noise * white(SHAPE)
    out = holes(SHAPE, share)
    far = np.random.default_rng(1).uniform(10, 40, SHAPE) * np.where(white(SHAPE, 2) > 0, 1, -1)
    found = kept(kind, np.where(out, height + far, height))
    assert found[~out].all()
    assert found[out].mean() < 0.03  # by chance some lie beside each other


@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("slope", [0.0, 1.0, 4.0, 12.0])
def test_steep_and_noisy_surfaces_stay(slope, noise):
    assert kept("parallel", slope * (0.8 * ROW - 0.6 * COL) + noise * white(SHAPE)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_both_sides_of_steps_corners_and_wires_stay(kind):
    stair = 10.0 * (COL + 0.4 * ROW > 0) + 20.0 * ((ROW > 10) & (COL < 3))
    assert kept(kind, stair).all()
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]]
    for wire in (col == row * 7 // 10 + 5, row == col * 3 // 10 + 9, col == 12, row == 12, row + col == 60):
        found = kept(kind, np.where(wire, 20.0, 0.0))
        assert found[~wire].all()
        assert np.count_nonzero(~found) <= 2  # its ends


def test_what_stands_alone_over_nothing_is_dropped():
    height = np.full(SHAPE, np.nan)
    height[30, 30] = 1.0
    height[10:13, 10:13] = 1.0
    found = kept("pinhole", height)
    assert found.sum() == 9
    assert found[10:13, 10:13].all()


def test_where_lines_lie_far_apart_a_line_holds_itself():
    height = np.zeros((9, 40))
    height[4, 20] = 15.0
    height[6] = np.nan
    found = kept("spherical", height, (8.0, 1.0))
    assert not found[4, 20]
    assert np.count_nonzero(~found) == 1 + 40


def test_outliers_are_dropped_where_a_floor_falls_from_line_to_line():
    """Neighbours on other lines are no help: how far they are off says nothing of the slope along a line."""
    row, _ = grid(21, 60)
    height = 0.5 * 4.0 * row + 0.05 * white(row.shape)
    steep = 1.0 * 4.0 * row + 0.05 * white(row.shape)
    for floor in (height, steep):
        out = np.zeros(row.shape, bool)
        out[3::5, 7::9] = True
        found = kept("parallel", np.where(out, floor + 20.0, floor), (4.0, 1.0))
        assert found[~out].all()
        assert not found[out].any()


@pytest.mark.parametrize("pitch", [(1.0, 1.0), (4.0, 1.0)])
def test_equal_naive(pitch):
    shape = (35, 20)  # more rows than a band
    row, col = grid(*shape)
    height = 2.5 * col + 8.0 * (row > 4) + 0.5 * white(shape)
    height[holes(shape, 0.15, 1)] = np.nan
    out = holes(shape, 0.1, 2)
    height[out] += 20 * white(shape, 3)[out]
    rays = trace_rays(*image_of("parallel", height, pitch))
    step = np.abs(rays.near[::4, 1::4] - rays.near[::4, :-1:4][:, : rays.near[::4, 1::4].shape[1]])
    usual = np.nanmedian(step) / rays.side
    close = np.full(shape, CLOSE * (1 + usual) * rays.side)
    apart = pitch[0] > 1.7
    wanted = naive.held(rays.near, close, ON_LINE if apart else HELD, (int(not apart), 1))
    assert np.isnan(wanted).sum() > np.isnan(height).sum()
    np.testing.assert_array_equal(without_stray(rays).near, wanted.astype(np.float32))


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2)])
def test_small_images(shape):
    inner = np.zeros(shape, bool)
    inner.ravel()[2:-2] = max(shape) > 2
    assert kept("pinhole", np.zeros(shape))[inner | (shape == (2, 2))].all()
    assert not kept("pinhole", np.full(shape, np.nan)).any()
