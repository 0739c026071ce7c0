"""Views and samples: what they measure lies on the solid, and their truth says what can be seen."""

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from edgel import synth
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.edges import EdgeKind
from edgel.synth.rays import build_ray_tree, cast
from edgel.synth.solid import flat_normals, grid_triangles
from edgel.synth.truth import CREASE_TURN, STEP

BLOCK, FRUSTUM = synth.stepped_block(), synth.frustum()
BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def depth_of(scene):
    assert scene.depth is not None
    return scene.depth


def back(scene, places):
    """Places of the cloud's frame in the solid's."""
    return (places - scene.pose[:3, 3]) @ scene.pose[:3, :3]


def off_block(places):
    """Distance to the surface of the stepped block, by rays along its outside normals' axes."""
    tree = build_ray_tree(BLOCK)
    nearest = np.full(len(places), np.inf)
    for way in np.concatenate([np.eye(3), -np.eye(3)]):
        found = cast(tree, places - 0.01 * way, np.broadcast_to(way, places.shape)).distance
        nearest = np.minimum(nearest, np.abs(found - 0.01))
    return nearest


@pytest.mark.parametrize("projection", synth.PROJECTIONS)
@pytest.mark.parametrize("solid", [BLOCK, FRUSTUM, synth.sphere(), synth.plane()], ids=lambda s: s.name)
def test_area_per_point_of_views_is_the_spacing(projection, solid):
    scene = synth.view(solid, projection=projection, spacing=solid.spacing)
    finite = np.isfinite(depth_of(scene).ravel())
    if solid.name == "plane":
        area = solid.area
    elif solid.name == "sphere":
        away = np.linalg.norm(scene.pose[:3, 3])
        cosine = 0 if projection == "orthographic" else 25 / away
        area = 2 * np.pi * 25**2 * (1 - cosine)
    else:  # dense points of the whole surface that nothing hides
        dense = synth.sample(solid, spacing=0.5, seed=1)
        places = dense.noise_free @ scene.pose[:3, :3].T + scene.pose[:3, 3]
        origins = places * (1, 1, 0) if projection == "orthographic" else np.zeros_like(places)
        ways = places - origins
        found = cast(build_ray_tree(solid), back(scene, origins), ways @ scene.pose[:3, :3])
        area = solid.area * np.mean(found.distance > 1 - 1e-6)
    assert np.sqrt(area / finite.sum()) == pytest.approx(solid.spacing, rel=0.05)


@pytest.mark.parametrize("projection", synth.PROJECTIONS)
def test_views_are_organized_in_the_sensor_frame(projection):
    scene = synth.view(BLOCK, projection=projection, spacing=1.5)
    hit = np.isfinite(depth_of(scene))
    assert scene.cloud.shape == depth_of(scene).shape
    np.testing.assert_array_equal(np.isfinite(scene.cloud.xyz[:, 0]), hit.ravel())
    np.testing.assert_array_equal(scene.cloud.viewpoint, np.zeros(3))
    xyz = scene.cloud.xyz[hit.ravel()]
    depth = np.linalg.norm(xyz, axis=1) if projection == "spherical" else xyz[:, 2]
    np.testing.assert_allclose(depth, depth_of(scene)[hit])
    assert off_block(back(scene, xyz)).max() < 1e-6
    # From the viewpoint nothing stands before a point, and x grows with columns, y with rows.
    if projection != "orthographic":
        eye = np.broadcast_to(back(scene, np.zeros(3)), xyz.shape)
        found = cast(build_ray_tree(BLOCK), eye, back(scene, xyz) - eye)
        np.testing.assert_allclose(found.distance, 1, atol=1e-9)
    columns, rows = np.meshgrid(np.arange(hit.shape[1]), np.arange(hit.shape[0]))
    assert np.corrcoef(columns[hit], xyz[:, 0])[0, 1] > 0.99
    assert np.corrcoef(rows[hit], xyz[:, 1])[0, 1] > 0.9
    assert not hit[[0, -1]].any()
    assert not hit[:, [0, -1]].any()
    sight = xyz * (0, 0, 1) if projection == "orthographic" else xyz
    assert (scene.normals[hit.ravel()] * sight).sum(axis=1).max() < 0  # outside is towards the sensor


