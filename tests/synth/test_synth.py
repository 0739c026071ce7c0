"""The simulated scanner: its points lie on the parts, and its truth is true."""

import doctest
import importlib
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from edgel import synth

R, END, BEND = 57.15, 105.0, 152.4
PARTS = {"tee": synth.tee(), "elbow": synth.elbow()}


@pytest.fixture(scope="module", params=PARTS)
def full(request):
    return synth.scan(PARTS[request.param])


@pytest.fixture(scope="module", params=PARTS)
def small(request):
    return synth.scan(PARTS[request.param], num_points=20_000)


def distance_to_surface(name, xyz):
    x, y, z = xyz.T
    if name == "elbow":
        return np.hypot(np.hypot(x, y) - BEND, z) - R
    return np.where((y > 0) & (np.abs(x) < y), np.hypot(x, z), np.hypot(y, z)) - R


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
    assert len(full.cloud) == {"tee": 647_984, "elbow": 520_915}[full.part.name]
    assert full.cloud.viewpoint is None
    assert full.normals.shape == (len(full.cloud), 3)
    assert full.z.shape == (len(full.cloud),)


def test_full_scans_fill_the_outline(full):
    low, high = full.cloud.xyz[:, :2].min(axis=0), full.cloud.xyz[:, :2].max(axis=0)
    expected = {"tee": [[-END, -R], [END, END]], "elbow": [[0, 0], [BEND + R, BEND + R]]}[full.part.name]
    np.testing.assert_allclose(full.part.bounds, expected, atol=1e-12)
    assert np.all(low >= full.part.bounds[0])
    assert np.all(high <= full.part.bounds[1])
    np.testing.assert_allclose([low, high], full.part.bounds, atol=2 * full.pitch)


def test_part_extents():
    np.testing.assert_allclose(np.diff(PARTS["tee"].bounds, axis=0), [[210, 162.15]])
    np.testing.assert_allclose(np.diff(PARTS["elbow"].bounds, axis=0), [[209.55, 209.55]])


def test_points_lie_on_the_top_half_and_noise_is_as_asked(full):
    np.testing.assert_allclose(distance_to_surface(full.part.name, full.hits), 0, atol=1e-9)
    assert full.z.min() >= 0
    noise = full.cloud.xyz[:, 2] - full.z
    assert abs(noise.std() - 0.02) < 2e-4
    assert abs(noise.mean()) < 2e-4
    assert np.abs(noise).max() < 0.02 * 7


def test_edge_distance_against_brute_force(full):
    sample = np.random.default_rng(1).choice(len(full.cloud), 100, replace=False)
    near = np.argsort(full.edge_distance)[::1000][:50]  # and some right at the edges
    rows = np.concatenate([sample, near])
    distance, owner = brute_force(full.hits[rows], full.part.edges)
    np.testing.assert_allclose(full.edge_distance[rows], distance, atol=1e-9)
    other = owner != full.nearest.curve[rows]
    assert other.mean() < 0.02  # only where two edges are equally near
    kinds = np.array([full.part.edges[i].kind for i in full.nearest.curve])
    assert np.array_equal(full.edge_kind, kinds)


def test_edge_distance_in_closed_form():
    """On a straight pipe the rim is as far as its plane, and the silhouette as in a cross-section."""
    scan = synth.scan(PARTS["tee"], num_points=20_000)
    x, y, z = scan.hits.T
    away = (y < -R / 2) & (np.abs(x) > 70)  # where the seam is never the nearest
    exact = np.minimum(END - np.abs(x), np.hypot(y + R, z))
    np.testing.assert_allclose(scan.edge_distance[away], exact[away], atol=1e-5)


def test_normals_are_unit_and_match_the_slope_of_the_height(small):
    np.testing.assert_allclose(np.linalg.norm(small.normals, axis=1), 1, atol=1e-9)
    assert np.all(small.normals[:, 2] >= 0)
    x, y, h = *small.cloud.xyz[:, :2].T, 1e-4
    slopes = []
    for dx, dy in ((h, 0), (0, h)):
        slopes.append((small.part.height(x + dx, y + dy) - small.part.height(x - dx, y - dy)) / (2 * h))
    measured = np.column_stack([-slopes[0], -slopes[1], np.ones(len(x))])
    measured /= np.linalg.norm(measured, axis=1)[:, None]
    clear = (small.edge_distance > 0.5) & (small.z > 5)  # away from the seam and the vertical sides
    assert clear.mean() > 0.9
    np.testing.assert_allclose(measured[clear], small.normals[clear], atol=1e-5)


