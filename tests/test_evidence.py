"""Evidence: each kernel against its slow oracle, the trees against a plain walk, and what `detect` makes of it."""

import math

import naive
import numpy as np
import pytest

import edgel
from edgel import evidence, metrics, synth
from edgel.edges import EdgeKind
from edgel.evidence import FITS, sectors, sheets
from edgel.evidence.forest import Forest, evaluate
from edgel.evidence.scales import SCALES, fit_scales
from edgel.evidence.sectors import sector_gaps
from edgel.evidence.sheets import fit_sheets


def neighbourhood(rng, count=96, noise=0.05, bend=0.6):
    """Points on a bent roof, relative to one of them, nearest first."""
    x, y = rng.uniform(-5, 5, (2, count))
    points = np.column_stack([x, y, -bend * np.abs(x - 0.3) + 0.02 * y**2]) + noise * rng.standard_normal((count, 3))
    vectors = points - points[np.argmin(np.linalg.norm(points, axis=1))]
    return vectors[np.argsort((vectors**2).sum(axis=1), kind="stable")]


@pytest.mark.parametrize("seed", range(5))
def test_plane_fits_at_each_scale_match_numpy(seed):
    vectors = neighbourhood(np.random.default_rng(seed))
    normals, features = np.zeros((len(SCALES), 4)), np.zeros(evidence.NUM_CHEAP)
    fit_scales(vectors, (vectors**2).sum(axis=1), np.array(SCALES), normals, features)
    for s, k in enumerate(SCALES):
        normal, variation, flatness = naive.covariance_plane(vectors[:k])
        assert abs(normals[s, :3] @ normal) == pytest.approx(1, abs=1e-9)
        assert features[6 * s] == pytest.approx(math.log(variation + 1e-4), abs=1e-6)
        assert features[6 * s + 1] == pytest.approx(flatness, abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [12, 48])
def test_two_planes_leave_what_their_parting_leaves(seed, count):
    vectors = neighbourhood(np.random.default_rng(seed))
    features, found = fitted(vectors, count)
    one, bent = naive.plane_residual(vectors[:count]), naive.quadric_residual(vectors[:count])
    assert math.exp(features[0]) - 0.01 == pytest.approx(math.sqrt(one / count), rel=1e-6)
    assert math.exp(features[1]) - 0.01 == pytest.approx(math.sqrt(bent / count), abs=5e-3)
    assert features[2] <= features[0] + 1e-9
    a, b, line, foot = found[0:3], found[3:6], found[6:9], found[9:12]
    assert abs(line @ a) < 1e-9
    assert abs(line @ b) < 1e-9
    assert abs(foot @ line) < 1e-9
    assert found[12] + found[13] == count
    centroids = found[14:17], found[17:20]
    assert (a @ (foot - centroids[0])) == pytest.approx(0, abs=1e-9)
    assert (b @ (foot - centroids[1])) == pytest.approx(0, abs=1e-9)


def test_two_planes_of_a_clean_roof_are_its_faces():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-4, 4, (2, 96))
    points = np.column_stack([x, y, -np.abs(x - 0.2)])
    vectors = points - points[np.argmin(np.linalg.norm(points, axis=1))]
    vectors = vectors[np.argsort((vectors**2).sum(axis=1))]
    features, found = fitted(vectors, 48)
    normals = np.abs(found[:6].reshape(2, 3) @ np.array([[1, 0, 1], [-1, 0, 1]]).T / math.sqrt(2))
    assert normals.max(axis=1) == pytest.approx([1, 1], abs=1e-9)
    assert abs(found[7]) == pytest.approx(1, abs=1e-9)  # the ridge runs along y
    assert features[3] == pytest.approx(math.pi / 2, abs=1e-6)


def fitted(vectors, count):
    normals, cheap = np.zeros((len(SCALES), 4)), np.zeros(evidence.NUM_CHEAP)
    squared = (vectors**2).sum(axis=1)
    fit_scales(vectors, squared, np.array(SCALES), normals, cheap)
    planes = np.tile(normals[0].astype(np.float32), (len(vectors), 1))
    for i in range(len(vectors)):  # the small plane of each neighbour
        near = np.argsort(((vectors - vectors[i]) ** 2).sum(axis=1))[:8]
        planes[i, :3], planes[i, 3] = naive.covariance_plane(vectors[near])[0], 1
    features, found = np.empty(sheets.NUM_FEATURES), np.empty(sheets.SHEETS)
    side, best = np.empty(len(vectors), np.int64), np.empty(len(vectors), np.int64)
    places = np.arange(len(vectors))
    room, solve = np.empty((7, sheets.SHEETS)), np.empty((6, 7))
    fit_sheets(vectors, places, squared, count, 1.0, planes, side, best, room, solve, features, found)
    return features, found


@pytest.mark.parametrize("seed", range(4))
def test_sectors_match_the_naive_ones(seed):
    rng = np.random.default_rng(seed)
    vectors = neighbourhood(rng, bend=0.1)
    vectors = vectors[vectors[:, 0] > -0.5]
    squared = (vectors**2).sum(axis=1)
    normals, features = np.tile([0.0, 0.0, 1.0, 1.0], (3, 1)), np.empty(sectors.NUM_FEATURES)
    sector_gaps(vectors, squared, normals, np.array(sectors.COUNTS), np.empty(len(vectors)), features)
    for s, k in enumerate(sectors.COUNTS):
        assert features[2 * s : 2 * s + 2] == pytest.approx(naive.two_widest_sectors(vectors[:k, :2]), abs=1e-9)