@pytest.mark.parametrize("projection", synth.PROJECTIONS)
def test_noise_is_along_the_ray_and_as_strong_as_asked(projection):
    scene = synth.view(BLOCK, projection=projection, spacing=1.0, noise=0.3, seed=4)
    hit = np.isfinite(depth_of(scene).ravel())
    error = (scene.cloud.xyz - scene.noise_free)[hit]
    ray = np.broadcast_to([0.0, 0.0, 1.0], error.shape) if projection == "orthographic" else scene.noise_free[hit]
    ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    along = (error * ray).sum(axis=1)
    np.testing.assert_allclose(along[:, None] * ray, error, atol=1e-9)
    assert along.std() == pytest.approx(0.3, rel=0.05)
    assert abs(along.mean()) < 0.01


@pytest.mark.parametrize("pattern", synth.PATTERNS)
@pytest.mark.parametrize("solid", [BLOCK, synth.torus(), synth.wavy_sheet()], ids=lambda s: s.name)
def test_samples_have_the_spacing_lie_on_the_surface_and_cover_it(pattern, solid):
    scene = synth.sample(solid, pattern=pattern, spacing=solid.spacing, noise=0.2, seed=2)
    assert np.sqrt(solid.area / len(scene.cloud)) == pytest.approx(solid.spacing, rel=0.05)
    error = scene.cloud.xyz - scene.noise_free
    assert error.std(axis=0) == pytest.approx(0.2 * solid.spacing, rel=0.05)
    x, y, z = scene.noise_free.T
    if solid.name == "stepped_block":
        off = off_block(scene.noise_free[scene.point_kind == 0])  # on an edge rays along the axes graze
    elif solid.name == "torus":
        off = np.hypot(np.hypot(x, y) - 30, z) - 12
    else:
        off = z - 4 * np.sin(2 * np.pi * x / 40) * np.cos(2 * np.pi * y / 50)
    assert np.abs(off).max() < 0.01 * solid.spacing
    if pattern != "graded":  # the share in each of eight parts is that of the area
        middle, areas = solid.corners.mean(axis=1), solid.areas
        if len(areas) > 1000:
            for axis in range(2):
                low = np.average(middle[:, axis] < middle[:, axis].mean(), weights=areas)
                assert np.mean(scene.noise_free[:, axis] < middle[:, axis].mean()) == pytest.approx(low, abs=0.02)


def nearest_distances(places):
    return knn(build_index(places), places, 2).distances[:, 1]


def test_patterns_are_what_their_names_say():
    sheet = synth.plane()
    blue = synth.sample(sheet, pattern="blue_noise", spacing=1.0).noise_free
    assert nearest_distances(blue).min() > 0.75
    graded = synth.sample(sheet, pattern="graded", spacing=0.7).noise_free
    counts, _ = np.histogram(graded[:, 0], bins=8, range=(0, 120))
    assert counts[0] / counts[-1] == pytest.approx(4 ** (7 / 8), rel=0.15)
    lines = synth.sample(sheet, pattern="scan_lines", spacing=1.0).noise_free
    normal = np.array([0.81, 0.47]) / np.hypot(0.81, 0.47)
    levels = np.unique((lines[:, :2] @ normal).round(6))
    gap, step = np.diff(levels), nearest_distances(lines)
    assert gap.std() < 1e-5
    assert np.median(gap) / np.median(step) == pytest.approx(10, rel=0.05)


def test_outliers_are_the_share_asked_for_and_no_edge():
    for scene in (
        synth.view(BLOCK, projection="pinhole", spacing=1.0, outliers=0.05, seed=1),
        synth.sample(BLOCK, pattern="uniform", spacing=1.0, outliers=0.05, seed=1),
    ):
        finite = np.isfinite(scene.cloud.xyz[:, 0])
        assert scene.outlier.sum() == round(0.05 * finite.sum())
        assert not scene.point_kind[scene.outlier].any()
        assert np.isnan(scene.normals[scene.outlier]).all()
        np.testing.assert_array_equal(scene.noise_free[scene.outlier], scene.cloud.xyz[scene.outlier])
        off = off_block(back(scene, scene.cloud.xyz[scene.outlier]))
        assert np.mean(off > 1) > 0.8


