"""Color edges: kernels against their naive oracles, and what must and must not be found on known surfaces."""

import math

import naive
import numpy as np
import pytest
from alone import alone

import edgel
from edgel._color import color_channels, color_edges
from edgel._color.chains import non_maximum_suppression
from edgel._color.gradient import color_gradient
from edgel._color.step import _peak
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.normals import fit_planes
from edgel._neighbors.queries import every_place, every_point
from edgel.cloud import Cloud, check_points


def find(points, channels, **options):
    index = build_index(points)
    return color_edges(index, points, fit_planes(index, every_point(index), 16).normals, channels, **options)


def sheet(kind="jittered", size=60, seed=0):
    """A flat sheet of points one unit apart."""
    rng = np.random.default_rng(seed)
    x, y = (g.ravel() for g in np.meshgrid(np.arange(float(size)), np.arange(float(size))))
    points = np.c_[x, y, 0 * x]
    return points if kind == "grid" else points + rng.uniform(-0.35, 0.35, points.shape) * [1, 1, 0.1]


def ball(radius=25.0):
    """Points about one unit apart on a sphere (Fibonacci's lattice)."""
    count = round(4 * math.pi * radius**2)
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.arange(count) * math.pi * (3 - math.sqrt(5))
    across = np.sqrt(1 - z * z)
    return radius * np.c_[across * np.cos(turn), across * np.sin(turn), z]