def test_look_is_the_height_and_takes_any_shape(small):
    x, y = np.meshgrid(np.linspace(-120, 220, 30), np.linspace(-70, 220, 40))
    hits = small.part.look(x, y)
    assert hits.z.shape == hits.surface.shape == (40, 30)
    assert hits.normals.shape == (40, 30, 3)
    np.testing.assert_array_equal(hits.z, small.part.height(x, y))
    assert np.array_equal(np.isnan(hits.z), hits.surface < 0)
    assert np.array_equal(np.isnan(hits.normals).all(axis=2), hits.surface < 0)
    with pytest.raises(ValueError, match="one shape"):
        small.part.look(x, y[0])


def test_the_scan_goes_row_by_row(small):
    x, y = small.cloud.xyz[:, :2].T
    new_row = np.flatnonzero(np.diff(x) < -small.pitch) + 1
    step = np.diff(y)
    assert np.all(np.abs(np.delete(step, new_row - 1)) <= 0.2 * small.pitch + 1e-12)
    assert np.all(np.diff([row.mean() for row in np.split(y, new_row)]) > 0)
    inside = np.delete(np.diff(x), new_row - 1)
    assert inside.min() > 0.8 * small.pitch - 1e-12
    assert abs(np.median(inside) / small.pitch - 1) < 0.02


def test_rays_that_hit_are_but_few_more_than_the_points(full):
    area = {"tee": 2 * END * 2 * R + (END - R) * 2 * R, "elbow": np.pi * BEND * R}[full.part.name]
    assert 1.0 < area / full.pitch**2 / len(full.cloud) < 1.03


def test_same_seed_same_bytes_and_another_another():
    part = PARTS["tee"]
    one, same, other = (synth.scan(part, num_points=3000, seed=seed) for seed in (4, 4, 5))
    assert one.cloud.xyz.tobytes() == same.cloud.xyz.tobytes()
    assert one.normals.tobytes() == same.normals.tobytes()
    assert one.edge_distance.tobytes() == same.edge_distance.tobytes()
    assert not np.array_equal(one.cloud.xyz, other.cloud.xyz)


def test_pitch_noise_and_number_can_be_chosen():
    part = PARTS["elbow"]
    coarse = synth.scan(part, pitch=2.0, noise=0.0)
    assert coarse.pitch == 2.0
    assert abs(len(coarse.cloud) / (np.pi * BEND * R / 4) - 1) < 0.02
    assert np.array_equal(coarse.cloud.xyz, coarse.hits)
    thinned = synth.scan(part, pitch=2.0, num_points=1000, noise=0.5)
    assert len(thinned.cloud) == 1000
    assert abs((thinned.cloud.xyz[:, 2] - thinned.z).std() - 0.5) < 0.05
    assert len(synth.scan(part, num_points=1).cloud) == 1


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


def test_bad_parts_are_refused():
    with pytest.raises(ValueError, match="centre_to_end"):
        synth.tee(centre_to_end=50.0)
    with pytest.raises(ValueError, match="bend_radius"):
        synth.elbow(bend_radius=50.0)
    with pytest.raises(ValueError, match="wall"):
        synth.elbow(wall=60.0)
    with pytest.raises(ValueError, match="outside_diameter"):
        synth.tee(outside_diameter=-1.0)
    with pytest.raises(ValueError, match="end"):
        synth.Pipe((0.0, 0.0), (0.0, 0.0), 1.0)
    with pytest.raises(ValueError, match="radius"):
        synth.Pipe((0.0, 0.0), (1.0, 0.0), 0.0)
    with pytest.raises(ValueError, match="sweep"):
        synth.Bend((0.0, 0.0), 2.0, 1.0, 0.0, 4.0)
    with pytest.raises(ValueError, match="radius"):
        synth.Bend((0.0, 0.0), 2.0, 3.0, 0.0, 1.0)


