"""Pictures of clouds: what is red is where the edges are, upright, without holes, whatever the cloud."""

import doctest
import importlib
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from edgel import Cloud, camera, plot, scene, synth

SMALL = (240, 180)


def red(picture):
    """Where a picture shows the color of edge points, (H, W) bool; blended borders of discs count."""
    r, g, b = (picture[..., i].astype(int) for i in range(3))
    return (r > 150) & (r > g + 60) & (r > b + 60)


def blue(picture):
    return picture[..., 2].astype(int) > picture[..., 0].astype(int) + 50


def white(picture):
    return (picture == 255).all(axis=2)


def grid(columns=60, rows=40):
    """Points (N, 3) of a level grid, x from 0 to columns - 1, y from 0 to rows - 1, row by row."""
    x, y = np.meshgrid(np.arange(float(columns)), np.arange(float(rows)))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def camera_frame(noise=0.0):
    """A depth camera's organized cloud: x right, y down, z forward; a near block fills the upper left quarter."""
    v, u = np.mgrid[0:60, 0:80]
    z = np.where((u < 40) & (v < 30), 1.0, 2.0) + noise
    return Cloud(np.dstack([(u - 39.5) / 80 * z, (v - 29.5) / 80 * z, z]), viewpoint=np.zeros(3))


def test_red_is_where_the_edge_points_are():
    xyz = grid(300, 200)
    picture = plot.render(xyz, rows_on_top=np.flatnonzero(xyz[:, 0] >= 250), direction="top", size=SMALL)
    assert picture.shape == (180, 240, 3)
    assert picture.dtype == np.uint8
    columns = np.flatnonzero(red(picture)[90])
    grey = np.flatnonzero(~white(picture)[90] & ~red(picture)[90])
    assert grey[-2] < columns.min()  # the last may be the blended border of the cloud
    assert abs(red(picture).sum() / (~white(picture)).sum() - 1 / 6) < 0.03


def test_from_the_top_x_points_right_and_y_up():
    xyz = grid()
    corner = (xyz[:, 0] < 5) & (xyz[:, 1] > 34)
    down, right = np.nonzero(red(plot.render(xyz, rows_on_top=corner, direction="top", size=SMALL)))
    assert right.max() < 60
    assert down.max() < 60


def test_a_camera_sees_its_own_frame_upright():
    cloud = camera_frame()
    near = np.flatnonzero(cloud.xyz[:, 2] < 1.5)
    down, right = np.nonzero(red(plot.render(cloud, rows_on_top=near, size=SMALL)))
    assert right.max() <= 122
    assert down.max() <= 92


def test_a_camera_frame_without_rows_is_upright_too():
    cloud = camera_frame()
    unorganized = Cloud(cloud.xyz, viewpoint=cloud.viewpoint)
    np.testing.assert_array_equal(plot.render(unorganized, size=SMALL), plot.render(cloud, size=SMALL))


def test_the_viewpoint_of_a_sweep_is_no_place_to_look_from():
    angle = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    sweep = Cloud(np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), viewpoint=np.zeros(3))
    np.testing.assert_array_equal(plot.render(sweep, size=SMALL), plot.render(sweep, direction="oblique", size=SMALL))
    with pytest.raises(ValueError, match="all round its viewpoint"):
        plot.render(sweep, direction="sensor")


@pytest.mark.parametrize("direction", ["top", "oblique"])
def test_no_holes_when_dense(direction):
    xyz = grid(300, 200)
    picture = plot.render(xyz, direction=direction, size=SMALL)
    covered = ~white(picture)
    for line in covered[covered.any(axis=1)]:
        inside = np.flatnonzero(line)
        assert line[inside[0] : inside[-1] + 1].all()


def test_points_are_seen_when_sparse():
    xyz = np.random.default_rng(0).random((100, 3))
    picture = plot.render(xyz, direction="top", size=(1200, 900))
    share = (~white(picture)).mean()
    assert (~white(picture)).sum() > 100 * 12  # more than single pixels
    assert share < 0.2  # and no blots


