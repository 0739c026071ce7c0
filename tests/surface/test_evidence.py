"""Evidence: each kernel against its slow oracle."""

import math

import naive
import numpy as np
import pytest
from alone import alone

from edgel._kernels.simd import LANES
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import anywhere
from edgel._surface import context, hinge, leaves, minimal_planes, plane_scales, sectors, two_planes
from edgel._surface.evidence import MAX_AWAY, MIN_TURN, _best_fit, gather_evidence
from edgel._surface.features import NUM_EVIDENCE, POINT
from edgel._surface.leaves import describe_leaves
from edgel._surface.minimal_planes import planes_through, span_planes
from edgel._surface.plane_scales import SCALES, fit_scales
from edgel._surface.screen import screen
from edgel._surface.sectors import sector_gaps
from edgel._surface.statistics import FEATURES as FEATURES_OF_CLOUD
from edgel._surface.statistics import cloud_statistics
from edgel._surface.two_planes import FITS, fit_two_planes


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
    normals, features = np.zeros((len(SCALES), 4)), np.zeros(plane_scales.NUM_FEATURES)
    alone(fit_scales)(rows(vectors), (vectors**2).sum(axis=1), np.array(SCALES), normals, features)
    for s, k in enumerate(SCALES):
        assert abs(normals[s, :3] @ naive.covariance_plane(vectors[:k])[0]) == pytest.approx(1, abs=1e-9)
        expected = naive.plane_scale(vectors[:k], math.sqrt(math.pi * (vectors[15] ** 2).sum() / 16))
        of_scale = features[len(plane_scales.OF_SCALE) * s :][: len(plane_scales.OF_SCALE)]
        assert of_scale == pytest.approx([expected[name] for name in plane_scales.OF_SCALE], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [12, 48])
def test_two_planes_leave_what_their_parting_leaves(seed, count):
    vectors = neighbourhood(np.random.default_rng(seed))
    features, found = fitted(vectors, count)
    one, bent = naive.plane_residual(vectors[:count]), naive.quadric_residual(vectors[:count])
    assert math.exp(features[two_planes.ONE_PLANE]) - 0.01 == pytest.approx(math.sqrt(one / count), rel=1e-6)
    assert math.exp(features[two_planes.QUADRIC]) - 0.01 == pytest.approx(math.sqrt(bent / count), abs=5e-3)
    assert features[two_planes.TWO_PLANES] <= features[two_planes.ONE_PLANE] + 1e-9
    a, b, line, foot = (found[i : i + 3] for i in (hinge.FIRST_NORMAL, hinge.SECOND_NORMAL, hinge.LINE, hinge.FOOT))
    assert abs(line @ a) < 1e-9
    assert abs(line @ b) < 1e-9
    assert abs(foot @ line) < 1e-9
    assert found[hinge.FIRST_COUNT] + found[hinge.SECOND_COUNT] == count
    centroids = [found[i : i + 3] for i in (hinge.FIRST_CENTROID, hinge.SECOND_CENTROID)]
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
    assert abs(found[hinge.LINE + 1]) == pytest.approx(1, abs=1e-9)  # the ridge runs along y
    assert features[two_planes.TURN] == pytest.approx(math.pi / 2, abs=1e-6)


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
    scratch = alone(two_planes.make_scratch)()
    features, found = np.empty(two_planes.NUM_FEATURES * LANES), np.empty(hinge.HINGE * LANES)
    alone(fit_two_planes)(in_step(lanes), in_step(around), count, np.ones(LANES), scratch, features, found)
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
    names = ("TWO_PLANES", "FOOT_AWAY", "OFF_FIRST", "OFF_SECOND", "MARGIN")
    flat_lane = features[3, [getattr(two_planes, name) for name in names]]
    assert flat_lane == pytest.approx([features[3, two_planes.ONE_PLANE], 4, 4, 4, 2])
    assert np.isfinite(features).all()
    assert np.isfinite(found).all()


@pytest.mark.parametrize("count", [1, 7, 8, 9, 20])
def test_evidence_does_not_depend_on_who_else_is_asked(count):
    rng = np.random.default_rng(2)
    index = build_index(np.concatenate([neighbourhood(rng, 400), np.repeat(rng.normal(size=(1, 3)), 120, axis=0)]))
    screening = screen(index, cloud_statistics(index))
    everywhere = gather_evidence(index, screening, np.arange(len(index)))
    places = rng.permutation(len(index))[:count]
    some = gather_evidence(index, screening, places)
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
    alone(sector_gaps)(rows(vectors), squared, normals, np.array(sectors.COUNTS), angles, begins, ends, features)
    for s, k in enumerate(sectors.COUNTS):
        widest, second = naive.two_widest_sectors(vectors[:k, :2])
        assert features[2 * s + sectors.WIDEST] == pytest.approx(widest, abs=1e-7)
        assert features[2 * s + sectors.SECOND] == pytest.approx(
            second, abs=1e-7 if second > 4 * np.pi / sectors.BINS else 0.1
        )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("count", "inlier"), minimal_planes.FITS)