@pytest.mark.parametrize("projection", synth.PROJECTIONS)
def test_hidden_creases_are_not_in_the_truth(projection):
    scene = synth.view(FRUSTUM, projection=projection, spacing=0.8)
    creases = scene.edges.take(scene.edges.kind == EdgeKind.CREASE)
    forward = scene.pose[2, :3]
    whole = synth.sample(FRUSTUM, spacing=0.8).edges
    # A convex body: an edge shows as a crease when both its faces look at the sensor.
    eye = -scene.pose[:3, :3].T @ scene.pose[:3, 3]
    sight = forward if projection == "orthographic" else whole.positions - eye
    sight = np.broadcast_to(sight, whole.positions.shape)
    sight = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    shows = (np.einsum("ijk,ik->ij", whole.normals, sight) < -0.05).all(axis=1)
    assert 0.1 < shows.mean() < 0.8
    np.testing.assert_allclose(back(scene, creases.positions), whole.positions[shows], atol=1e-9)
    assert np.isfinite(creases.tangents).all()
    assert (creases.convex == 1).all()


def test_creases_behind_something_are_not_in_the_truth():
    scene = synth.view(BLOCK, projection="orthographic", spacing=0.8)
    whole = synth.sample(BLOCK, spacing=0.8).edges
    forward = scene.pose[2, :3]
    shows = (np.einsum("ijk,k->ij", whole.normals, forward) < -0.05).all(axis=1)
    seen = np.count_nonzero(scene.edges.kind == EdgeKind.CREASE)
    assert 0 < seen < 0.98 * np.count_nonzero(shows)  # in the pocket some face the sensor and are hidden
    # A column above each of them up to the sensor is free of other points in the picture.
    creases = scene.edges.take(scene.edges.kind == EdgeKind.CREASE).positions
    hits = scene.noise_free[np.isfinite(scene.noise_free[:, 0])]
    for place in creases[::40]:
        beside = np.abs(hits[:, :2] - place[:2]).max(axis=1) < 0.3
        assert not (hits[beside, 2] < place[2] - 2).any()


