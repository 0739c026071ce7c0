"""Evidence: each kernel against its slow oracle, the trees against a plain walk, and what `detect` makes of it."""

import itertools
import math

import naive
import numpy as np
import pytest

import edgel
from edgel import evidence, metrics, synth
from edgel.edges import EdgeKind
from edgel._surface import FITS, coarse, context, scales, sectors, sheets, through
from edgel._surface.forest import Forest, evaluate
from edgel._surface.plane_scales import SCALES, fit_scales
from edgel._surface.sectors import sector_gaps
from edgel._surface.two_planes import fit_sheets
from edgel._surface.minimal_planes import planes_through, span_planes
from edgel._neighbors.kdtree import build_index, leaf_starts
from edgel._kernels.simd import LANES
from edgel._neighbors.knn import visit_neighbors


def rows(vectors):
    """Lay vectors out as the kernels want them, (3, k)."""
    return np.ascontiguousarray(vectors.T)


def neighbourhood(rng, count=96, noise=0.05, bend=0.6):
    """Points on a bent roof, relative to one of them, nearest first."""
    x, y = rng.uniform(-5, 5, (2, count))
    points = np.column_stack([x, y, -bend * np.abs(x - 0.3) + 0.02 * y**2]) + noise * rng.standard_normal((count, 3))
    vectors = points - points[np.argmin(np.linalg.norm(points, axis=1))]
    return vectors[np.argsort((vectors**2).sum(axis=1), kind="stable")]


@pytest.mark.parametrize("seed", range(5))
def test_plane_fits_at_each_scale_match_numpy(seed):
    vectors = neighbourhood(np.random.default_rng(seed))
    normals, features = np.zeros((len(SCALES), 4)), np.zeros(scales.NUM_FEATURES)
    fit_scales(rows(vectors), (vectors**2).sum(axis=1), np.array(SCALES), normals, features)
    for s, k in enumerate(SCALES):
        normal, variation, flatness = naive.covariance_plane(vectors[:k])
        assert abs(normals[s, :3] @ normal) == pytest.approx(1, abs=1e-9)
        assert features[6 * s] == pytest.approx(math.log(variation + 1e-6), abs=1e-6)
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
    """What two planes make of one neighbourhood, in the third of eight lanes."""
    lanes = [neighbourhood(np.random.default_rng(i), len(vectors)) for i in range(LANES)]
    lanes[2] = vectors
    features, found = fitted_in_step(lanes, count)
    return features[2], found[2]


def fitted_in_step(lanes, count):
    around = np.zeros((LANES, count, 4))
    for planes, vectors in zip(around, lanes, strict=True):
        for i in range(count):  # the small plane of each neighbour
            near = np.argsort(((vectors - vectors[i]) ** 2).sum(axis=1))[:8]
            planes[i, :3], planes[i, 3] = naive.covariance_plane(vectors[near])[0], 1
    room, features, found = sheets.make_room(), np.empty(sheets.NUM_FEATURES * LANES), np.empty(sheets.SHEETS * LANES)
    fit_sheets(in_step(lanes), in_step(around), count, np.ones(LANES), room, features, found)
    return features.reshape(-1, LANES).T, found.reshape(-1, LANES).T


def in_step(lanes):
    """Lay eight lists of vectors out as rows of eight."""
    return np.ascontiguousarray(np.transpose(lanes, (2, 1, 0))).reshape(np.shape(lanes)[2], -1)


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # the naive plane of points at one place
def test_points_without_two_planes_leave_those_in_the_other_lanes_alone():
    rng = np.random.default_rng(7)
    good = [neighbourhood(np.random.default_rng(seed)) for seed in range(LANES)]
    expected, hinges = fitted_in_step(good, 24)
    place, flat, line = (
        np.zeros((96, 3)),
        rng.uniform(-5, 5, (96, 3)) * [1, 1, 0],
        rng.uniform(-5, 5, (96, 1)) * [1, 2, 0],
    )
    lanes = list(good)
    lanes[0], lanes[3], lanes[5] = (v[np.argsort((v**2).sum(axis=1))] for v in (place, flat, line))
    features, found = fitted_in_step(lanes, 24)
    others = [1, 2, 4, 6, 7]
    assert np.array_equal(features[others], expected[others])
    assert np.array_equal(found[others], hinges[others])
    assert not features[0].any()
    assert not found[[0, 3]].any()
    assert features[3, [2, 5, 6, 7, 11]] == pytest.approx([features[3, 0], 4, 4, 4, 2])
    assert np.isfinite(features).all()
    assert np.isfinite(found).all()


@pytest.mark.parametrize("count", [1, 7, 8, 9, 20])
def test_evidence_does_not_depend_on_who_else_is_asked(count):
    rng = np.random.default_rng(2)
    index = build_index(np.concatenate([neighbourhood(rng, 400), np.repeat(rng.normal(size=(1, 3)), 120, axis=0)]))
    surveyed = evidence.survey(index)
    everywhere = evidence.examine(index, surveyed, index.at(np.arange(len(index))))
    places = rng.permutation(len(index))[:count]
    some = evidence.examine(index, surveyed, index.at(places))
    assert np.array_equal(some.features, everywhere.features[places])
    assert np.array_equal(some.fit, everywhere.fit[places])


