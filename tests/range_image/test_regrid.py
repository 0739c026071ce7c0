"""Lists of points are put back on the grid that they came from."""

import numpy as np
import pytest
from test_range_image import camera, grid

import edgel
from edgel import Cloud, EdgeKind, synth
from edgel._range_image.lattice import find_lattice
from edgel._range_image.regrid import camera_grid, map_grid, scanner_grid

EYE = np.zeros(3)


def listed(cloud):
    """The finite points of an organized cloud, their rows in it, in any order."""
    rows = np.random.default_rng(5).permutation(np.flatnonzero(np.isfinite(cloud.xyz).all(axis=1)))
    return cloud.xyz[rows], rows


@pytest.mark.parametrize("off", [0.0, 0.1, 0.3])
def test_lattice_with_gaps_and_strays(off):
    rng = np.random.default_rng(0)
    values = 7.3 + 0.02 * (rng.integers(0, 300, 5000) + rng.uniform(-off, off, 5000))
    values[:10] = rng.uniform(-1e3, 1e3, 10)
    found = find_lattice(values)
    assert found is not None
    assert found.step == pytest.approx(0.02, rel=1e-4)
    assert np.array_equal(np.diff(found.places(np.array([7.3, 7.32, 12.3]))[0]), [1, 249])


@pytest.mark.parametrize(
    "values",
    [np.random.default_rng(1).random(5000), np.random.default_rng(2).standard_normal(5000), np.full(50, 3.0)],
)
def test_no_lattice(values):
    assert find_lattice(values) is None


@pytest.mark.parametrize(
    ("projection", "find"),
    [
        ("pinhole", lambda xyz: camera_grid(xyz, EYE)),
        ("orthographic", map_grid),
        ("spherical", lambda xyz: scanner_grid(xyz, EYE)),
    ],
)
def test_every_point_gets_its_own_cell_again(projection, find):
    cloud = synth.view(synth.gear(), projection=projection, spacing=1.5, noise=0.2).cloud
    xyz, rows = listed(cloud)
    found = find(xyz)
    assert cloud.shape is not None
    assert len(found.points) == len(xyz)
    place, true = found.cells, rows[found.points]
    up, left = place // found.shape[1] - true // cloud.shape[1], place % found.shape[1] - true % cloud.shape[1]
    if projection == "spherical":  # azimuth about Y runs the other way
        left = place % found.shape[1] + true % cloud.shape[1]
    assert len(set(left.tolist())) == 1
    assert len(set(up.tolist())) == 1 or len(set((place // found.shape[1] + true // cloud.shape[1]).tolist())) == 1


@pytest.mark.parametrize("projection", ["pinhole", "orthographic"])
def test_a_list_has_the_edges_of_its_grid(projection):
    scene = synth.view(synth.stepped_block(), projection=projection, spacing=2.0, noise=0.1)
    xyz, rows = listed(scene.cloud)
    whole = edgel.detect(scene.cloud)
    part = edgel.detect(xyz, viewpoint=scene.cloud.viewpoint)
    assert part.method == "organized"
    assert f"{len(np.unique(rows // scene.cloud.shape[1]))} x" in part.reason  # pyright: ignore[reportOptionalSubscript]
    mine, theirs = np.zeros(len(scene.cloud), int), np.zeros(len(scene.cloud), int)
    mine[rows[part.index]], theirs[whole.index] = part.kind, whole.kind
    assert (mine == theirs)[rows].mean() > 0.99
    assert (mine & EdgeKind.OCCLUDED).any()


@pytest.mark.parametrize("digits", [None, 4, 3])
def test_a_camera_whose_coordinates_are_rounded(digits):
    frame = camera(rows=120, cols=160, focal=150.0) / 100  # 7 mm a pixel
    xyz = frame.reshape(-1, 3).astype(np.float32).astype(float)
    found = camera_grid(xyz if digits is None else np.round(xyz, digits), EYE)
    assert found is not None
    assert found.shape == (120, 160)
    assert np.array_equal(found.points, np.arange(len(xyz)))
    assert camera_grid(np.round(xyz, 2), EYE) is None  # pixels run into each other


def test_a_camera_that_is_not_at_the_origin_and_looks_back():
    place = np.array([5e5, 5e6, 200.0])
    found = camera_grid(camera().reshape(-1, 3) * (1, 1, -1) + place, place)
    assert found is not None
    assert found.shape == (40, 50)


def test_what_is_no_grid_stays_a_list():
    rng = np.random.default_rng(0)
    flat = grid(60, 60).reshape(-1, 3)
    assert map_grid(flat + rng.uniform(-0.4, 0.4, flat.shape)) is None  # shaken
    assert map_grid(np.concatenate([flat, flat + (0, 0, 5)])) is None  # every place twice
    assert map_grid(np.round(rng.uniform(0, 200, (3000, 3)))) is None  # round numbers, a tenth of the places
    box = synth.sample(synth.stepped_block(), spacing=3.0, seed=0).cloud.xyz
    for found in (map_grid(box), camera_grid(box, EYE), scanner_grid(box, EYE)):
        assert found is None


def test_sides_of_the_field_of_view_are_no_edges_and_the_end_of_a_map_is():
    frame = camera(rows=60, cols=80)
    assert len(edgel.detect(frame.reshape(-1, 3), kinds="boundary")) == 0
    sheet = grid(30, 40).reshape(-1, 3) + (0, 0, 5.0)
    assert len(edgel.detect(sheet, kinds="boundary")) == 2 * (30 + 40) - 4


def test_rows_are_those_of_the_input_and_the_order_does_not_matter():
    scene = synth.view(synth.stepped_block(), projection="pinhole", spacing=3.0)
    xyz, rows = listed(scene.cloud)
    with_nan = np.concatenate([np.full((7, 3), np.nan), xyz])
    one, other = edgel.detect(Cloud(with_nan)), edgel.detect(Cloud(scene.cloud.xyz))
    back = np.sort(rows[one.index - 7])
    assert np.array_equal(back, other.index)
    assert one.reason == other.reason