def test_trees_match_a_plain_walk():
    rng = np.random.default_rng(0)
    forest = Forest(
        roots=np.array([0, 5], np.int32),
        feature=np.array([1, 0, -1, -1, -1, 2, -1, -1], np.int16),
        threshold=np.array([0.5, 0.2, -1, 2, 0.3, 0.7, 1, -2], np.float32),
        right=np.array([4, 3, 0, 0, 0, 7, 0, 0], np.int32),
    )
    features = rng.random((200, 3)).astype(np.float32)
    expected = [naive.walk_trees(forest, row) for row in features]
    assert evaluate(forest, features) == pytest.approx(expected, abs=1e-12)


def test_the_package_has_trees_for_its_features():
    for name, count in (
        ("crease", evidence.NUM_COSTLY),
        ("outline", evidence.NUM_COSTLY),
        ("screen", evidence.NUM_CHEAP),
    ):
        forest = evidence.forests()[name]
        assert 0 < forest.feature.max() < count
        assert (forest.right[forest.feature >= 0] > 0).all()


@pytest.fixture(scope="module")
def wedge():
    """A ridge that turns by 60 degrees, its feet by 30, sampled all round."""
    return synth.sample(synth.wedge_fan(angles=(120,), flank=20.0, width=40.0), pattern="blue_noise", spacing=0.8)


@pytest.fixture(scope="module")
def found(wedge):
    return edgel.detect(wedge.cloud)


def test_geometry_of_clean_creases(wedge, found):
    """Median error of position, direction and both normals, on the creases found."""
    creases = found.take((found.kind & EdgeKind.CREASE) > 0)
    true = wedge.edges.take(wedge.edges.dihedral > np.radians(25))
    apart = metrics.nearest(creases.position, true.positions)
    here = apart.distances[:, 0] < 1.5 * wedge.spacing
    creases, true = creases.take(here), true.take(apart.rows[here, 0])
    off = creases.position - true.positions
    off -= (off * true.tangents).sum(axis=1, keepdims=True) * true.tangents
    assert np.nanmedian(np.linalg.norm(off, axis=1)) <= 0.1 * wedge.spacing
    assert np.nanmedian(between(creases.direction, true.tangents)) <= 3
    straight = [between(creases.normals[:, i], true.normals[:, i]) for i in (0, 1)]
    crossed = [between(creases.normals[:, i], true.normals[:, 1 - i]) for i in (0, 1)]
    assert np.nanmedian(np.fmin(np.maximum(*straight), np.maximum(*crossed))) <= 2
    assert np.nanmedian(np.abs(creases.angle - true.dihedral)) <= np.radians(3)


def between(a, b):
    return np.degrees(np.arccos(np.clip(np.abs((a * b).sum(axis=1)), 0, 1)))


@pytest.mark.parametrize(("turn", "recall"), [(45, 0.97), (25, 0.8)])
def test_creases_are_found_and_little_else(wedge, found, turn, recall):
    true = wedge.edges.positions[wedge.edges.dihedral > np.radians(turn)]
    places = wedge.cloud.xyz[found.index]
    assert np.mean(metrics.nearest(true, places).distances[:, 0] <= wedge.spacing) >= recall
    away = metrics.nearest(places, wedge.edges.positions).distances[:, 0] > 2.5 * wedge.spacing
    assert away.sum() <= len(wedge.cloud) / 1000


@pytest.mark.parametrize("noise", [0, 0.3])
def test_smooth_surfaces_have_no_edges(noise):
    scene = synth.sample(synth.sphere(), pattern="uniform", spacing=0.9, noise=noise, seed=3)
    assert len(edgel.detect(scene.cloud)) <= max(1, len(scene.cloud) / 1000)


def test_rotation_translation_scale_and_order_change_nothing(wedge, found):
    rng = np.random.default_rng(5)
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    order = rng.permutation(len(wedge.cloud))
    moved = 1000 * wedge.cloud.xyz[order] @ rotation.T + (3e5, -2e5, 7e4)
    again = edgel.detect(moved)
    mine, other = np.zeros((2, len(order)), bool)
    mine[found.index] = True
    other[order[again.index]] = True
    assert np.mean(mine != other) <= 2e-3  # rounding may decide a tie
    shuffled = edgel.detect(wedge.cloud.xyz[order])
    assert np.array_equal(np.sort(order[shuffled.index]), found.index)
    back = np.argsort(order[shuffled.index])
    assert np.array_equal(shuffled.position[back], found.position)


def test_twice_as_dense_keeps_the_edges(wedge, found):
    dense = synth.sample(
        synth.wedge_fan(angles=(120,), flank=20.0, width=40.0), pattern="blue_noise", spacing=0.8 / 2**0.5
    )
    again = edgel.detect(dense.cloud)
    apart = metrics.distances(wedge.cloud.xyz[found.index], dense.cloud.xyz[again.index])
    assert apart.chamfer <= wedge.spacing


def test_many_points_at_one_place_are_borne(wedge):
    repeated = np.concatenate([wedge.cloud.xyz, np.repeat(wedge.cloud.xyz[:3], 200, axis=0)])
    assert np.isfinite(edgel.detect(repeated).position).all()


def test_threads_change_nothing(wedge, found, monkeypatch):
    monkeypatch.setenv("EDGEL_NUM_THREADS", "1")
    alone = edgel.detect(wedge.cloud)
    assert np.array_equal(alone.index, found.index)
    assert np.array_equal(alone.strength, found.strength)
    assert np.array_equal(alone.normals, found.normals, equal_nan=True)


def test_fits_grow():
    assert [count for count, _ in FITS] == sorted(count for count, _ in FITS)
