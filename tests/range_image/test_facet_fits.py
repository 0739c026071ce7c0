"""Facets: the planes of windows from summed-area tables are those of least squares on the windows' pixels."""

import naive
import numpy as np
import pytest
from range_images import KINDS, grid, holes, image_of, smoothed, white

from edgel._range_image import facet_fits
from edgel._range_image.facet_fits import CELL, FINEST, FULL, HALVES, fit_facets
from edgel._range_image.rays import trace_rays

SEAM = CELL * facet_fits._BAND + 13, 15  # odd, and higher than a band of rows of cells
WIDE = 21, 110


def rough(shape, share=0.1, noise=0.2):
    """A slanted surface with a step, a fold, noise and holes, and corners that are missing."""
    row, col = grid(*shape)
    height = 0.4 * row - 0.3 * col + 8.0 * (row > 5) - np.abs(row + 0.5 * col) + noise * white(shape)
    height[holes(shape, share)] = np.nan
    height[:7, :6] = np.nan
    return height


def check(rays):
    facets = fit_facets(rays)
    wanted = naive.window_planes(rays.ray.astype(float), rays.near.astype(float), facets.cell, HALVES, FULL)
    found = np.moveaxis(facets.plane, 1, 3)
    assert found.shape == wanted.shape
    known = np.isfinite(wanted[..., 3])
    assert np.array_equal(np.isfinite(found[..., 3]), known)
    assert known.any()
    size = np.linalg.norm(wanted[known][:, :3], axis=1)
    assert (np.abs(found[known][:, :3] - wanted[known][:, :3]).max(axis=1) < 1e-5 * size).all()
    np.testing.assert_allclose(found[known][:, 3], wanted[known][:, 3], rtol=1e-4)
    return facets


@pytest.mark.parametrize("share", [0.0, 0.2])
@pytest.mark.parametrize("shape", [SEAM, WIDE], ids=["seam", "wide"])
@pytest.mark.parametrize("kind", KINDS)
def test_planes_of_windows_are_those_of_least_squares(kind, shape, share):
    """At the borders of the image, in its corners, across the seams of bands and beside holes."""
    check(trace_rays(*image_of(kind, rough(shape, share))))


@pytest.mark.parametrize("pitch", [(2.0, 1.0), (1.0, 2.6), (20.0, 1.0)])
@pytest.mark.parametrize("kind", ["parallel", "spherical"])
def test_cells_of_stretched_pixels_are_about_square(kind, pitch):
    facets = check(trace_rays(*image_of(kind, rough((25, 36)), pitch)))
    stretch = pitch[0] / pitch[1]
    assert facets.stretch == pytest.approx(stretch)
    assert min(facets.cell) == 1
    assert facets.cell[1] / facets.cell[0] == pytest.approx(min(stretch, 8), rel=0.25)


@pytest.mark.parametrize("pitch", [(1.0, 1.0), (1.4, 1.0), (1.0, 1.4)])
def test_cells_of_nearly_square_pixels_are_square(pitch):
    assert fit_facets(trace_rays(*image_of("pinhole", rough((25, 36)), pitch))).cell == (CELL, CELL)


@pytest.mark.parametrize("kind", KINDS)
def test_rays_of_cells_are_means(kind):
    rays = trace_rays(*image_of(kind, rough((17, 21), 0.4)))
    facets = fit_facets(rays)
    for i, j in np.ndindex(*facets.noise.shape):
        near = rays.near[2 * i : 2 * i + 2, 2 * j : 2 * j + 2].ravel().astype(float)
        seen = np.isfinite(near)
        if not seen.any():
            assert not facets.ray[:, i, j].any()
            continue
        ray = rays.ray[2 * i : 2 * i + 2, 2 * j : 2 * j + 2].reshape(-1, 3)[seen].astype(float)
        np.testing.assert_allclose(facets.ray[:, i, j], [*ray.mean(axis=0), near[seen].mean()], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_far_from_the_middle_planes_keep_their_digits(kind):
    """Sums run over the whole row: those of the last window are differences of large numbers."""
    height = 0.3 * grid(9, 3000)[0] + 0.01 * white((9, 3000))
    rays = trace_rays(*image_of(kind, height, (0.05, 0.05)))
    facets = fit_facets(rays)
    last = np.s_[:, -40:]
    wanted = naive.window_planes(rays.ray[last].astype(float), rays.near[last].astype(float), (2, 2), HALVES, FULL)
    found, wanted = np.moveaxis(facets.plane, 1, 3)[:, :, -10:-6], wanted[:, :, -10:-6]
    known = np.isfinite(wanted[..., 3])
    assert known.any()
    size = np.linalg.norm(wanted[known][:, :3], axis=1)
    assert (np.abs(found[known] - wanted[known])[:, :3].max(axis=1) < 1e-5 * size).all()


@pytest.mark.parametrize("kind", KINDS)
def test_without_noise_there_is_the_least(kind):
    rays = trace_rays(*image_of(kind, np.zeros((40, 40))))
    facets = fit_facets(rays)
    np.testing.assert_allclose(facets.noise, FINEST * rays.spacing(facets.ray[3]), rtol=0.5)
    assert facets.white


def test_noise_of_low_frequency_makes_larger_windows_leave_more():
    shape = (120, 160)
    alike = fit_facets(trace_rays(*image_of("parallel", smoothed(shape, 9))))
    independent = fit_facets(trace_rays(*image_of("parallel", white(shape))))
    assert (np.diff(alike.ratio) > 0.1).all()
    np.testing.assert_allclose(independent.ratio, 1, atol=0.15)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (3, 3)])
def test_small_images(shape):
    for height in (np.zeros(shape), np.full(shape, np.nan)):
        facets = fit_facets(trace_rays(*image_of("pinhole", height)))
        assert facets.noise.shape == tuple(-(-length // 2) for length in shape)
        assert np.isinf(facets.plane[:, 3]).all()
        assert np.isfinite(facets.noise).all()


@pytest.mark.parametrize("kind", KINDS)
def test_threads_do_not_matter(kind, monkeypatch):
    rays = trace_rays(*image_of(kind, rough(SEAM)))
    found = []
    for threads in ("1", "2"):
        monkeypatch.setenv("EDGEL_NUM_THREADS", threads)
        found.append(fit_facets(rays))
    assert found[0].plane.tobytes() == found[1].plane.tobytes()
    assert found[0].noise.tobytes() == found[1].noise.tobytes()
