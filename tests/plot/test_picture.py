"""The picture of a cloud and its edges: colors that mean what the legend says, a bar that measures, any order."""

from dataclasses import replace

import numpy as np
import pytest
from by_hand import edges_at, grid

from edgel import Cloud, EdgeKind, plot
from edgel.plot import palette
from edgel.plot.legend import round_length

SIZE = (480, 360)


def where(picture, color):
    """Pixels (H, W) of exactly this color."""
    return (picture == np.array(color, np.uint8)).all(axis=2)


def legend(picture):
    """What stands below the cloud: the lines under the last row that is empty from side to side, from below."""
    inked = (picture != picture[0, 0]).any(axis=(1, 2))
    line = np.flatnonzero(inked)[-1]
    while inked[line] or inked[line - 1] or inked[line - 2]:
        line -= 1
    return picture[line:]


def bar_length(picture):
    """Pixels of the longest run of ink in the legend."""
    ink = (np.abs(legend(picture).astype(int) - picture[0, 0]).min(axis=2) > 200).astype(int)
    return max(np.diff(np.flatnonzero(np.diff(np.r_[0, line, 0])))[::2].max(initial=0) for line in ink)


@pytest.mark.parametrize("background", palette.THEMES)
def test_the_legend_names_the_kinds_that_are_there_and_no_other(background):
    cloud = Cloud(grid())
    kinds = np.repeat([EdgeKind.BOUNDARY, EdgeKind.CREASE, EdgeKind.COLOR | EdgeKind.CREASE], 40)
    edges = edges_at(cloud, np.arange(120), kinds)
    below = legend(plot.picture(cloud, edges, direction="top", size=(1000, 750), background=background))
    named = [kind for kind, color in palette.KIND_COLORS.items() if where(below, color).any()]
    assert named == [EdgeKind.BOUNDARY, EdgeKind.CREASE, EdgeKind.COLOR]
    assert below[-1, -1].tolist() == list(palette.THEMES[background].background)


def test_edge_points_wear_the_colors_of_their_kinds():
    cloud = Cloud(grid())
    for kind, color in palette.KIND_COLORS.items():
        edges = edges_at(cloud, cloud.xyz[:, 0] >= 50, kind)
        picture = plot.picture(cloud, edges, direction="top", size=SIZE, legend=False)
        at = np.nonzero(where(picture, color))[1]
        assert at.min() > 480 * 0.75
        assert len(at) > 300


def test_the_stronger_the_darker():
    cloud = Cloud(grid())
    rows = np.flatnonzero((cloud.xyz[:, 0] < 10) | (cloud.xyz[:, 0] >= 50))
    edges = edges_at(cloud, rows, strength=np.where(cloud.xyz[rows, 0] < 10, 0.5, 0.9))
    picture = plot.picture(cloud, edges, direction="top", size=SIZE, edge_color="strength", legend=False)
    weak, strong = palette.ramp_colors([1.0, 0.0])
    assert np.nonzero(where(picture, weak))[1].max() < 120
    assert np.nonzero(where(picture, strong))[1].min() > 360


@pytest.mark.parametrize("scale", [1.0, 0.0037, 81000.0])
@pytest.mark.parametrize("size", [(480, 360), (1000, 400)])
def test_the_scale_bar_is_as_long_as_it_says(scale, size):
    cloud = Cloud(grid() * scale)
    marks = edges_at(cloud, np.flatnonzero(cloud.xyz[:, 1] == 0)[[10, 50]])
    picture = plot.picture(cloud, marks, direction="top", size=size)
    above = picture[: len(picture) - len(legend(picture))]
    columns = np.nonzero(np.abs(above.astype(int) - palette.ANY_KIND).sum(axis=2) < 30)[1]
    middle = (columns.min() + columns.max()) / 2
    left, right = (columns[columns < middle].mean(), columns[columns > middle].mean())
    pixels_a_unit = (right - left) / (40 * scale)
    longest = 0.16 * size[0] / pixels_a_unit
    assert bar_length(picture) == pytest.approx(round_length(longest) * pixels_a_unit, abs=1.6)


