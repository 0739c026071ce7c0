"""Rays: the points come back from them, and planes fitted along them are planes of the cloud."""

import numpy as np
import pytest
from range_images import KINDS, grid, holes, image_of, white

from edgel._range_image.rays import trace_rays

SHAPE = (23, 31)


def rough(share=0.1):
    """A slanted rough surface with holes."""
    row, col = grid(*SHAPE)
    return np.where(holes(SHAPE, share), np.nan, 0.3 * row - 0.5 * col + white(SHAPE))


def points(rays):
    """Where the rays end, (M, 3), row by row."""
    seen = np.isfinite(rays.near)
    ray, near = rays.ray[seen].astype(float), rays.near[seen].astype(float)[:, None]
    if rays.central:
        return rays.origin + ray / near
    return rays.origin + (ray * (1, 1, 0) - near * (0, 0, 1)) @ rays.axes


@pytest.mark.parametrize("kind", KINDS)
def test_points_come_back(kind):
    image, xyz = image_of(kind, rough())
    rays = trace_rays(image, xyz)
    assert rays.central == (kind != "parallel")
    assert np.abs(points(rays) - xyz).max() < 2e-5  # float32, at a distance of 100
    hole = image.index < 0
    assert np.array_equal(np.isnan(rays.near), hole)
    assert not rays.ray[hole].any()
    unit = np.linalg.norm(rays.ray[~hole], axis=1) if rays.central else rays.ray[~hole][:, 2]
    np.testing.assert_allclose(unit, 1, atol=1e-6)
    np.testing.assert_allclose(rays.axes @ rays.axes.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_far_from_the_origin_points_come_back(kind):
    image, xyz = image_of(kind, rough())
    far = np.array([512_000.0, 4_096_000.0, 1024.0])
    moved = image_of(kind, rough())[0]
    if image.viewpoint is not None:
        object.__setattr__(moved, "viewpoint", image.viewpoint + far)
    assert np.abs(points(trace_rays(moved, xyz + far)) - far - xyz).max() < 3e-5


@pytest.mark.parametrize("kind", KINDS)
def test_nearer_is_larger(kind):
    rays = [trace_rays(*image_of(kind, rough() + higher)) for higher in (0.0, 1.0)]
    shift = 0.0 if kind != "parallel" else 1.0  # heights count from the middle point, which is 1 higher
    seen = np.isfinite(rays[0].near)
    assert (rays[1].near[seen] + shift > rays[0].near[seen]).all()
    half = image_of(kind, np.where(grid(*SHAPE)[1] < 0, 5.0, 0.0))
    near = trace_rays(*half).near
    assert near[:, :15].min() > near[:, 16:].max()


@pytest.mark.parametrize("kind", KINDS)
def test_a_pixel_deeper_is_a_spacing(kind):
    """What `spacing` says is how much `near` falls when the surface recedes by the width of a pixel."""
    heights = np.zeros(SHAPE)
    receding = np.where(grid(*SHAPE)[1] > 0, -0.01, 0.0)
    rays, other = (trace_rays(*image_of(kind, height)) for height in (heights, receding))
    flat, back = rays.near.astype(float), other.near.astype(float)
    if not rays.central:  # heights are over the origin
        back -= (other.origin - rays.origin) @ rays.axes[2]
    middle = np.s_[10:13, 16:18]
    change = (flat - back)[middle] / 0.01
    np.testing.assert_allclose(change / rays.spacing(rays.near)[middle], 1, rtol=0.02)
    assert rays.side == pytest.approx(1.0 if kind == "parallel" else 0.01)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.7, -0.4), (-2.0, 1.0)])
def test_planes_face_the_viewer_and_lie_where_the_points_lie(kind, slope):
    row, col = grid(*SHAPE)
    # A plane of the cloud: its height is linear in the place on it.
    ahead = 1 if kind == "parallel" else None
    down, right = row, col
    height = slope[0] * down + slope[1] * col if ahead else None
    if height is None:
        # Along a ray (u, v, 1) the plane z = 100 - a y - b x is met at z = 100 / (1 + a v + b u).
        if kind == "pinhole":
            u, v = right / 100, down / 100
        else:
            u, v = np.tan(right / 100), np.tan(down / 100) / np.cos(right / 100)
        height = 100 - 100 / (1 + slope[0] * v + slope[1] * u)
    image, xyz = image_of(kind, height)
    rays = trace_rays(image, xyz)
    fitted = np.linalg.lstsq(rays.ray.reshape(-1, 3).astype(float), rays.near.ravel().astype(float), rcond=None)[0]
    normals, offset = rays.planes(np.tile(fitted.astype(np.float32), (2, 1)))
    assert normals.shape == (2, 3)
    assert offset.shape == (2,)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
    np.testing.assert_allclose(xyz @ normals[0], offset[0], atol=3e-4)
    if image.viewpoint is not None:
        assert ((image.viewpoint - xyz) @ normals[0] > 0).all()
    assert normals[0] @ image.direction < 0
    axes_cosine = -(normals[0] @ image.direction)
    assert axes_cosine == pytest.approx(1 / np.sqrt(1 + slope[0] ** 2 + slope[1] ** 2), abs=1e-4)


def test_nothing_seen():
    image, xyz = image_of("pinhole", np.full((4, 5), np.nan))
    rays = trace_rays(image, xyz)
    assert np.isnan(rays.near).all()
    assert not rays.ray.any()
