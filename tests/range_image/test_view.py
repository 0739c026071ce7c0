"""The choice of a view."""

import numpy as np
import pytest
from test_range_image import camera, grid, sphere

import edgel
from edgel import Cloud
from edgel._range_image.rings import find_rings
from edgel._range_image.view import best_view


def hill():
    xyz = grid(60, 60).reshape(-1, 3)
    xyz[:, 2] = 3 * np.sin(xyz[:, 0] / 9)
    return xyz


def shaken(xyz, by=0.3):
    return xyz + np.random.default_rng(2).normal(0, by, xyz.shape)


@pytest.mark.parametrize(
    ("cloud", "method"),
    [
        (Cloud(camera()), "organized"),
        (Cloud(hill()), "organized"),
        (Cloud(shaken(hill())), "surface"),
        (Cloud(camera().reshape(-1, 3)), "organized"),
        (Cloud(camera().reshape(-1, 3), viewpoint=np.zeros(3)), "organized"),
        (Cloud(shaken(camera().reshape(-1, 3)), viewpoint=np.zeros(3)), "pinhole"),
        (Cloud(sphere(), viewpoint=np.array([0.2, 0.1, 0.0])), "spherical"),
        (Cloud(sphere(), viewpoint=np.array([0.0, 0.0, 50.0])), "surface"),
        (Cloud(sphere()), "surface"),
    ],
)
def test_choice_of_a_view(cloud, method):
    chosen = best_view(cloud, cloud.xyz)
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
    view = best_view(Cloud(xyz), xyz)
    assert view.method == "spherical"
    assert "16 rings" in view.reason
    assert view.image is not None
    shown = view.image.index[view.image.index >= 0]
    assert np.isin(np.arange(len(xyz) - empty), shown).mean() > 0.99
    assert not np.isin(np.arange(len(xyz) - empty, len(xyz)), shown).any()


def test_no_rings_where_there_are_none():
    rng, eye = np.random.default_rng(1), np.zeros(3)
    assert find_rings(rng.standard_normal((20000, 3)), eye) is None
    assert find_rings(grid(200, 200).reshape(-1, 3) + (1.0, 1.0, 5.0), eye) is None
    assert find_rings(sweep()[:500], eye) is None  # too few to tell
    flat = np.column_stack([rng.uniform(-50, 50, (20000, 2)), 0.1 * rng.standard_normal(20000)])
    outliers = np.concatenate([flat, rng.uniform(-60, 60, (200, 3))])
    assert find_rings(outliers, eye) is None  # all round, but no rings


def test_terraces_have_the_same_edges_wherever_they_lie():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 100, (2, 9000))
    steps = np.column_stack([x, y, 0.5 * np.floor(30 * x / 100)])
    wanted = edgel.detect(steps)
    for shift in ((5e5, 5e6, 200.0), (7e3, 500.0, 80.0)):
        found = edgel.detect(steps + shift)
        assert found.method == "surface"
        assert len(np.setxor1d(found.index, wanted.index)) <= 0.005 * len(wanted)


def test_the_case_of_terraces_far_away(shared_data):
    cloud = np.load(shared_data.parent / "cases" / "terraces_utm.npy")
    far, near = edgel.detect(cloud), edgel.detect(cloud - cloud.min(axis=0))
    assert far.method == near.method == "surface"
    assert len(np.setxor1d(far.index, near.index)) <= 0.005 * len(near)


def test_real_sweeps_are_known_as_lists(shared_data):
    board = shared_data.parent / "real" / "lidar_board" / "dev"
    files = sorted(board.glob("vlp16*.npz"))[:3]
    if not files:
        pytest.skip(f"no sweeps in {board}")
    for file in files:
        xyz = np.load(file)["xyz"].astype(float).reshape(-1, 3)
        xyz = np.random.default_rng(0).permutation(xyz[np.isfinite(xyz).all(axis=1)])
        view = best_view(Cloud(xyz), xyz)
        assert "16 rings" in view.reason
        assert view.image is not None
        assert view.image.shape[0] in (16, 20, 24)  # rings, and perhaps void beyond
        assert (view.image.index >= 0).sum() > 0.98 * len(xyz)
    xyz = edgel.io.read(shared_data / "lidar_sweeps" / "small_gicp_target.ply").xyz
    assert "32 rings" in edgel.detect(xyz, kinds="boundary").reason


def test_rings_about_a_viewpoint():
    place = np.array([5e5, 5e6, 100.0])
    xyz = sweep() + place
    view = best_view(Cloud(xyz, viewpoint=place), xyz)
    assert view.method == "spherical"
    assert "rings about the viewpoint" in view.reason
