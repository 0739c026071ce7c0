"""Pictures of clouds: what is red is where the edges are, upright, without holes, whatever the cloud."""

import subprocess
import sys

import numpy as np
import pytest
from by_hand import edges_at, grid, tee
from PIL import Image

from edgel import Cloud, plot

SMALL = (240, 180)


def red(picture):
    """Where a picture shows the color of edge points, (H, W) bool; blended borders of discs count."""
    r, g, b = (picture[..., i].astype(int) for i in range(3))
    return (r > 150) & (r > g + 60) & (r > b + 60)


def white(picture):
    return (picture == 255).all(axis=2)


def draw(points, rows=None, **options):
    """Draw a cloud and edges in these rows of it, without a legend."""
    edges = None if rows is None else edges_at(points, rows)
    return plot.picture(points, edges, legend=False, **{"size": SMALL, **options})


def camera_frame(noise=0.0):
    """A depth camera's organized cloud: x right, y down, z forward; a near block fills the upper left quarter."""
    v, u = np.mgrid[0:60, 0:80]
    z = np.where((u < 40) & (v < 30), 1.0, 2.0) + noise
    return Cloud(np.dstack([(u - 39.5) / 80 * z, (v - 29.5) / 80 * z, z]), viewpoint=np.zeros(3))


def test_red_is_where_the_edge_points_are():
    xyz = grid(300, 200)
    picture = draw(xyz, np.flatnonzero(xyz[:, 0] >= 250), direction="top")
    assert picture.shape == (180, 240, 3)
    assert picture.dtype == np.uint8
    columns = np.flatnonzero(red(picture)[90])
    grey = np.flatnonzero(~white(picture)[90] & ~red(picture)[90])
    assert grey[-2] < columns.min()  # the last may be the blended border of the cloud
    assert abs(red(picture).sum() / (~white(picture)).sum() - 1 / 6) < 0.03


def test_from_the_top_x_points_right_and_y_up():
    xyz = grid()
    corner = (xyz[:, 0] < 5) & (xyz[:, 1] > 34)
    down, right = np.nonzero(red(draw(xyz, corner, direction="top")))
    assert right.max() < 60
    assert down.max() < 60


def test_a_camera_sees_its_own_frame_upright():
    cloud = camera_frame()
    near = np.flatnonzero(cloud.xyz[:, 2] < 1.5)
    down, right = np.nonzero(red(draw(cloud, near)))
    assert right.max() <= 122
    assert down.max() <= 92


def test_a_camera_frame_without_rows_is_upright_too():
    cloud = camera_frame()
    unorganized = Cloud(cloud.xyz, viewpoint=cloud.viewpoint)
    np.testing.assert_array_equal(draw(unorganized), draw(cloud))


def test_the_viewpoint_of_a_sweep_is_no_place_to_look_from():
    angle = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    sweep = Cloud(np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), viewpoint=np.zeros(3))
    np.testing.assert_array_equal(draw(sweep), draw(sweep, direction="oblique"))
    with pytest.raises(ValueError, match="all round its viewpoint"):
        draw(sweep, direction="sensor")


@pytest.mark.parametrize("direction", ["top", "oblique"])
def test_no_holes_when_dense(direction):
    xyz = grid(300, 200)
    picture = draw(xyz, direction=direction)
    covered = ~white(picture)
    for line in covered[covered.any(axis=1)]:
        inside = np.flatnonzero(line)
        assert line[inside[0] : inside[-1] + 1].all()


def test_points_are_seen_when_sparse():
    xyz = np.random.default_rng(0).random((100, 3))
    picture = draw(xyz, direction="top", size=(1200, 900))
    share = (~white(picture)).mean()
    assert (~white(picture)).sum() > 100 * 12  # more than single pixels
    assert share < 0.2  # and no blots


def test_far_outliers_do_not_shrink_the_rest():
    xyz = grid()
    far = np.vstack([xyz, [[1e6, 0, 0], [0, -1e6, 0]]])
    picture = draw(far, direction="top")
    assert (~white(picture)).mean() > 0.4