@pytest.mark.parametrize("seed", range(4))
def test_sectors_match_the_naive_ones(seed):
    rng = np.random.default_rng(seed)
    vectors = neighbourhood(rng, bend=0.1)
    vectors = vectors[vectors[:, 0] > -0.5]
    squared = (vectors**2).sum(axis=1)
    normals, features = np.tile([0.0, 0.0, 1.0, 1.0], (3, 1)), np.empty(sectors.NUM_FEATURES)
    angles, (begins, ends) = np.empty(len(vectors)), np.empty((2, sectors.BINS))
    sector_gaps(rows(vectors), squared, normals, np.array(sectors.COUNTS), angles, begins, ends, features)
    for s, k in enumerate(sectors.COUNTS):
        widest, second = naive.two_widest_sectors(vectors[:k, :2])
        assert features[2 * s] == pytest.approx(widest, abs=1e-7)
        assert features[2 * s + 1] == pytest.approx(second, abs=1e-7 if second > 4 * np.pi / sectors.BINS else 0.1)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("count", "inlier"), through.FITS)
def test_planes_through_the_point_match_the_naive_ones(seed, count, inlier):
    vectors = neighbourhood(np.random.default_rng(seed), noise=0.02)
    planes = np.empty((3, through.PLANES), np.float32)
    off = np.zeros((through.VOTERS, through.PLANES), np.float32)
    score, features = np.empty(through.PLANES, np.float32), np.empty(through.NUM_FEATURES)
    span_planes(rows(vectors), 1.0, planes, off)
    planes_through(rows(vectors), count, 1.0, inlier, math.cos(0.35), planes, off, score, features)
    angle, first, second = naive.two_planes_through(vectors[:count], through.SPANNING, inlier, 0.35)
    assert features[1] == pytest.approx(first, abs=1e-4)
    assert features[2] == pytest.approx(second, abs=1e-4)
    assert features[0] == pytest.approx(angle, abs=1e-3)


def test_context_hears_the_neighbours_along_and_beside_the_edge():
    """On a grid, one row of sure points: seen from it, sure ones lie ahead and behind and none beside."""
    x, y = np.meshgrid(np.arange(21.0), np.arange(21.0))
    index = build_index(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]))
    chances = np.zeros((2, len(index)), np.float32)
    chances[0] = np.select([index.xyz[1] == 10, index.xyz[1] == 11], [0.9, 0.3])
    slot = np.full(len(index), -1, np.int32)
    features = np.zeros((2, 2, context.NUM_FEATURES), np.float32)
    queries = build_index(np.array([[10.0, 10, 0], [10, 11, 0]]))
    nowhere = np.zeros((1, 3), np.float32)
    arguments = (chances, slot, nowhere, nowhere, features)
    visit_neighbors(context.look_around, queries, index, context.NEIGHBORS + 1, *arguments)
    sure, faint = features[0]
    assert sure[[0, 3, 4, 5]] == pytest.approx([0.9, 0.9, 0.9, 0.3], abs=1e-6)  # itself, and the best of the 8 around
    assert sure[6] == pytest.approx((2 * 0.9 + 3 * 0.3) / 8, abs=1e-6)
    assert sure[[11, 12]] == pytest.approx([0.9, 0.9], abs=1e-6)
    assert sure[13] == pytest.approx(0.6, abs=1e-6)  # surer than those beside
    assert faint[13] == pytest.approx(-0.6, abs=1e-6)
    assert sure[1] > 0.5


def test_the_look_at_leaves_matches_numpy():
    xyz = neighbourhood(np.random.default_rng(1), count=500)
    index = build_index(xyz)
    features, planes, near = coarse.look(index)
    leaves = len(features)
    limits = leaf_starts(index)
    points = [index.xyz[:, a:b].T for a, b in itertools.pairwise(limits)]
    middles = np.array([p.mean(axis=0) for p in points])
    for leaf in range(leaves):
        normal, variation, _ = naive.covariance_plane(points[leaf])
        assert abs(planes[leaf, :3] @ normal) == pytest.approx(1, abs=1e-7)
        assert planes[leaf, 3] == pytest.approx(math.exp(-variation / coarse.PLANAR), rel=1e-4)
        nearest = np.argsort(((middles - middles[leaf]) ** 2).sum(axis=1))
        assert near[leaf].tolist() == nearest[: len(near[leaf])].tolist()
        size = math.sqrt(points[leaf].var(axis=0).sum())
        for g, count in enumerate(coarse.GROUPS):
            group = np.concatenate([points[i] for i in nearest[:count]])
            normal, variation, _ = naive.covariance_plane(group)
            aside = group.mean(axis=0) - middles[leaf]
            off = aside @ normal
            expected = [math.log(variation + 1e-6), abs(off) / size, math.sqrt(max(aside @ aside - off**2, 0)) / size]
            assert features[leaf, 4 * g : 4 * g + 3] == pytest.approx(expected, abs=2e-3)
            assert features[leaf, 4 * g + 3] == pytest.approx(math.sqrt(group.var(axis=0).sum()) / size, rel=1e-4)
        assert features[leaf, -1] == len(points[leaf])


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
        ("coarse", coarse.NUM_FEATURES + evidence.NUM_CLOUD),
        ("screen", evidence.NUM_CHEAP),
        ("first crease", evidence.NUM_COSTLY),
        ("first outline", evidence.NUM_COSTLY),
        ("crease", evidence.NUM_ALL),
        ("outline", evidence.NUM_ALL),
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
    creases, true = creases.take(here), true.take(apart.points[here, 0])
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
