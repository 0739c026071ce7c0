"""Rasters: organized clouds as they are, projections of any points, and the choice of a view."""

import naive
import numpy as np
import pytest

from edgel import Cloud
from edgel.cloud import check_points
from edgel._range_image.range_image import _nearest, image_pitch, organized, orthographic, pinhole, spherical
from edgel._range_image.view import choose_method, count_rings

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
    raster = organized(checked.xyz, checked.rows, (40, 50))
    assert raster.method == "organized"
    assert raster.viewpoint is not None
    assert raster.index[5, 7] == -1
    assert np.isnan(raster.depth[5, 7])
    shown = raster.index >= 0
    assert np.array_equal(raster.index[shown], np.arange(len(checked.xyz)))
    assert raster.depth[shown] == pytest.approx(np.linalg.norm(checked.xyz, axis=1))
    assert raster.pitch == pytest.approx((1 / 60, 1 / 60), rel=0.1)


def test_organized_sees_that_rays_are_parallel():
    xyz = grid() * (0.5, 2, 1)
    xyz[..., 2] = np.sin(xyz[..., 0]) * 3 + 0.2 * xyz[..., 1]
    raster = organized(xyz.reshape(-1, 3), np.arange(600), (20, 30))
    assert raster.viewpoint is None
    assert raster.direction == pytest.approx(DOWN, abs=1e-6)
    assert raster.pitch == pytest.approx((2, 0.5))
    assert raster.depth.ravel() == pytest.approx(-xyz[..., 2].ravel(), abs=1e-5)


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
def test_orthographic_depth_and_nearest(direction):
    forward = np.array(direction) / np.linalg.norm(direction)
    xyz = sphere()
    raster = orthographic(xyz, np.array(direction))
    shown = raster.index >= 0
    assert raster.depth[shown] == pytest.approx(xyz[raster.index[shown]] @ forward)
    assert np.median(raster.depth[shown]) < 0  # the near half
    assert (raster.behind >= 0).all()
    assert (raster.behind[raster.index[shown]] == 0).all()


@pytest.mark.parametrize("project", [pinhole, spherical])
def test_a_camera_grid_fills_its_pixels(project):
    xyz = camera().reshape(-1, 3)[:, [0, 2, 1]]  # level: elevation is about z
    raster = project(xyz, np.zeros(3))
    shown = raster.index >= 0
    assert shown.sum() >= 0.85 * len(xyz)
    assert raster.depth[shown] == pytest.approx(np.linalg.norm(xyz[raster.index[shown]], axis=1))


def test_scan_lines_get_pixels_of_their_own_height():
    azimuth, elevation = np.meshgrid(np.arange(-1, 1, 0.004), np.arange(-0.2, 0.2, 0.02))
    rays = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    xyz = 20 * np.stack(rays, axis=-1).reshape(-1, 3)
    raster = spherical(xyz, np.zeros(3))
    assert raster.pitch == pytest.approx((0.02, 0.004), rel=0.1)
    assert (raster.index >= 0).sum() > 0.9 * len(xyz)


def test_pitch_of_random_points_leaves_few_holes():
    picture = np.random.default_rng(0).random((5000, 2)) * 70
    across, along = image_pitch(picture)
    assert across == along == pytest.approx(1.3, rel=0.1)


def test_pinhole_refuses_points_behind():
    with pytest.raises(ValueError, match="viewpoint: some points"):
        pinhole(sphere(100), np.zeros(3))


def test_far_outliers_cost_no_memory():
    raster = orthographic(np.vstack([grid().reshape(-1, 3), [[1e7, 1e7, 0]]]), DOWN)
    assert raster.depth.size < 200_000


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


def hill():
    xyz = grid(60, 60).reshape(-1, 3)
    xyz[:, 2] = 3 * np.sin(xyz[:, 0] / 9)
    return xyz


@pytest.mark.parametrize(
    ("cloud", "method"),
    [
        (Cloud(camera()), "organized"),
        (Cloud(hill()), "surface"),
        (Cloud(camera().reshape(-1, 3), viewpoint=np.zeros(3)), "pinhole"),
        (Cloud(sphere(), viewpoint=np.array([0.2, 0.1, 0.0])), "spherical"),
        (Cloud(sphere(), viewpoint=np.array([0.0, 0.0, 50.0])), "surface"),
        (Cloud(sphere()), "surface"),
    ],
)
def test_choice_of_a_view(cloud, method):
    chosen = choose_method(cloud, cloud.xyz)
    assert chosen.method == method
    assert "\n" not in chosen.reason


def sweep(levels=16, empty=0):
    """What a spinning sensor at the origin sees of a room, `empty` shots without an echo among it."""
    azimuth, elevation = np.meshgrid(np.arange(0, 2 * np.pi, 0.005), np.radians(np.linspace(-15, 15, levels)))
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1).reshape(-1, 3)
    room = rays * (4 / np.abs(rays[:, :2]).max(axis=1, keepdims=True))
    return np.concatenate([room, np.zeros((empty, 3))])


@pytest.mark.parametrize("empty", [0, 500])
def test_a_spinning_sensor_is_known_by_its_rings(empty):
    xyz = sweep(empty=empty)
    viewing = choose_method(Cloud(xyz), xyz)
    assert viewing.method == "spherical"
    assert "16 rings" in viewing.reason
    assert viewing.raster is not None
    shown = viewing.raster.index[viewing.raster.index >= 0]
    assert np.isin(np.arange(len(xyz) - empty), shown).mean() > 0.99
    assert not np.isin(np.arange(len(xyz) - empty, len(xyz)), shown).any()


def test_no_rings_where_there_are_none():
    rng = np.random.default_rng(1)
    assert count_rings(rng.standard_normal((20000, 3))) == 0
    assert count_rings(grid(200, 200).reshape(-1, 3) + (1.0, 1.0, 5.0)) == 0
    assert count_rings(sweep()[:500]) == 0  # too few to tell
    flat = np.column_stack([rng.uniform(-50, 50, (20000, 2)), 0.1 * rng.standard_normal(20000)])
    assert count_rings(np.concatenate([flat, rng.uniform(-60, 60, (200, 3))])) == 0  # outliers all round are no rings