@pytest.mark.parametrize("count", [1, 2, 10])
def test_tiny_clouds(count):
    xyz = np.random.default_rng(1).random((count, 3))
    picture = draw(xyz, [0])
    assert red(picture).any()


def test_identical_and_collinear_points():
    assert not white(draw(np.zeros((5, 3)))).all()
    line = np.column_stack([np.arange(50.0), np.zeros(50), np.zeros(50)])
    assert not white(draw(line, direction="top")).all()


def test_points_that_are_not_finite_are_left_out():
    xyz = grid()
    rows = np.flatnonzero(xyz[:, 0] >= 50)
    holes = np.insert(xyz, [0, 700], [[np.nan, 0, 0], [0, np.inf, 0]], axis=0)
    with_holes = rows + 1 + (rows >= 700)
    np.testing.assert_array_equal(
        draw(holes, np.append(with_holes, 0)),
        draw(xyz, rows),
    )


def test_large_coordinates_look_the_same():
    xyz = grid() + np.column_stack([np.zeros((2400, 2)), np.random.default_rng(0).integers(0, 4, 2400)])
    utm = xyz + (500_000, 5_400_000, 300)
    near, far = (draw(p, direction="top").astype(int) for p in (xyz, utm))
    assert np.mean(np.abs(near - far) > 3) < 0.01


def test_the_order_of_the_points_does_not_matter():
    rng = np.random.default_rng(2)
    xyz = rng.random((3000, 3))
    order = rng.permutation(3000)
    np.testing.assert_array_equal(draw(xyz), draw(xyz[order]))


def test_slopes_are_shaded_by_their_side():
    x, y = np.meshgrid(np.linspace(-1, 1, 200), np.linspace(-1, 1, 150))
    roof = np.column_stack([x.ravel(), y.ravel(), -np.abs(x.ravel())])
    picture = draw(roof, direction="top")
    assert picture[90, 60, 0] > picture[90, 180, 0] + 30  # the light comes from the left


@pytest.mark.parametrize("background", ["light", "dark"])
def test_points_of_a_size_are_drawn_singly(background):
    points = grid(12, 9)
    small, large = (
        draw(points, direction="top", background=background, point_size=size).astype(int) for size in (4, 8)
    )
    behind = small[0, 0]
    drawn, wide = ((np.abs(picture - behind) > 50).all(axis=2) for picture in (small, large))
    assert 8 < drawn.sum() / len(points) < 20  # of discs four wide
    assert wide.sum() == pytest.approx(4 * drawn.sum(), rel=0.25)
    assert np.abs(small[drawn] - behind).mean() > 80  # greys that stand out


def test_crop_leaves_only_the_rim():
    strip = grid(60, 10)
    picture = draw(strip, direction="top", crop=True)
    assert picture.shape[1] <= 240
    assert picture.shape[0] < 70
    down, right = np.nonzero(~white(picture))
    assert down.min() < 10
    assert picture.shape[1] - right.max() < 10


def test_save_writes_png(tmp_path):
    picture = draw(grid())
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
        ({"point_size": -1}, "point_size"),
        ({"direction": "left"}, "direction"),
        ({"direction": (0, 0, 0)}, "direction"),
        ({"direction": "sensor"}, "viewpoint"),
    ],
)
def test_bad_options_say_what_is_wrong(options, message):
    with pytest.raises(ValueError, match=message):
        draw(grid(), **options)


def test_nothing_finite_to_draw():
    with pytest.raises(ValueError, match="finite"):
        draw(np.full((5, 3), np.nan))


def test_pictures_need_no_matplotlib():
    # Checked in a fresh interpreter, since other tests may have imported it here.
    code = "import sys, edgel.plot; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_full_size_scan_is_drawn_with_its_outline():
    xyz = tee(200_000)
    x, y, _ = xyz.T
    outline = (np.abs(x) > 104) | (y < -56) | (y > 104)
    picture = draw(xyz, outline, direction="top", size=(1200, 900), crop=True)
    assert picture.shape[0] / picture.shape[1] == pytest.approx(162.15 / 210, abs=0.02)
    assert not white(picture)[400:500, 400:700].any()
    assert red(picture)[:, :60].any(axis=1).mean() > 0.6