def test_planes_through_the_point_match_the_naive_ones(seed, count, inlier):
    vectors = neighbourhood(np.random.default_rng(seed), noise=0.02)
    planes = np.empty((3, minimal_planes.PLANES), np.float32)
    off = np.zeros((minimal_planes.VOTERS, minimal_planes.PLANES), np.float32)
    score, features = np.empty(minimal_planes.PLANES, np.float32), np.empty(minimal_planes.NUM_FEATURES)
    alone(span_planes)(rows(vectors), 1.0, planes, off)
    alone(planes_through)(rows(vectors), count, 1.0, inlier, math.cos(0.35), planes, off, score, features)
    expected = naive.two_planes_through(vectors[:count], minimal_planes.SPANNING, inlier, 0.35)
    assert features == pytest.approx([expected[name] for name in minimal_planes.FEATURES], abs=1e-3)


def test_context_hears_the_neighbours_along_and_beside_the_edge():
    """On a grid, one row of sure points: seen from it, sure ones lie ahead and behind and none beside."""
    x, y = np.meshgrid(np.arange(21.0), np.arange(21.0))
    index = build_index(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]))
    chances = np.zeros((2, len(index)), np.float32)
    chances[0] = np.select([index.xyz[1] == 10, index.xyz[1] == 11], [0.9, 0.3])
    slot = np.full(len(index), -1, np.int32)
    features = np.zeros((2, 2, context.NUM_FEATURES), np.float32)
    queries = anywhere(np.array([[10.0, 10, 0], [10, 11, 0]]))
    nowhere = np.zeros((1, 3), np.float32)
    arguments = (chances, slot, nowhere, nowhere, features)
    visit_neighbors(context.gather_context, queries, index, context.NEIGHBORS + 1, *arguments)
    sure, faint = features[0]
    best = [context.OWN, context.FIRST, context.SECOND, context.THIRD]
    assert sure[best] == pytest.approx([0.9, 0.9, 0.9, 0.3], abs=1e-6)  # itself, and the best of the 8 around
    assert sure[context.MEAN_8] == pytest.approx((2 * 0.9 + 3 * 0.3) / 8, abs=1e-6)
    assert sure[[context.AHEAD, context.BEHIND]] == pytest.approx([0.9, 0.9], abs=1e-6)
    assert sure[context.OVER_BESIDE] == pytest.approx(0.6, abs=1e-6)  # surer than those beside
    assert faint[context.OVER_BESIDE] == pytest.approx(-0.6, abs=1e-6)
    assert sure[context.ALIGNMENT] > 0.5


def test_leaves_are_described_as_by_numpy():
    xyz = neighbourhood(np.random.default_rng(1), count=1000)
    index = build_index(xyz)
    found = describe_leaves(index, 4.0)
    features, planes, near = found.features, found.planes, found.nearest
    points = [index.at(part) for part in np.split(found.octree.places, found.octree.starts[1:-1])]
    middles = np.array([p.mean(axis=0) for p in points])
    assert found.centroids == pytest.approx(middles, abs=1e-6)
    for leaf in range(len(features)):
        spans = len(points[leaf]) >= leaves.SPANNING
        variation = math.inf
        if spans:
            normal, variation, _ = naive.covariance_plane(points[leaf])
            assert abs(planes[leaf, :3] @ normal) == pytest.approx(1, abs=1e-6)
        assert planes[leaf, 3] == pytest.approx(math.exp(-variation / leaves.PLANAR) if spans else 0, rel=1e-4)
        nearest = np.argsort(((middles - middles[leaf]) ** 2).sum(axis=1))
        assert near[leaf].tolist() == nearest[: len(near[leaf])].tolist()
        assert found.radii[leaf] == pytest.approx(np.linalg.norm(middles[near[leaf, -1]] - middles[leaf]), abs=1e-6)
        assert features[leaf, leaves.COUNT] == len(points[leaf])
        size = math.sqrt(points[leaf].var(axis=0).sum())
        if size == 0:
            continue
        for g, count in enumerate(leaves.GROUPS):
            group = np.concatenate([points[i] for i in nearest[:count]])
            normal, variation, _ = naive.covariance_plane(group)
            aside = group.mean(axis=0) - middles[leaf]
            off = aside @ normal
            expected = [math.log(variation + 1e-6), abs(off) / size, math.sqrt(max(aside @ aside - off**2, 0)) / size]
            of_group = features[leaf, len(leaves.OF_GROUP) * g :]
            of_three = of_group[[leaves.VARIATION, leaves.OFF_PLANE, leaves.OFF_CENTRE]]
            assert of_three == pytest.approx(expected, abs=5e-3)
            assert of_group[leaves.SIZE] == pytest.approx(math.sqrt(group.var(axis=0).sum()) / size, rel=1e-4)