def test_far_outliers_do_not_shrink_the_rest():
    xyz = grid()
    far = np.vstack([xyz, [[1e6, 0, 0], [0, -1e6, 0]]])
    picture = plot.render(far, direction="top", size=SMALL)
    assert (~white(picture)).mean() > 0.4


def test_hidden_edge_points_are_not_drawn():
    front = grid()
    back = front - (0, 0, 30)
    xyz = np.vstack([front, back])
    hidden = np.arange(len(front), len(xyz))
    assert not red(plot.render(xyz, rows_on_top=hidden, direction="top", size=SMALL)).any()
    assert red(plot.render(xyz, rows_on_top=hidden, direction=(0, 0, 1), size=SMALL)).any()


def test_the_nearest_point_covers_those_behind():
    xyz = np.array([[0, 0, 0], [1, 1, 0], [0.5, 0.5, 1.0], [0.5, 0.5, 0.0]], float)
    laid = scene.Scene(xyz, direction="top", size=SMALL, crop=False, margin=0.1, point_radius=2)
    assert set(np.unique(laid.winner)) == {-1, 0, 1, 2}


@pytest.mark.parametrize("count", [1, 2, 10])
def test_tiny_clouds(count):
    xyz = np.random.default_rng(1).random((count, 3))
    picture = plot.render(xyz, rows_on_top=[0], size=SMALL)
    assert red(picture).any()


def test_identical_and_collinear_points():
    assert not white(plot.render(np.zeros((5, 3)), size=SMALL)).all()
    line = np.column_stack([np.arange(50.0), np.zeros(50), np.zeros(50)])
    assert not white(plot.render(line, direction="top", size=SMALL)).all()


def test_points_that_are_not_finite_are_left_out():
    xyz = grid()
    rows = np.flatnonzero(xyz[:, 0] >= 50)
    holes = np.insert(xyz, [0, 700], [[np.nan, 0, 0], [0, np.inf, 0]], axis=0)
    with_holes = rows + 1 + (rows >= 700)
    np.testing.assert_array_equal(
        plot.render(holes, rows_on_top=np.append(with_holes, 0), size=SMALL),
        plot.render(xyz, rows_on_top=rows, size=SMALL),
    )


def test_large_coordinates_look_the_same():
    xyz = grid() + np.column_stack([np.zeros((2400, 2)), np.random.default_rng(0).integers(0, 4, 2400)])
    utm = xyz + (500_000, 5_400_000, 300)
    near, far = (plot.render(p, direction="top", size=SMALL).astype(int) for p in (xyz, utm))
    assert np.mean(np.abs(near - far) > 3) < 0.01


def test_the_order_of_the_points_does_not_matter():
    rng = np.random.default_rng(2)
    xyz = rng.random((3000, 3))
    order = rng.permutation(3000)
    np.testing.assert_array_equal(plot.render(xyz, size=SMALL), plot.render(xyz[order], size=SMALL))


def test_slopes_are_shaded_by_their_side():
    x, y = np.meshgrid(np.linspace(-1, 1, 200), np.linspace(-1, 1, 150))
    roof = np.column_stack([x.ravel(), y.ravel(), -np.abs(x.ravel())])
    picture = plot.render(roof, direction="top", size=SMALL)
    assert picture[90, 60, 0] > picture[90, 180, 0] + 30  # the light comes from the left


def test_normals_shade_what_they_are_given_for():
    xyz = grid()
    left = np.where(xyz[:, :1] < 30, [[-0.6, 0.0, 0.8]], [[0.6, 0.0, 0.8]])
    picture = plot.render(xyz, normals=left, direction="top", size=SMALL)
    assert picture[90, 60, 0] > picture[90, 180, 0] + 30