def test_in_perspective_the_bar_holds_at_the_middle_distance():
    v, u = np.mgrid[0:90, 0:120]
    plane = np.dstack([(u - 59.5) / 120 * 5, (v - 44.5) / 120 * 5, np.full(u.shape, 5.0)])
    cloud = Cloud(plane, viewpoint=np.zeros(3))
    marks = edges_at(cloud, [45 * 120 + 20, 45 * 120 + 100])
    picture = plot.picture(cloud, marks, size=SIZE)
    columns = np.nonzero(np.abs(picture[:250].astype(int) - palette.ANY_KIND).sum(axis=2) < 30)[1]
    pixels_a_unit = (columns[columns > 240].mean() - columns[columns < 240].mean()) / (80 / 120 * 5)
    assert bar_length(picture) == pytest.approx(round_length(0.16 * 480 / pixels_a_unit) * pixels_a_unit, abs=1.6)


@pytest.mark.parametrize(("longest", "length"), [(1.0, 1.0), (0.99, 0.5), (4.99, 2.0), (5e-7, 5e-7), (7e8, 5e8)])
def test_round_lengths(longest, length):
    assert round_length(longest) == pytest.approx(length)


@pytest.mark.parametrize("direction", ["top", "oblique"])
def test_the_order_of_the_points_does_not_matter(direction):
    rng = np.random.default_rng(0)
    # A level grid: from the top all points are equally near, and every disc overlaps its neighbours.
    cloud = Cloud(grid(), dict(zip(("red", "green", "blue"), rng.integers(0, 256, (3, 2400), np.uint8), strict=True)))
    rows = np.sort(rng.choice(2400, 300, replace=False))
    edges = edges_at(cloud, rows, rng.choice(list(EdgeKind), 300))
    order = rng.permutation(2400)
    place = np.argsort(order)[rows]
    shuffled = replace(edges, index=np.sort(place), kind=edges.kind[np.argsort(place)])
    options = {"direction": direction, "size": SIZE, "color_by": "rgb"}
    np.testing.assert_array_equal(
        plot.picture(cloud, edges, **options), plot.picture(cloud.take(order), shuffled, **options)
    )


def test_edges_behind_a_surface_are_not_drawn():
    front = grid()
    cloud = Cloud(np.vstack([front, front - (0, 0, 30)]))
    edges = edges_at(cloud, np.arange(2400, 4800))
    color = palette.KIND_COLORS[EdgeKind.CREASE]
    options = {"size": SIZE, "legend": False}
    assert not where(plot.picture(cloud, edges, direction="top", **options), color).any()
    assert where(plot.picture(cloud, edges, direction=(0, 0, 1), **options), color).any()


def test_a_detail_shows_what_lies_around_a_place():
    cloud = Cloud(grid(step=0.25))
    edges = edges_at(cloud, cloud.xyz[:, 0] == 30)
    picture = plot.picture(cloud, edges, direction="top", size=SIZE, legend=False, detail=((30, 20, 0), 20.0))
    columns = np.nonzero(where(picture, palette.ANY_KIND))[1]
    assert columns.mean() == pytest.approx(240, abs=2)
    assert not where(picture, (255, 255, 255)).all(axis=0).any()  # 20 wide of 60: cloud from side to side
    with pytest.raises(ValueError, match="no point of the cloud"):
        plot.picture(cloud, direction="top", detail=((500, 0, 0), 1.0))
    with pytest.raises(ValueError, match="width above 0"):
        plot.picture(cloud, direction="top", detail=((30, 20, 0), 0.0))


def colored():
    xyz = grid(step=0.25)
    xyz[:, 2] = xyz[:, 0] / 10
    ramp = (xyz[:, 0] * 4).astype(np.uint8)
    return Cloud(xyz, {"red": ramp, "green": 255 - ramp, "blue": np.zeros_like(ramp), "intensity": ramp})


