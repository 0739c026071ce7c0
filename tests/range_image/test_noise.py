"""The noise of a view: how much, and whether neighbours share it."""

import numpy as np
import pytest
from range_images import KINDS, grid, holes, image_of, smoothed, white

from edgel._range_image.facet_fits import fit_facets
from edgel._range_image.rays import trace_rays

SHAPE = (120, 140)
ROW, COL = grid(*SHAPE)
FINE = (0.5, 0.5)  # so narrow a view that its pixels are about alike


def look(kind, height, pitch=FINE):
    rays = trace_rays(*image_of(kind, height, pitch))
    facets = fit_facets(rays)
    return facets, facets.noise / rays.spacing(facets.ray[3])


@pytest.mark.parametrize("noise", [0.1, 0.3, 1.0])
@pytest.mark.parametrize("kind", KINDS)
def test_level_of_white_noise(kind, noise):
    facets, level = look(kind, 0.5 * noise * white(SHAPE))
    assert np.median(level) == pytest.approx(noise, rel=0.1)
    assert facets.white


@pytest.mark.parametrize("noise", [0.1, 0.3])
def test_steps_folds_holes_and_slopes_do_not_raise_the_level(noise):
    height = 10.0 * (COL > 7) - np.abs(ROW) + 0.7 * COL + noise * white(SHAPE)
    height[holes(SHAPE, 0.1)] = np.nan
    facets, level = look("parallel", height, (1.0, 1.0))
    assert np.median(level) == pytest.approx(noise, rel=0.1)
    assert facets.white


def test_level_follows_the_place():
    """A quarter of the view twice as noisy as the rest."""
    noisy = (ROW > 0) & (COL > 0)
    level = look("parallel", np.where(noisy, 0.4, 0.1) * white(SHAPE), (1.0, 1.0))[1]
    assert np.median(level[48:, 56:]) == pytest.approx(0.4, rel=0.15)
    assert np.median(level[:16, :16]) == pytest.approx(0.1, rel=0.15)


@pytest.mark.parametrize("window", [3, 5, 9])
@pytest.mark.parametrize("kind", KINDS)
def test_smoothed_noise_is_not_white(kind, window):
    assert not look(kind, 0.3 * smoothed(SHAPE, window))[0].white


@pytest.mark.parametrize("step", [1.0, 2.5])
def test_rounded_depth_is_not_white(step):
    slant = 0.23 * ROW + 0.31 * COL
    for noise in (0.0, 0.1):
        assert not look("parallel", step * np.round((slant + noise * white(SHAPE)) / step), (1.0, 1.0))[0].white


def test_noise_smoothed_along_rows_only_is_not_white():
    wide = white((SHAPE[0], SHAPE[1] + 4))
    along = np.lib.stride_tricks.sliding_window_view(wide, 5, axis=1).mean(axis=2)
    assert not look("parallel", along, (1.0, 1.0))[0].white
    assert not look("parallel", np.resize(along, SHAPE).T.copy(), (1.0, 1.0))[0].white


def test_hardly_any_noise_counts_as_white():
    assert look("parallel", 0.05 * smoothed(SHAPE), (1.0, 1.0))[0].white


@pytest.mark.parametrize("pitch", [(2.5, 1.0), (1.0, 2.5)])
def test_lines_far_apart_are_compared_along_themselves(pitch):
    """Their white noise stays white, also where the surface bends from line to line."""
    across = ROW if pitch[0] > 1 else COL
    height = 0.5 * white(SHAPE) + 0.2 * np.cos(across * 2.0)
    assert look("spherical", height, pitch)[0].white