def test_fits_grow():
    assert [count for count, _ in FITS] == sorted(count for count, _ in FITS)


def cloud_with_a_ridge():
    """Two slanted planes with noise, 500 points."""
    rng = np.random.default_rng(11)
    x, y = rng.uniform(-8, 8, (2, 500))
    return np.column_stack([x, y, -0.7 * np.abs(x) + 0.03 * rng.standard_normal(500)])


def parts(fit):
    """The parts of a hinge by their names."""
    names = {"first_normal": hinge.FIRST_NORMAL, "second_normal": hinge.SECOND_NORMAL, "line": hinge.LINE}
    found = {name: fit[row : row + 3] for name, row in (names | {"foot": hinge.FOOT}).items()}
    return found | {"parting": fit[hinge.PARTING : hinge.PARTING + 4]}


def test_every_column_holds_what_its_name_says():
    """The whole row of evidence of some points, against what the oracles say of each name."""
    points = cloud_with_a_ridge()
    index = build_index(points)
    screening = screen(index, cloud_statistics(index))
    places = np.flatnonzero(np.abs(index.xyz[0]) < 1)[::7]
    evidence = gather_evidence(index, screening, places)
    assert evidence.placed.sum() > 3
    statistics = dict(zip(FEATURES_OF_CLOUD, screening.statistics.features, strict=True))
    for row, fit, place in zip(evidence.features, evidence.fit.astype(float), places, strict=True):
        near = naive.nearest(points.tolist(), index.at(np.array([place]))[0].tolist(), 96)
        vectors = points[near] - points[near[0]]
        distances = np.linalg.norm(vectors, axis=1)
        spacing = math.sqrt(math.pi / 16) * distances[15]
        expected = {}
        for k in SCALES:
            expected |= {f"plane_{k}.{name}": v for name, v in naive.plane_scale(vectors[:k], spacing).items()}
        expected |= {"nearest.first": distances[1] / spacing, "nearest.fifth": distances[5] / spacing}
        expected |= {f"cloud.{name}": value for name, value in statistics.items()}
        for number, (count, inlier) in enumerate(minimal_planes.FITS):
            arguments = (vectors[:count] / spacing, minimal_planes.SPANNING, inlier, math.radians(20))
            support = naive.two_planes_through(*arguments)["first_support"]  # of the rest, near ties decide
            expected |= {f"minimal_planes_{number}.first_support": support}
        for s, count in enumerate(sectors.COUNTS):
            u, v = np.linalg.svd(screening.normals[place, min(s + 1, 2), :3][None].astype(float))[2][1:]
            widest = naive.two_widest_sectors(np.column_stack([vectors[:count] @ u, vectors[:count] @ v]))
            expected |= {f"sectors_{count}.widest": widest[0]}
        best = [count for count, _ in FITS if hinge_is_of(fit, vectors[:count])]
        for count in best:
            said = naive.two_planes(parts(fit), vectors[:count], spacing)
            del said["quadric"], said["quadric_gain"]  # the kernel's quadric is a little stiff
            expected |= {f"two_planes_{count}.{name}": value for name, value in said.items()}
        for name, value in expected.items():
            assert row[POINT.column(name)] == pytest.approx(value, rel=2e-3, abs=2e-3), name


def hinge_is_of(fit, vectors):
    """Whether a hinge was fitted to these neighbours: as many lie on either side as it says."""
    parting = fit[hinge.PARTING : hinge.PARTING + 3]
    first = (vectors @ parting > fit[hinge.PARTING_LEVEL]).sum()
    return fit[hinge.FIRST_COUNT] == first and fit[hinge.SECOND_COUNT] == len(vectors) - first


@pytest.mark.parametrize("count", [12, 24, 48])
def test_the_best_fit_is_the_one_that_places_the_line_best(count):
    """Residuals alike, the largest fit wins; where all but one lie far away or turn little, that one; else none."""
    features = np.zeros((1, NUM_EVIDENCE), np.float32)
    for k, _ in FITS:
        features[0, POINT.column(f"two_planes_{k}.two_planes")] = math.log(0.3)
        features[0, POINT.column(f"two_planes_{k}.turn")] = 1.0
    number = [k for k, _ in FITS].index(count)
    assert best_fit(features) == (len(FITS) - 1, True)
    features[0, POINT.column(f"two_planes_{count}.two_planes")] = math.log(0.02)
    assert best_fit(features) == (number, True)
    features[0, POINT.column(f"two_planes_{count}.foot_away")] = MAX_AWAY + 0.1
    assert best_fit(features) == (len(FITS) - 1, True)
    for k, _ in FITS:
        features[0, POINT.column(f"two_planes_{k}.turn")] = 0.9 * MIN_TURN
    assert not best_fit(features)[1]


def best_fit(features):
    best, placed = _best_fit(features)
    return int(best[0]), bool(placed[0])