def test_crop_leaves_only_the_rim():
    strip = grid(60, 10)
    picture = plot.render(strip, direction="top", size=SMALL, crop=True)
    assert picture.shape[1] <= 240
    assert picture.shape[0] < 70
    down, right = np.nonzero(~white(picture))
    assert down.min() < 10
    assert picture.shape[1] - right.max() < 10


def test_arrows_point_along_the_normals():
    xyz = grid()
    rows = np.flatnonzero(xyz[:, 0] == 59)
    normals = np.tile([1.0, 0.0, 0.0], (len(rows), 1))
    picture = plot.arrows(xyz, rows, normals, direction="top", size=(480, 360))
    assert red(picture).any()
    right_of_cloud = np.nonzero(red(picture))[1].max()
    assert np.nonzero(blue(picture))[1].max() > right_of_cloud + 8


def test_arrows_are_thinned_and_skip_missing_normals():
    xyz = grid()
    normals = np.tile([0.0, 0.0, 1.0], (len(xyz), 1))
    picture = plot.arrows(xyz, np.ones(len(xyz), bool), normals, direction="top", size=(480, 360))
    assert 0 < blue(picture).mean() < 0.2
    none = plot.arrows(xyz, np.arange(len(xyz)), normals * np.nan, direction="top", size=(480, 360))
    assert red(none).any()
    assert not blue(none).any()


def test_arrows_with_no_edge_points():
    picture = plot.arrows(grid(), np.empty(0, int), np.empty((0, 3)), size=SMALL)
    assert not red(picture).any()
    assert not blue(picture).any()


def test_save_writes_png(tmp_path):
    picture = plot.render(grid(), size=SMALL)
    plot.save(tmp_path / "cloud.png", picture)
    with Image.open(tmp_path / "cloud.png") as image:
        assert image.format == "PNG"
        np.testing.assert_array_equal(np.asarray(image), picture)
    with pytest.raises(OSError, match="folder does not exist"):
        plot.save(tmp_path / "missing" / "cloud.png", picture)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"size": (5, 5)}, "size"),
        ({"margin": 0.5}, "margin"),
        ({"point_radius": -1}, "point_radius"),
        ({"direction": "left"}, "direction"),
        ({"direction": (0, 0, 0)}, "direction"),
        ({"direction": "sensor"}, "viewpoint"),
        ({"rows_on_top": [5000]}, "rows"),
        ({"normals": np.zeros((3, 3))}, "normals"),
    ],
)
def test_bad_options_say_what_is_wrong(options, message):
    with pytest.raises(ValueError, match=message):
        plot.render(grid(), **options)


def test_nothing_finite_to_draw():
    with pytest.raises(ValueError, match="finite"):
        plot.render(np.full((5, 3), np.nan))


def test_arrows_need_one_normal_each():
    with pytest.raises(ValueError, match="normals"):
        plot.arrows(grid(), [1, 2], np.zeros((3, 3)))


def test_full_size_scan_is_drawn_with_its_outline():
    solid = synth.tee()
    scan = synth.scan(solid, num_points=200_000)
    flat = [replace(edge, points=edge.points * (1, 1, 0)) for edge in solid.edges]
    outline = synth.nearest_edge(scan.cloud.xyz * (1, 1, 0), flat).distance < 1.0
    picture = plot.render(scan.cloud, rows_on_top=outline, direction="top", crop=True)
    assert picture.shape[0] / picture.shape[1] == pytest.approx(162.15 / 210, abs=0.02)
    assert not white(picture)[400:500, 400:700].any()


@pytest.mark.parametrize("module", [camera, plot, scene])
def test_examples(module):
    results = doctest.testmod(importlib.import_module(module.__name__))
    assert results.failed == 0


def test_pictures_need_no_matplotlib():
    # Checked in a fresh interpreter, since other tests may have imported it here.
    import subprocess

    code = "import sys, edgel.plot; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