def test_the_parts_follow_the_standard():
    assert PARTS["tee"].dimensions == {"outside_diameter": 114.3, "wall": 6.02, "centre_to_end": 105.0}
    assert PARTS["elbow"].dimensions == {"outside_diameter": 114.3, "wall": 6.02, "bend_radius": 152.4}
    with pytest.raises(FrozenInstanceError):
        PARTS["tee"].name = "other"  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_edges_are_finely_sampled_and_lie_on_the_part(part):
    for edge in part.edges:
        assert np.linalg.norm(np.diff(edge.points, axis=0), axis=1).max() <= 0.05 + 1e-12
        np.testing.assert_allclose(distance_to_surface(part.name, edge.points), 0, atol=1e-9)
        assert edge.points[:, 2].min() > -1e-9


def lengths(part, kind):
    return sorted(edge.length for edge in part.edges if edge.kind == kind)


def test_edges_of_the_tee():
    part = PARTS["tee"]
    np.testing.assert_allclose(lengths(part, "boundary"), [np.pi * R] * 3, rtol=1e-6)
    np.testing.assert_allclose(lengths(part, "occluding"), [END - R] * 4 + [2 * END], rtol=1e-9)
    assert len(lengths(part, "crease")) == 2
    for edge in part.edges:
        if edge.kind == "occluding":
            assert np.all(edge.points[:, 2] == 0)
        if edge.kind == "boundary":
            at_mouth = np.column_stack([np.abs(edge.points[:, 0]), edge.points[:, 1]])
            assert np.any(np.all(np.abs(at_mouth - END) < 1e-9, axis=0))


def test_edges_of_the_elbow():
    part = PARTS["elbow"]
    np.testing.assert_allclose(lengths(part, "boundary"), [np.pi * R] * 2, rtol=1e-6)
    np.testing.assert_allclose(lengths(part, "occluding"), [np.pi / 2 * (BEND - R), np.pi / 2 * (BEND + R)], rtol=1e-6)
    assert lengths(part, "crease") == []


def test_the_seam_of_the_tee_and_its_dihedral():
    part = PARTS["tee"]
    for seam in (edge for edge in part.edges if edge.kind == "crease"):
        x, y, z = seam.points.T
        np.testing.assert_allclose(y, np.abs(x), atol=1e-12)
        np.testing.assert_allclose(z, np.sqrt(np.maximum(R**2 - x**2, 0)), atol=1e-5)
        np.testing.assert_allclose(seam.dihedral, np.arccos(np.clip(1 - x**2 / R**2, -1, 1)), atol=1e-7)
        np.testing.assert_allclose(seam.dihedral[[0, -1]], [0, np.pi / 2], atol=1e-12)
        assert np.all(np.diff(seam.dihedral) > 0)
        assert seam.normals is not None
        inner = slice(100, -100)
        step = 1e-6
        run = part.look(x[inner], np.abs(x[inner]) - step)
        branch = part.look(x[inner], np.abs(x[inner]) + step)
        assert np.all(run.surface == 0)
        assert np.all(branch.surface == 1)
        np.testing.assert_allclose(seam.normals[inner, 0], run.normals, atol=1e-5)
        np.testing.assert_allclose(seam.normals[inner, 1], branch.normals, atol=1e-5)
    others = (edge for edge in part.edges if edge.kind != "crease")
    assert all(np.isnan(edge.dihedral).all() for edge in others)


def test_the_dihedral_reaches_the_points(full):
    crease = full.edge_kind == "crease"
    assert np.array_equal(np.isnan(full.edge_dihedral), ~crease)
    on_seam = crease & (full.edge_distance < full.pitch)
    assert crease.any() == on_seam.any() == (full.part.name == "tee")
    foot_x = full.nearest.foot[on_seam, 0]
    np.testing.assert_allclose(full.edge_dihedral[on_seam], np.arccos(1 - foot_x**2 / R**2), atol=1e-4)