def test_two_plates_occlude_each_other():
    high = np.array([[[0.0, 0], [0, 20]], [[20, 0], [20, 20]]])
    high = np.concatenate([high, np.full((2, 2, 1), 10.0)], axis=2)
    low = np.array([[[-10.0, -10], [-10, 30]], [[30, -10], [30, 30]]])
    low = np.concatenate([low, np.zeros((2, 2, 1))], axis=2)
    corners = np.concatenate([grid_triangles(part) for part in (high, low)])
    solid = synth.make_solid("plates", corners, np.arange(4) // 2, flat_normals(corners), spacing=1.0)
    scene = synth.view(solid, spacing=0.5, direction=(0, 0, -1), roll=0.0)
    places, kind = back(scene, scene.noise_free), scene.point_kind
    x, y, z = places.T
    near = (kind & EdgeKind.OCCLUDING) > 0
    far = (kind & EdgeKind.OCCLUDED) > 0
    rim = (kind & EdgeKind.BOUNDARY) > 0
    inset = np.minimum.reduce([x, 20 - x, y, 20 - y])
    top = z > 5
    np.testing.assert_array_equal(near, np.nan_to_num(top & (inset < 0.5)))
    assert (np.abs(inset[far]) < 0.75).all()
    assert np.abs(z[far]).max() < 1e-9
    assert far.sum() >= near.sum()
    outer = np.minimum.reduce([x + 10, 30 - x, y + 10, 30 - y])
    np.testing.assert_array_equal(rim, np.nan_to_num(~top & (outer < 0.5) & np.isfinite(x)))
    assert not (kind & EdgeKind.CREASE).any()


@pytest.mark.parametrize("projection", synth.PROJECTIONS)
@pytest.mark.parametrize("direction", [(-0.48, 0.66, -0.58), (0.9, 0.3, -0.2), (0.1, 0.1, -0.95)])
def test_no_false_occlusion_on_convex_bodies(projection, direction):
    for solid in (FRUSTUM, synth.sphere(), synth.cylinder(), synth.plane()):
        scene = synth.view(solid, projection=projection, spacing=1.0, direction=direction)
        broken = scene.point_kind & (EdgeKind.OCCLUDING | EdgeKind.OCCLUDED)
        # Where a wall is seen as less than a pixel, the step down it cannot be told from a break: a pair at most.
        assert np.count_nonzero(broken) <= (2 if solid.name == "cylinder" else 0)


@pytest.mark.parametrize(
    "scene",
    [
        synth.view(BLOCK, projection="pinhole", spacing=1.0),
        synth.view(BLOCK, projection="spherical", spacing=1.0, noise=0.3),
        synth.sample(BLOCK, pattern="uniform", spacing=1.0, noise=1.0),
        synth.sample(synth.wavy_sheet(), pattern="scan_lines", spacing=1.0),
        synth.sample(synth.bezier_ridge(), pattern="blue_noise", spacing=1.0),
    ],
    ids=lambda scene: scene.name,
)
def test_labels_of_points_are_those_of_the_edges(scene):
    edges, kind = scene.edges, scene.point_kind
    finite = np.flatnonzero(np.isfinite(scene.noise_free[:, 0]))
    strong = edges.positions[(edges.kind == EdgeKind.CREASE) & (edges.dihedral >= CREASE_TURN)]
    curves = [(EdgeKind.CREASE, strong)]
    if scene.depth is None:
        curves.append((EdgeKind.BOUNDARY, edges.positions[edges.kind == EdgeKind.BOUNDARY]))
    for flag, positions in curves:
        marked = (kind[finite] & flag) > 0
        if len(positions) == 0:
            assert not marked.any()
            continue
        # Brute force over the samples; on the curve they are off by at most half their step.
        least = np.array([np.linalg.norm(positions - p, axis=1).min() for p in scene.noise_free[finite][::7]])
        slack = np.hypot(0.5, STEP / 2) * scene.spacing
        assert (least[marked[::7]] <= slack + 1e-9).all()
        assert marked[::7][least <= 0.5 * scene.spacing].all()
    if scene.depth is not None:
        for flag in (EdgeKind.BOUNDARY, EdgeKind.OCCLUDING, EdgeKind.OCCLUDED):
            rows = np.flatnonzero((kind & flag) > 0)
            np.testing.assert_array_equal(scene.noise_free[rows], edges.positions[edges.kind == flag])


def test_creases_that_turn_little_are_truth_but_no_label():
    bar = synth.wedge_fan(angles=(170,))
    scene = synth.sample(bar, spacing=1.0)
    faint = (scene.edges.dihedral > np.radians(4)) & (scene.edges.dihedral < np.radians(11))
    assert faint.any()
    on_top = (scene.noise_free[:, 2] > 0.3) & (np.abs(scene.noise_free[:, 1] - 20) < 15)
    assert not scene.point_kind[on_top].any()


@pytest.mark.parametrize(
    ("make", "options"), [(synth.view, {"outliers": 0.05}), (synth.sample, {"pattern": "blue_noise"})]
)
def test_the_seed_decides(make, options):
    one, same, other = (make(BLOCK, spacing=1.5, noise=0.3, seed=seed, **options) for seed in (7, 7, 8))
    assert one.cloud.xyz.tobytes() == same.cloud.xyz.tobytes()
    assert one.cloud.xyz.tobytes() != other.cloud.xyz.tobytes()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"spacing": 0.0}, "spacing"),
        ({"spacing": 1.0, "noise": -1.0}, "noise"),
        ({"spacing": 1.0, "outliers": 1.0}, "outliers"),
    ],
)
def test_options_out_of_range_are_refused(options, said):
    for make in (synth.view, synth.sample):
        with pytest.raises(ValueError, match=said):
            make(FRUSTUM, **options)


