"""Scans from above: the points lie on the part, and the truth is true."""

import doctest
import importlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pytest
from exact_fittings import BEND, BOUNDS, END, PARTS, R, distance_to_surface, height, lengths

from edgel import synth
from edgel.edges import EdgeKind

CHORD = 0.0015  # mm; how far the meshes are off, less than a tenth of the noise
COUNTS = {"tee": 647_984, "elbow": 520_915}


@dataclass(frozen=True)
class Scanned:
    """A scan, its part, and the nearest true edges of its noise-free points, in space and as seen from above."""

    part: synth.Solid
    scene: synth.Scene

    @property
    def hits(self):
        return self.scene.noise_free

    @cached_property
    def nearest(self):
        return synth.nearest_edge(self.hits, self.part.edges)

    @cached_property
    def nearest_seen(self):
        flat = [replace(edge, points=edge.points * (1.0, 1.0, 0.0)) for edge in self.part.edges]
        return synth.nearest_edge(self.hits * (1.0, 1.0, 0.0), flat)


@pytest.fixture(scope="module", params=PARTS)
def full(request):
    part = PARTS[request.param]
    return Scanned(part, synth.scan(part, num_points=COUNTS[request.param]))


@pytest.fixture(scope="module", params=PARTS)
def small(request):
    return Scanned(PARTS[request.param], synth.scan(PARTS[request.param], num_points=20_000))