def test_the_silhouette_as_seen_from_above(full):
    """In the projection the outermost points lie within a pitch of the outline; in 3D they are far down the side."""
    outermost = full.nearest_seen.distance < full.pitch
    kinds = np.array([edge.kind for edge in full.part.edges])[full.nearest_seen.curve]
    occluding = outermost & (kinds == "occluding")
    length = sum(lengths(full.part, "occluding"))
    assert abs(occluding.sum() * full.pitch / length - 1) < 0.1  # a strip one pitch wide
    assert np.median(full.edge_distance[occluding]) > 5 * full.pitch
    assert np.all(full.nearest_seen.distance <= full.edge_distance + 1e-9)


def test_nearest_edge_does_not_depend_on_the_order_of_the_points(small):
    order = np.random.default_rng(0).permutation(len(small.cloud))
    shuffled = synth.nearest_edge(small.hits[order], small.part.edges)
    assert shuffled.distance.tobytes() == small.nearest.distance[order].tobytes()
    assert np.array_equal(shuffled.curve, small.nearest.curve[order])


def test_nearest_edge_of_a_short_curve_and_ties():
    curve = synth.EdgeCurve("boundary", np.array([[0.0, 0, 0], [2, 0, 0]]))
    found = synth.nearest_edge([[1.0, 3, 0], [-3, 0, 4], [5, 0, 0]], [curve, replace(curve, kind="occluding")])
    np.testing.assert_allclose(found.distance, [3, 5, 3])
    np.testing.assert_allclose(found.foot, [[1, 0, 0], [0, 0, 0], [2, 0, 0]])
    assert found.curve.tolist() == [0, 0, 0]
    assert np.isnan(found.dihedral).all()
    assert len(synth.nearest_edge(np.empty((0, 3)), [curve]).distance) == 0


def test_bad_edges_are_refused():
    two = np.zeros((2, 3))
    with pytest.raises(ValueError, match="kind"):
        synth.EdgeCurve("fold", two)
    with pytest.raises(ValueError, match="points"):
        synth.EdgeCurve("boundary", np.zeros((1, 3)))
    with pytest.raises(ValueError, match="normals"):
        synth.EdgeCurve("crease", two)
    with pytest.raises(ValueError, match="normals"):
        synth.EdgeCurve("crease", two, np.zeros((2, 3)))
    with pytest.raises(ValueError, match="curves"):
        synth.nearest_edge(two, [])
    with pytest.raises(ValueError, match="finite"):
        synth.nearest_edge([[np.nan, 0, 0]], [synth.EdgeCurve("boundary", two)])


def test_a_slanting_pipe_and_a_turned_bend():
    """Surfaces in general position agree with themselves turned back."""
    rng, turn = np.random.default_rng(2), 0.7
    x, y = rng.uniform(-30, 30, (2, 2000))
    c, s = np.cos(turn), np.sin(turn)
    straight, slanting = synth.Pipe((0, 0), (20, 0), 5.0), synth.Pipe((0, 0), (20 * c, 20 * s), 5.0)
    level, turned = synth.Bend((0, 0), 20, 5.0, 0.2, 2.5), synth.Bend((0, 0), 20, 5.0, 0.2 + turn, 2.5)
    for one, other in ((straight, slanting), (level, turned)):
        z, same = one.height(x, y), other.height(c * x - s * y, s * x + c * y)
        np.testing.assert_allclose(same, z, atol=1e-7)
        hit = np.isfinite(z)
        xyz = np.column_stack([x, y, z])[hit]
        back = other.normals(xyz @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
        np.testing.assert_allclose(back @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), one.normals(xyz), atol=1e-9)
        assert np.all((xyz[:, :2] >= one.bounds[0]) & (xyz[:, :2] <= one.bounds[1]))
        np.testing.assert_allclose(one.bounds, [xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)], atol=2.5)


@pytest.mark.parametrize("name", ["edges", "fittings", "part", "scanner", "surfaces"])
def test_examples_run(name):
    result = doctest.testmod(importlib.import_module(f"edgel.synth.{name}"))
    assert result.attempted > 0
    assert result.failed == 0