def test_unknown_views_are_refused():
    with pytest.raises(ValueError, match="projection"):
        synth.view(FRUSTUM, projection="fisheye", spacing=1.0)
    with pytest.raises(ValueError, match="pattern"):
        synth.sample(FRUSTUM, pattern="grid", spacing=1.0)
    with pytest.raises(ValueError, match="direction"):
        synth.view(FRUSTUM, spacing=1.0, direction=(0, 0, 0))
    with pytest.raises(ValueError, match="too coarse"):
        synth.view(synth.sphere(), spacing=1e4)


def benchmark_module(name):
    spec = importlib.util.spec_from_file_location(name, BENCHMARKS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def scenes(tmp_path):
    module = benchmark_module("scenes")
    vars(module)["CACHE"] = tmp_path
    return module


def test_the_benchmarks_scenes_hold_every_level(scenes):
    parts = [name.split("/") for name in scenes.TEST]
    assert len(set(scenes.TEST)) == len(scenes.TEST) >= 120
    assert not set(scenes.TEST) & set(scenes.TUNE)
    assert not {name.split("/")[0] for name in scenes.TUNE} & set(scenes.SHAPES)
    assert set(scenes.QUICK) <= set(scenes.TEST)
    assert set(scenes.PICTURES) <= set(scenes.TEST)
    assert len(scenes.PICTURES) >= 5
    assert len({shape for shape, *_ in parts}) == 17
    for seen in (*scenes.VIEWS, *scenes.PATTERNS):
        assert {n for _, s, n, _ in parts if s == seen} == {"n0", "n0.1", "n0.3", "n1"}
        assert {o for _, s, _, o in parts if s == seen} == {"o0", "o1", "o5"}
    for shape in scenes.SHAPES:
        assert {n for s, _, n, _ in parts if s == shape} == {"n0", "n0.1", "n0.3", "n1"}
        assert {o for s, _, _, o in parts if s == shape} == {"o0", "o1", "o5"}


@pytest.mark.parametrize("name", ["frustum/spherical/n0.3/o5", "pyramid/graded2/n0.1/o1"])
def test_a_name_is_a_scene(scenes, name):
    made, stored, again = scenes.make(name), scenes.load(name), scenes.load(name)
    for one in (stored, again):
        assert one.name == name
        assert one.spacing == made.spacing
        assert one.cloud.shape == made.cloud.shape
        assert one.cloud.xyz.tobytes() == made.cloud.xyz.tobytes()
        for field in ("point_kind", "normals", "noise_free", "outlier", "pose"):
            assert getattr(one, field).tobytes() == getattr(made, field).tobytes()
        for field in type(made.edges).__dataclass_fields__:
            assert getattr(one.edges, field).tobytes() == getattr(made.edges, field).tobytes()
    assert (stored.depth is None) == (made.depth is None)


@pytest.mark.parametrize("name", ["frustum", "frustum/top/n0/o0", "cow/pinhole/n0/o0", "frustum/pinhole/nx/o0"])
def test_other_names_are_refused(scenes, name):
    with pytest.raises(ValueError, match=re.escape("name:")):
        scenes.load(name)


def test_parts_of_the_cad_kernel_are_closed(tmp_path):
    pytest.importorskip("build123d")
    sys.modules.pop("parts", None)
    parts = benchmark_module("parts")
    vars(parts)["CACHE"] = tmp_path
    for name in ("bracket", "chamfered_block"):
        solid, exact = parts.part(name), parts.PARTS[name][0]()
        assert solid.boundaries == ()
        assert solid.area == pytest.approx(exact.area, rel=1e-3)
        assert solid.volume == pytest.approx(exact.volume, rel=1e-3)
        turns = np.degrees(np.concatenate([crease.dihedral for crease in solid.creases]))
        assert turns.max() == pytest.approx(90)
        assert turns.min() > 40


def test_a_part_says_how_to_install_its_maker(tmp_path):
    parts = benchmark_module("parts")
    vars(parts).update(CACHE=tmp_path, cad=None)
    with pytest.raises(ImportError, match="pip install"):
        parts.part("tee")