def brute_force(points, curves):
    """Distance of each point to every segment of every curve, and the curve of the nearest."""
    begin = np.concatenate([curve.points[:-1] for curve in curves])
    along = np.concatenate([np.diff(curve.points, axis=0) for curve in curves])
    owner = np.repeat(np.arange(len(curves)), [len(curve.points) - 1 for curve in curves])
    distance, nearest = np.empty(len(points)), np.empty(len(points), int)
    for row, point in enumerate(points):
        t = np.clip(((point - begin) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
        every = np.linalg.norm(begin + t[:, None] * along - point, axis=1)
        nearest[row] = owner[every.argmin()]
        distance[row] = every.min()
    return distance, nearest


def test_full_scans_have_the_published_counts(full):
    assert len(full.scene.cloud) == COUNTS[full.part.name]
    assert full.scene.cloud.viewpoint is None
    assert full.scene.normals.shape == (len(full.scene.cloud), 3)
    assert full.scene.noise_free.shape == (len(full.scene.cloud), 3)
    assert not full.scene.outlier.any()


def test_full_scans_fill_the_outline(full):
    xyz, bounds = full.scene.cloud.xyz, np.array(BOUNDS[full.part.name])
    low, high = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
    assert np.all(low >= bounds[0])
    assert np.all(high <= bounds[1])
    np.testing.assert_allclose([low, high], bounds, atol=2 * full.scene.spacing)


def test_points_lie_on_the_top_half_and_noise_is_as_asked(full):
    np.testing.assert_allclose(distance_to_surface(full.part.name, full.hits), 0, atol=CHORD)
    assert full.hits[:, 2].min() >= 0
    noise = full.scene.cloud.xyz - full.hits
    assert not noise[:, :2].any()
    assert abs(noise[:, 2].std() - 0.02) < 2e-4
    assert abs(noise[:, 2].mean()) < 2e-4
    assert np.abs(noise[:, 2]).max() < 0.02 * 7


def test_edge_distance_against_brute_force(full):
    sample = np.random.default_rng(1).choice(len(full.hits), 100, replace=False)
    near = np.argsort(full.nearest.distance)[::1000][:50]  # and some right at the edges
    rows = np.concatenate([sample, near])
    distance, owner = brute_force(full.hits[rows], full.part.edges)
    np.testing.assert_allclose(full.nearest.distance[rows], distance, atol=1e-9)
    other = owner != full.nearest.curve[rows]
    assert other.mean() < 0.02  # only where two edges are equally near


def test_edge_distance_in_closed_form():
    """On a straight pipe the rim is as far as its plane, and the silhouette as in a cross-section."""
    scan = Scanned(PARTS["tee"], synth.scan(PARTS["tee"], num_points=20_000))
    x, y, z = scan.hits.T
    away = (y < -R / 2) & (np.abs(x) > 70)  # where the seam is never the nearest
    exact = np.minimum(END - np.abs(x), np.hypot(y + R, z))
    np.testing.assert_allclose(scan.nearest.distance[away], exact[away], atol=1e-5)


def test_normals_are_unit_and_match_the_gradient_of_the_distance(small):
    normals = small.scene.normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
    assert np.all(normals[:, 2] >= 0)
    name, h = small.part.name, 1e-4
    measured = np.column_stack(
        [
            (distance_to_surface(name, small.hits + step) - distance_to_surface(name, small.hits - step)) / (2 * h)
            for step in h * np.eye(3)
        ]
    )
    clear = small.nearest.distance > 0.5  # away from the seam
    assert clear.mean() > 0.9
    np.testing.assert_allclose(measured[clear], normals[clear], atol=2e-5)  # interpolated over triangles


def test_the_scan_hits_the_height(small):
    x, y, z = small.hits.T
    clear = z > 5
    np.testing.assert_allclose(height(small.part.name, x, y)[clear], z[clear], atol=20 * CHORD)  # steep as R / z


def test_the_scan_goes_row_by_row(small):
    x, y = small.scene.cloud.xyz[:, :2].T
    new_row = np.flatnonzero(np.diff(x) < -small.scene.spacing) + 1
    step = np.diff(y)
    assert np.all(np.abs(np.delete(step, new_row - 1)) <= 0.2 * small.scene.spacing + 1e-12)
    assert np.all(np.diff([row.mean() for row in np.split(y, new_row)]) > 0)
    inside = np.delete(np.diff(x), new_row - 1)
    assert inside.min() > 0.8 * small.scene.spacing - 1e-12
    assert abs(np.median(inside) / small.scene.spacing - 1) < 0.02


def test_rays_that_hit_are_but_few_more_than_the_points(full):
    area = {"tee": 2 * END * 2 * R + (END - R) * 2 * R, "elbow": np.pi * BEND * R}[full.part.name]
    assert 1.0 < area / full.scene.spacing**2 / len(full.hits) < 1.03


def test_same_seed_same_bytes_and_another_another():
    part = PARTS["tee"]
    one, same, other = (synth.scan(part, num_points=3000, seed=seed) for seed in (4, 4, 5))
    assert one.cloud.xyz.tobytes() == same.cloud.xyz.tobytes()
    assert one.normals.tobytes() == same.normals.tobytes()
    assert one.edges.positions.tobytes() == same.edges.positions.tobytes()
    assert not np.array_equal(one.cloud.xyz, other.cloud.xyz)


def test_pitch_noise_and_number_can_be_chosen():
    part = PARTS["elbow"]
    coarse = synth.scan(part, pitch=2.0, noise=0.0)
    assert coarse.spacing == 2.0
    assert abs(len(coarse.cloud) / (np.pi * BEND * R / 4) - 1) < 0.02
    assert np.array_equal(coarse.cloud.xyz, coarse.noise_free)
    thinned = synth.scan(part, pitch=2.0, num_points=1000, noise=0.5)
    assert len(thinned.cloud) == 1000
    assert abs((thinned.cloud.xyz - thinned.noise_free)[:, 2].std() - 0.5) < 0.05
    assert len(synth.scan(part, num_points=1).cloud) == 1
    assert synth.scan(synth.plane()).spacing == synth.plane().spacing


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"num_points": 0}, "num_points"),
        ({"pitch": 0.0}, "pitch"),
        ({"pitch": np.nan}, "pitch"),
        ({"noise": -1.0}, "noise"),
        ({"noise": np.inf}, "noise"),
        ({"pitch": 5.0, "num_points": 100_000}, "pitch"),
        ({"pitch": 1e5}, "pitch"),
    ],
)
def test_bad_options_are_named(options, name):
    with pytest.raises(ValueError, match=name):
        synth.scan(PARTS["tee"], **options)


