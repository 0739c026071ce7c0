"""Range images: organized clouds as they are, and projections of any points."""

import naive
import numpy as np
import pytest

import edgel
from edgel import Cloud
from edgel._range_image.range_image import _nearest, image_pitch, organized, orthographic, pinhole, spherical
from edgel.cloud import check_points

DOWN = np.array([0.0, 0.0, -1.0])


def grid(rows=20, cols=30):
    x, y = np.meshgrid(np.arange(float(cols)), np.arange(float(rows)))
    return np.stack([x, y, 0 * x], axis=-1)


def camera(rows=40, cols=50, focal=60.0):
    """A slanted plane seen by a camera at the origin."""
    u, v = np.meshgrid(np.arange(cols) - cols / 2 + 0.3, np.arange(rows) - rows / 2 + 0.2)
    rays = np.stack([u / focal, v / focal, np.ones_like(u)], axis=-1)
    return rays * (100 / (1 + 0.4 * rays[..., :1]))


def sphere(count=4000):
    points = np.random.default_rng(3).standard_normal((count, 3))
    return 10 * points / np.linalg.norm(points, axis=1, keepdims=True)


def test_organized_keeps_grid_and_holes():
    xyz = camera()
    xyz[5, 7] = np.nan
    cloud = Cloud(xyz)
    checked = check_points(cloud)
    image = organized(checked.xyz, checked.rows, (40, 50))
    assert image.method == "organized"
    assert image.viewpoint is not None
    assert image.index[5, 7] == -1
    shown = image.index >= 0
    assert np.array_equal(image.index[shown], np.arange(len(checked.xyz)))
    assert image.pitch == pytest.approx((1 / 60, 1 / 60), rel=0.1)


def test_organized_sees_that_rays_are_parallel():
    xyz = grid() * (0.5, 2, 1)
    xyz[..., 2] = np.sin(xyz[..., 0]) * 3 + 0.2 * xyz[..., 1]
    image = organized(xyz.reshape(-1, 3), np.arange(600), (20, 30))
    assert image.viewpoint is None
    assert image.direction == pytest.approx(DOWN, abs=1e-6)
    assert image.pitch == pytest.approx((2, 0.5))


def test_nearest_equals_naive():
    rng = np.random.default_rng(0)
    xyz = rng.integers(0, 3, (500, 3)).astype(float)
    pixels, depth = rng.integers(0, 60, 500), xyz @ [1.0, 1.0, 0.0]
    index = np.full(60, -1)
    _nearest(pixels, depth, xyz, index)
    wanted = naive.nearest_points(pixels, depth, xyz)
    for pixel, row in wanted.items():
        assert xyz[index[pixel]].tolist() == xyz[row].tolist()
    assert (index >= 0).sum() == len(wanted)


@pytest.mark.parametrize("direction", [(0, 0, -1), (1, 0, 0), (0.3, -0.5, 0.8)])
def test_orthographic_shows_the_nearest(direction):
    forward = np.array(direction) / np.linalg.norm(direction)
    xyz = sphere()
    image = orthographic(xyz, np.array(direction))
    shown = image.index >= 0
    assert np.median(xyz[image.index[shown]] @ forward) < 0  # the near half
    assert (image.behind >= 0).all()
    assert (image.behind[image.index[shown]] == 0).all()


@pytest.mark.parametrize("project", [pinhole, spherical])
def test_a_camera_grid_fills_its_pixels(project):
    xyz = camera().reshape(-1, 3)[:, [0, 2, 1]]  # level: elevation is about z
    image = project(xyz, np.zeros(3))
    shown = image.index >= 0
    assert shown.sum() >= 0.85 * len(xyz)


def test_scan_lines_get_pixels_of_their_own_height():
    azimuth, elevation = np.meshgrid(np.arange(-1, 1, 0.004), np.arange(-0.2, 0.2, 0.02))
    rays = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    xyz = 20 * np.stack(rays, axis=-1).reshape(-1, 3)
    image = spherical(xyz, np.zeros(3))
    assert image.pitch == pytest.approx((0.02, 0.004), rel=0.1)
    assert (image.index >= 0).sum() > 0.9 * len(xyz)


def test_pitch_of_random_points_leaves_few_holes():
    picture = np.random.default_rng(0).random((5000, 2)) * 70
    across, along = image_pitch(picture)
    assert across == along == pytest.approx(1.3, rel=0.1)


def test_pinhole_refuses_points_behind():
    with pytest.raises(ValueError, match="viewpoint: some points"):
        pinhole(sphere(100), np.zeros(3))


def test_far_outliers_cost_no_memory():
    image = orthographic(np.vstack([grid().reshape(-1, 3), [[1e7, 1e7, 0]]]), DOWN)
    assert image.index.size < 200_000


@pytest.mark.parametrize("make", [lambda xyz: orthographic(xyz, DOWN), lambda xyz: spherical(xyz, np.full(3, 0.1))])
def test_order_and_threads_do_not_matter(make, monkeypatch):
    xyz = np.vstack([sphere(3000), sphere(500)])
    order = np.random.default_rng(1).permutation(len(xyz))
    first = make(xyz)
    monkeypatch.setenv("EDGEL_NUM_THREADS", "1")
    other = make(xyz[order])
    assert first.shape == other.shape
    assert np.array_equal(first.index >= 0, other.index >= 0)
    shown = first.index >= 0
    assert np.array_equal(xyz[first.index[shown]], xyz[order][other.index[shown]])


def test_far_from_the_origin_the_image_is_the_same():
    xyz = np.round(sphere(), 3)
    near, far = orthographic(xyz, DOWN), orthographic(xyz + (512_000, 4_096_000, 0), DOWN)
    assert far.pitch == pytest.approx(near.pitch, rel=0.01)
    assert far.shape == pytest.approx(near.shape, abs=1)


def test_a_grid_whose_points_lie_mostly_in_one_place_has_a_pitch():
    xyz = camera()
    xyz[:, :30] = xyz[3, 3]
    cloud = Cloud(xyz)
    checked = check_points(cloud)
    assert min(organized(checked.xyz, checked.rows, (40, 50)).pitch) > 0
    assert edgel.detect(cloud).num_points == 2000


def test_points_in_the_viewpoint_itself_do_not_show():
    xyz = camera()
    xyz[5:9, 7:12] = 0.0
    checked = check_points(Cloud(xyz))
    image = organized(checked.xyz, checked.rows, (40, 50))
    assert (image.index[5:9, 7:12] == -1).all()
    assert edgel.detect(xyz).num_points == 2000