@pytest.mark.parametrize(
    ("color_by", "left", "right"),
    [
        ("rgb", "green", "red"),
        ("intensity", "dark", "light"),
        ("height", "blue", "green"),
    ],
)
def test_the_surface_shows_what_it_is_colored_by(color_by, left, right):
    picture = plot.picture(colored(), direction="top", size=SIZE, color_by=color_by, legend=False).astype(int)
    seen = {"left": picture[180, 30], "right": picture[180, 450]}
    for side, name in (("left", left), ("right", right)):
        if name in ("dark", "light"):
            assert (seen[side].max() < 60) == (name == "dark")
            assert np.ptp(seen[side]) == 0
        else:
            assert ("red", "green", "blue")[seen[side].argmax()] == name


@pytest.mark.parametrize("color_by", ["rgb", "intensity", "height"])
def test_points_that_are_not_finite_change_no_color(color_by):
    cloud = colored()
    rows = np.sort(np.r_[0, 5000, np.arange(len(cloud))])
    holes = cloud.take(rows)
    holes.xyz[[0, 5001]] = np.nan
    look = {"direction": "top", "size": SIZE, "color_by": color_by}
    np.testing.assert_array_equal(plot.picture(holes, **look), plot.picture(cloud, **look))


def test_one_height_is_one_color():
    picture = plot.picture(grid(step=0.25), direction="top", size=SIZE, color_by="height", legend=False)
    assert len(np.unique(picture[100:260, 100:380].reshape(-1, 3), axis=0)) == 1


def test_normals_are_colors():
    x, y = np.meshgrid(np.linspace(-1, 1, 200), np.linspace(-1, 1, 150))
    roof = np.column_stack([x.ravel(), y.ravel(), -np.abs(x.ravel())])
    picture = plot.picture(roof, direction="top", size=SIZE, color_by="normals", legend=False).astype(int)
    assert picture[180, 360, 0] > picture[180, 120, 0] + 40  # red: along x
    assert abs(picture[180, 360, 1] - picture[180, 120, 1]) < 40


def test_a_cloud_without_edges_has_a_scale_bar_and_nothing_to_name():
    cloud = Cloud(grid())
    alone = plot.picture(cloud, direction="top", size=SIZE)
    np.testing.assert_array_equal(alone, plot.picture(cloud, edges_at(cloud, []), direction="top", size=SIZE))
    assert plot.picture(cloud, edges_at(cloud, []), edge_color="strength", size=SIZE).shape == (360, 480, 3)
    assert bar_length(alone) > 20


def test_the_picture_has_the_size_asked_for_or_less_when_cropped():
    flat = grid(60, 8)
    assert plot.picture(flat, direction="top", size=SIZE).shape == (360, 480, 3)
    cropped = plot.picture(flat, direction="top", size=SIZE, crop=True)
    assert cropped.shape[1] == 480
    assert cropped.shape[0] < 180


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"color_by": "rgb"}, "color_by: the cloud carries no red"),
        ({"color_by": "intensity"}, "color_by: the cloud carries no intensity"),
        ({"color_by": "mood"}, "color_by: expected one of grey"),
        ({"edge_color": "red"}, "edge_color: expected one of kind"),
        ({"background": "sky"}, "background: expected one of light"),
        ({"size": (100, 100)}, "no room for the legend"),
        ({"size": (5, 900)}, "size"),
        ({"direction": "left"}, "direction"),
    ],
)
def test_bad_options_say_what_is_wrong(options, message):
    with pytest.raises(ValueError, match=message):
        plot.picture(grid(), **options)


def test_edges_of_another_cloud():
    with pytest.raises(ValueError, match=r"found in a cloud of 2,400 points, this one has 100"):
        plot.picture(grid(10, 10), edges_at(Cloud(grid()), [1]))