def test_the_dihedral_reaches_the_points(full):
    crease = np.array([edge.kind for edge in full.part.edges])[full.nearest.curve] == "crease"
    assert np.array_equal(np.isnan(full.nearest.dihedral), ~crease)
    on_seam = crease & (full.nearest.distance < full.scene.spacing)
    assert crease.any() == on_seam.any() == (full.part.name == "tee")
    foot_x = full.nearest.foot[on_seam, 0]
    np.testing.assert_allclose(full.nearest.dihedral[on_seam], np.arccos(1 - foot_x**2 / R**2), atol=1e-4)


def test_the_silhouette_as_seen_from_above(full):
    """In the projection the outermost points lie within a pitch of the outline; in 3D they are far down the side."""
    pitch = full.scene.spacing
    outermost = full.nearest_seen.distance < pitch
    names = np.array([edge.name for edge in full.part.edges])[full.nearest_seen.curve]
    outline = outermost & (names == "outline")
    length = sum(lengths(full.part, "outline"))
    assert abs(outline.sum() * pitch / length - 1) < 0.1  # a strip one pitch wide
    assert np.median(full.nearest.distance[outline]) > 5 * pitch
    assert np.all(full.nearest_seen.distance <= full.nearest.distance + 1e-9)


def test_the_truth_of_a_scan_is_that_of_what_is_seen(full):
    scene, pitch = full.scene, full.scene.spacing
    boundary = (scene.point_kind & EdgeKind.BOUNDARY) > 0
    assert full.nearest_seen.distance[boundary].max() < 1.5 * pitch
    assert np.mean(boundary[full.nearest_seen.distance < 0.2 * pitch][:1000]) > 0.4  # not those beside the seam
    seam = (scene.point_kind & EdgeKind.CREASE) > 0
    assert seam.any() == (full.part.name == "tee")
    assert np.all(full.nearest.distance[seam] <= 0.55 * pitch)
    assert np.all(full.nearest.dihedral[seam] > np.radians(24))
    true = scene.edges.take(scene.edges.kind == EdgeKind.CREASE)
    assert len(true) * pitch / 4 == pytest.approx(sum(lengths(full.part, "seam")), rel=0.1)
    stepped = scene.point_kind & (EdgeKind.OCCLUDING | EdgeKind.OCCLUDED)
    assert np.count_nonzero(stepped) <= 2  # where a wall is seen as less than a pixel


def test_nearest_edge_does_not_depend_on_the_order_of_the_points(small):
    order = np.random.default_rng(0).permutation(len(small.hits))
    shuffled = synth.nearest_edge(small.hits[order], small.part.edges)
    assert shuffled.distance.tobytes() == small.nearest.distance[order].tobytes()
    assert np.array_equal(shuffled.curve, small.nearest.curve[order])


def test_nearest_edge_of_a_short_curve_and_ties():
    curve = synth.EdgeCurve("boundary", np.array([[0.0, 0, 0], [2, 0, 0]]))
    found = synth.nearest_edge([[1.0, 3, 0], [-3, 0, 4], [5, 0, 0]], [curve, replace(curve, name="other")])
    np.testing.assert_allclose(found.distance, [3, 5, 3])
    np.testing.assert_allclose(found.foot, [[1, 0, 0], [0, 0, 0], [2, 0, 0]])
    assert found.curve.tolist() == [0, 0, 0]
    assert np.isnan(found.dihedral).all()
    assert len(synth.nearest_edge(np.empty((0, 3)), [curve]).distance) == 0


@pytest.mark.parametrize("name", ["edges", "fittings", "sample", "scan", "view"])
def test_examples_run(name):
    result = doctest.testmod(importlib.import_module(f"edgel.synth.{name}"))
    assert result.attempted > 0
    assert result.failed == 0