def turned(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.linalg.det(q)


@pytest.mark.parametrize("bits", [np.uint8, np.uint16])
def test_rgb_of_any_width_gives_the_same_channels(bits):
    rgb = np.random.default_rng(0).integers(0, 256, (100, 3))
    rgb[0] = 255
    expected = color_channels(Cloud(np.zeros((100, 3)), dict(zip(["red", "green", "blue"], rgb.T, strict=True))))
    assert expected is not None
    assert expected.min() >= 0
    assert expected.max() <= 1
    factor = 257 if bits is np.uint16 else 1
    wide = dict(zip(["Red", "Green", "Blue"], (rgb * factor).astype(bits).T, strict=True))
    unit = dict(zip(["red", "green", "blue"], rgb.T / 255, strict=True))
    for attributes in (wide, unit):
        channels = color_channels(Cloud(np.zeros((100, 3)), attributes))
        assert channels is not None
        np.testing.assert_allclose(channels, expected, atol=1e-12)


def test_intensity_is_scaled_by_percentiles_of_what_was_seen():
    values = np.r_[np.linspace(0, 100, 1000), 1e6, np.nan, 5e9]
    xyz = np.zeros((1003, 3))
    xyz[-1] = np.nan
    channels = color_channels(Cloud(xyz, {"intensity": values}))
    assert channels is not None
    assert channels.shape == (1003, 1)
    assert channels[500, 0] == pytest.approx(0.5, abs=0.02)
    assert channels[1000, 0] == 1
    assert np.isnan(channels[1001, 0])


def test_clouds_without_colors_have_no_channels():
    xyz = np.zeros((5, 3))
    assert color_channels(Cloud(xyz)) is None
    assert color_channels(Cloud(xyz, {"intensity": np.zeros(5)})) is None
    assert color_channels(Cloud(np.empty((0, 3)), {"intensity": np.empty(0)})) is None


@pytest.mark.parametrize("count", [1, 3])
def test_gradient_is_that_of_the_oracle(count):
    points = ball(8.0) + np.random.default_rng(0).normal(0, 0.1, (804, 3))
    colors = np.random.default_rng(1).random((len(points), count))
    index, k = build_index(points), 20
    normals = fit_planes(index, every_point(index), k).normals
    gradients = np.zeros((len(points), 4))
    visit_neighbors(color_gradient, every_place(index), index, k, normals[index.order], colors[index.order], gradients)
    for place in range(0, len(points), 13):
        row = index.order[place]
        near = naive.nearest(points.tolist(), points[row].tolist(), k)
        length, direction = naive.color_gradient(points[near] - points[row], normals[row], colors[near])
        assert gradients[place, 0] == pytest.approx(length, rel=1e-6)
        np.testing.assert_allclose(gradients[place, 1:], direction, atol=1e-5)


def test_peak_is_that_of_the_oracle():
    rng = np.random.default_rng(0)
    peaks = 0
    for _ in range(200):
        points = np.r_[np.zeros((1, 3)), rng.uniform(-2, 2, (23, 3)) * [1, 1, 0]]
        points = points[np.argsort((points**2).sum(axis=1))]
        direction = np.array([0.6, 0.8, 0.0])
        squared = (points**2).sum(axis=1)
        across = points @ direction / math.sqrt(squared[-1])
        values = np.exp(-2 * (across - rng.uniform(-0.5, 0.5)) ** 2) + rng.normal(0, 0.05, 24)
        gradients = np.c_[values, np.tile(direction, (24, 1))]
        expected = naive.color_peak(points, values, direction)
        assert alone(_peak)(np.arange(24), squared, across, gradients, direction) == pytest.approx(expected, rel=1e-6)
        peaks += math.isfinite(expected)
    assert peaks > 50


def test_thinning_is_that_of_the_oracle():
    rng = np.random.default_rng(0)
    # Few abreast of each: the kernel looks at no more than twelve neighbours.
    points = np.c_[np.arange(300) * 0.6, rng.uniform(-0.75, 0.75, 300), rng.normal(0, 0.05, 300)]
    across = np.tile([0.0, 1.0, 0.0], (300, 1))
    kept = non_maximum_suppression(points, across, np.ones(300), -points[:, 1])
    assert sorted(np.flatnonzero(kept)) == sorted(naive.thin_abreast(points, across, np.ones(300), -points[:, 1]))
    assert 100 < kept.sum() < 300


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("kind", ["grid", "jittered"])
@pytest.mark.parametrize("angle", [0.0, 0.3, math.pi / 4])
def test_a_step_on_a_plane_is_found_one_point_thick(kind, angle, noise):
    points = sheet(kind)
    off = (points[:, 0] - 29.5) * math.cos(angle) + (points[:, 1] - 29.5) * math.sin(angle)
    along = (points[:, 1] - 29.5) * math.cos(angle) - (points[:, 0] - 29.5) * math.sin(angle)
    colors = 0.3 + 0.4 * (off > 0) + np.random.default_rng(1).normal(0, noise, len(points))
    found = find(points, colors[:, None])
    edge = found.strength > 0
    assert np.abs(off[edge]).max() <= 1.1
    assert np.mean(np.abs(off[edge]) <= 1) > 0.98
    # One point on each piece of the line, of the length at which points stand on it.
    inner = edge & (np.abs(along) < 25)
    assert 0.65 < inner.sum() / 50 < 1.1
    covered = [np.abs(along[edge] - place).min() < 1 for place in np.linspace(-25, 25, 200)]
    assert np.mean(covered) > 0.93
    assert np.median(found.strength[edge]) == pytest.approx(0.4, abs=0.03)
    line = [-math.sin(angle), math.cos(angle), 0]
    assert np.median(np.abs(found.direction[edge] @ line)) > 0.99
    assert np.isnan(found.direction[~edge]).all()


def test_a_step_round_a_sphere_is_found():
    points = ball()
    off = points @ turned(3)[:, 0]  # height over an oblique equator
    found = find(points, np.where(off > 0, 0.8, 0.3)[:, None])
    edge = found.strength > 0
    assert np.abs(off[edge]).max() <= 1
    assert 0.7 < edge.sum() / (2 * math.pi * 25) < 1.1
    assert np.median(found.strength[edge]) == pytest.approx(0.5, abs=0.02)


def test_hue_alone_makes_an_edge():
    points = sheet()
    red = points[:, 0] > 29.5
    rgb = {"red": np.where(red, 200, 40), "green": np.where(red, 40, 200), "blue": np.full(len(points), 90)}
    channels = color_channels(Cloud(points, {name: values.astype(np.uint8) for name, values in rgb.items()}))
    assert channels is not None
    assert np.ptp(channels[:, 0]) < 1e-9  # equally bright
    edge = find(points, channels).strength > 0
    assert edge.sum() > 45
    assert np.abs(points[edge, 0] - 29.5).max() <= 1.1


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_a_slow_gradient_gives_nothing(noise):
    points = sheet()
    for slope in (0.005, 0.015):
        colors = slope * points[:, 0] + np.random.default_rng(0).normal(0, noise, len(points))
        assert not find(points, colors[:, None]).strength.any()


@pytest.mark.parametrize("noise", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("count", [1, 3])
def test_noise_gives_nothing(noise, count):
    points = sheet(size=100)
    found = find(points, 0.5 + np.random.default_rng(0).normal(0, noise, (len(points), count)))
    assert not found.strength.any()
    np.testing.assert_allclose(found.noise, noise, rtol=0.06)


def test_a_checkerboard():
    points = sheet("grid", 64)
    x, y = points[:, 0], points[:, 1]
    found = find(points, ((x // 16 + y // 16) % 2 * 0.6 + 0.2)[:, None])
    edge = found.strength > 0
    off = np.minimum(*(np.min([np.abs(c - line) for line in (15.5, 31.5, 47.5)], axis=0) for c in (x, y)))
    assert off[edge].max() <= 1.5
    corner = np.maximum(*(np.min([np.abs(c - line) for line in (15.5, 31.5, 47.5)], axis=0) for c in (x, y)))
    # Away from corners and the rim each line is found, once for each of its points.
    middle = (off <= 1) & (corner > 5) & (np.minimum(x, y) > 2) & (np.maximum(x, y) < 61)
    assert edge[middle].sum() == pytest.approx(middle.sum() / 2, rel=0.05)


def test_weak_points_stay_only_with_strong_ones():
    points = sheet()
    x, y = points[:, 0], points[:, 1]
    fading = np.where(x > 29.5, 0.12 + 0.3 * (y > 30) * (y - 30) / 30, 0.0)  # one step, from 0.12 to 0.42
    edge = find(points, fading[:, None]).strength > 0
    assert (edge & (y < 20)).sum() > 12
    assert not find(points, np.where(x > 29.5, 0.12, 0.0)[:, None]).strength.any()


def test_motion_scale_and_order_change_nothing():
    points = sheet()
    rng = np.random.default_rng(2)
    colors = np.clip(0.4 * (points @ [0.8, 0.6, 0] > 40) + rng.normal(0.3, 0.03, len(points)), 0, 1)[:, None]
    found = find(points, colors)
    assert found.strength.any()
    shuffled = rng.permutation(len(points))
    again = find(points[shuffled], colors[shuffled])
    np.testing.assert_array_equal(again.strength, found.strength[shuffled])
    np.testing.assert_array_equal(again.direction, found.direction[shuffled])
    q = turned(1)
    moved = find(37.0 * points @ q.T + [100, -50, 20], colors)
    np.testing.assert_allclose(moved.strength, found.strength, atol=1e-6)
    edge = found.strength > 0
    cosines = np.abs((moved.direction[edge] * (found.direction[edge] @ q.T)).sum(axis=1))
    np.testing.assert_allclose(cosines, 1, atol=1e-6)


def test_any_number_of_threads_gives_the_same(monkeypatch):
    points = sheet(size=120)
    colors = 0.5 * (np.hypot(points[:, 0] - 60, points[:, 1] - 60) > 30)[:, None]
    monkeypatch.setenv("EDGEL_NUM_THREADS", "1")
    one = find(points, colors)
    monkeypatch.setenv("EDGEL_NUM_THREADS", "4")
    four = find(points, colors)
    np.testing.assert_array_equal(one.strength, four.strength)
    np.testing.assert_array_equal(one.direction, four.direction)


def test_odd_input():
    points = sheet(size=30)
    colors = 0.5 * (points[:, :1] > 14.5)
    index = build_index(points)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    normals[::2] = np.nan
    found = color_edges(index, points, normals, colors)
    assert not found.strength[::2].any()
    holes = colors.copy()
    holes[::7] = np.nan
    assert np.abs(points[find(points, holes).strength > 0, 0] - 14.5).max() < 1.5
    assert not find(points, np.full((len(points), 2), np.nan)).strength.any()
    twice = np.repeat(points, 30, axis=0)  # the neighbours of each lie on one spot
    assert not find(twice, np.repeat(colors, 30, axis=0)).strength.any()
    assert not find(points[:3], colors[:3]).strength.any()


@pytest.mark.parametrize("options", [{"low": 0.0}, {"low": 0.3}, {"high": math.nan}, {"num_neighbors": 7}])
def test_options_are_checked(options):
    points = sheet(size=10)
    with pytest.raises(ValueError, match="expected"):
        find(points, points[:, :1], **options)


@pytest.mark.parametrize(("name", "least", "most"), [("learn0", 0.005, 0.03), ("test60", 0.01, 0.06)])
def test_prints_on_boxes_seen_by_a_kinect_are_found(shared_data, name, least, most):
    path = shared_data / "kinect_objects" / f"{name}.pcd"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    cloud = edgel.read(path)
    channels, checked = color_channels(cloud), check_points(cloud)
    assert channels is not None
    edge = find(checked.xyz, channels[checked.rows]).strength > 0
    assert least < edge.mean() < most
