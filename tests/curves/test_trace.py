"""Curves of known parts: where they lie, how long and round they are, what meets, and that nothing else decides."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

import edgel
from edgel import synth
from edgel.curves import CurveKind, trace
from edgel.edges import EdgeKind, Edges


def sampled(solid, noise=0.0, seed=3):
    scene = synth.sample(solid, pattern="blue_noise", spacing=solid.spacing, noise=noise, seed=seed)
    return scene, edgel.detect(scene.cloud, min_strength=edgel.curves.FAINT)


@pytest.fixture(scope="module")
def block():
    return sampled(synth.frustum(sides=4, bottom=30.0, top=24.0, height=20.0), noise=0.1)


@pytest.fixture(scope="module")
def cylinder():
    return sampled(synth.cylinder(), noise=0.1)


def test_a_frustum_is_its_twelve_lines_and_eight_corners(block):
    scene, edges = block
    curves = trace(scene.cloud, edges)
    assert curves.count_kinds() == {"line": 12}
    assert int(curves.is_corner.sum()) == 8
    assert all(len(curves.curves_at(node)) == 3 for node in range(8))
    true = synth.frustum(sides=4, bottom=30.0, top=24.0, height=20.0)
    assert curves.length.sum() == pytest.approx(sum(curve.length for curve in true.creases), rel=2e-3)
    assert np.median(synth.nearest_edge(curves.vertices, true.creases).distance) < 0.1 * scene.spacing
    assert curves.measured.all()
    turns = np.array([np.median(curve.dihedral) for curve in true.creases])
    np.testing.assert_allclose(np.sort(curves.angle), np.sort(turns), atol=0.02)
    off = np.sort(curves.angle) - np.sort(turns)
    assert 0.2 < np.sqrt(np.mean((off / curves.angle_std) ** 2)) < 3


def test_rims_are_circles_measured_on_plane_and_wall(cylinder):
    scene, edges = cylinder
    curves = trace(scene.cloud, edges)
    true = synth.cylinder().creases
    radii = sorted(np.linalg.norm(curve.points - curve.points.mean(axis=0), axis=1).mean() for curve in true)
    assert curves.count_kinds() == {"circle": len(true)}
    assert not len(curves.corners)
    error = np.abs(np.sort(curves.radius) - radii)
    assert (error < 0.05 * scene.spacing).all()
    assert (error < 4 * curves.radius_std).all()
    assert curves.closed.all()
    np.testing.assert_allclose(curves.length, 2 * np.pi * curves.radius)


def test_edge_points_alone_would_place_them_worse(cylinder):
    """The finding that the room is built on: a circle through edge points is wrong by more than one through faces."""
    scene, edges = cylinder
    curves = trace(scene.cloud, edges)
    for k in range(len(curves)):
        own = edges.position[curves.rows_of(k)] - curves.centre[k]
        across = own - (own @ curves.direction[k])[:, None] * curves.direction[k]
        from_points = np.linalg.norm(across, axis=1).std()
        assert curves.radius_std[k] < 0.5 * from_points


def test_no_small_square_is_a_circle():
    scene, edges = sampled(synth.cube_fractal())
    curves = trace(scene.cloud, edges)
    assert not (curves.kind == CurveKind.CIRCLE).any()
    assert (curves.kind == CurveKind.LINE).sum() > 0.9 * len(curves)


def rounded_block(radius, seed=0):
    """A block whose upright edges are rounded, above z = 0, with a spacing of 1."""
    rng = np.random.default_rng(seed)
    inner, height = np.array([15.0, 11.0]) - radius, 12.0
    flat = rng.uniform(-1, 1, (40_000, 2)) * (inner + radius)
    top = np.c_[flat, np.full(len(flat), height)]
    top = top[np.linalg.norm(np.maximum(np.abs(flat) - inner, 0), axis=1) <= radius]
    turn, start = rng.uniform(0, 2 * np.pi, 40_000), rng.uniform(-1, 1, (40_000, 2)) * inner
    ways = np.c_[np.cos(turn), np.sin(turn)]
    axis = rng.integers(2, size=len(start))
    straight = rng.random(len(start)) < inner.sum() / (inner.sum() + 0.5 * np.pi * radius)
    wall = inner * np.sign(ways) + radius * ways
    sides = np.sign(start) * (inner + radius)
    wall[straight] = np.where(np.arange(2) == axis[straight, None], sides[straight], start[straight])
    places = np.concatenate([top, np.c_[wall, rng.uniform(0, height, len(wall))]])
    return places[synth.poisson_disc(places, 0.752)]


@pytest.mark.parametrize("radius", [3.0, 3.5, 4.0])
def test_rounded_corners_are_none(radius):
    """Lines on either side would meet 1.2 spacings and more off the edge, where no edge point is."""
    places = rounded_block(radius)
    curves = trace(places, edgel.detect(places, kinds="crease", min_strength=edgel.curves.FAINT))
    ideal = np.c_[np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * [15.0, 11.0], np.full(4, 12.0)]
    assert (KDTree(ideal).query(curves.vertices)[0] > 0.7).all()
    assert curves.length.sum() > 60


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("radius", [5.0, 7.0])
def test_rounded_corners_are_arcs_that_touch_their_lines(radius, seed):
    """The lines beside them are longer, and would take an arc's points at both of its ends."""
    places = rounded_block(radius, seed)
    curves = trace(places, edgel.detect(places, min_strength=edgel.curves.FAINT))
    arcs = np.flatnonzero(curves.kind == CurveKind.ARC)
    top = arcs[curves.centre[arcs, 2] > 6]
    assert (len(top), len(arcs)) == (4, 8)
    np.testing.assert_allclose(curves.radius[top], radius, atol=0.15)
    np.testing.assert_allclose(np.abs(curves.centre[top, :2]), np.tile([15.0, 11.0], (4, 1)) - radius, atol=0.3)
    np.testing.assert_allclose(curves.length[top], 0.5 * np.pi * radius, atol=0.6)
    assert not (curves.corners[:, 2] > 6).any()
    assert (curves.length_std[top] < 0.6).all()  # where they touch is as sure as the arc


def test_order_of_points_and_threads_do_not_matter(block, monkeypatch):
    scene, edges = block
    before = trace(scene.cloud, edges)
    order = np.random.default_rng(0).permutation(len(scene.cloud))
    shuffled = edgel.Cloud(scene.cloud.xyz[order])
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    rows = np.argsort(place[edges.index])
    monkeypatch.setenv("EDGEL_NUM_THREADS", "3")
    after = trace(shuffled, replace(edges.take(rows), index=np.sort(place[edges.index])))
    assert before.count_kinds() == after.count_kinds()
    first, second = (curves.vertices[np.lexsort(curves.vertices.round(6).T)] for curves in (before, after))
    np.testing.assert_allclose(first, second, atol=1e-6)


def test_far_from_the_origin(block):
    scene, edges = block
    far = np.array([637_000.0, 5_200_000.0, 300.0])
    here = trace(scene.cloud, edges)
    there = trace(scene.cloud.xyz + far, replace(edges, position=edges.position + far))
    np.testing.assert_allclose(there.vertices - far, here.vertices, atol=1e-6)


@pytest.mark.parametrize("unit", [1e-3, 1e4])
def test_the_unit_does_not_matter(block, unit):
    scene, edges = block
    one = trace(scene.cloud, edges)
    other = trace(scene.cloud.xyz * unit, replace(edges, position=edges.position * unit))
    np.testing.assert_allclose(other.vertices / unit, one.vertices, atol=1e-6)
    np.testing.assert_allclose(other.length_std / unit, one.length_std, rtol=1e-6)
    np.testing.assert_allclose(other.angle_std, one.angle_std, rtol=1e-6)


def test_only_points_near_edges_are_looked_at(block):
    """What a tiled result has to keep: edge points, and the cloud within a few spacings of them."""
    scene, edges = block
    whole = trace(scene.cloud, edges)
    xyz = scene.cloud.xyz

    near = np.flatnonzero(KDTree(edges.position).query(xyz)[0] < 10 * scene.spacing)
    assert len(near) < len(xyz)
    number = np.full(len(xyz), -1)
    number[near] = np.arange(len(near))
    kept = replace(edges, index=number[edges.index], num_points=len(near))
    part = trace(xyz[near], kept)
    np.testing.assert_allclose(part.vertices, whole.vertices, atol=1e-9)


def test_boundaries_of_a_sheet_with_a_hole_are_loops():
    x, y = np.meshgrid(np.arange(60.0), np.arange(50.0))
    jitter = np.random.default_rng(1).uniform(-0.3, 0.3, (2, x.size))
    sheet = np.c_[x.ravel() + jitter[0], y.ravel() + jitter[1], 0 * x.ravel()]
    sheet = sheet[np.hypot(sheet[:, 0] - 30, sheet[:, 1] - 25) > 10]
    curves = trace(sheet, edgel.detect(sheet, method="surface", min_strength=edgel.curves.FAINT))
    assert set(curves.edge.tolist()) == {int(EdgeKind.BOUNDARY)}
    assert sorted(curves.is_hole.tolist()) == [False, True]
    hole = np.flatnonzero(curves.loop == int(np.flatnonzero(curves.is_hole)[0]))
    assert curves.length[hole].sum() == pytest.approx(2 * np.pi * 10, rel=0.05)


def no_edges(count):
    nothing = np.empty(0)
    return Edges(
        index=np.empty(0, np.int64), kind=np.empty(0, np.uint8), strength=nothing, position=np.empty((0, 3)),
        position_std=nothing, scale=nothing, direction=np.empty((0, 3)), normals=np.empty((0, 2, 3)), angle=nothing,
        convex=np.empty(0, np.int8), orientation="unknown", num_points=count, num_dropped=0, method="surface",
        reason="", parameters={}, seconds={},
    )  # fmt: skip


def test_no_edges_are_no_curves(block):
    scene, edges = block
    curves = trace(scene.cloud, no_edges(len(scene.cloud)))
    assert len(curves) == 0
    assert curves.vertices.shape == (0, 3)
    few = trace(scene.cloud, edges.take(np.arange(2)))
    assert len(few) == 0


def test_another_cloud_is_refused(block):
    scene, edges = block
    with pytest.raises(ValueError, match="pass the cloud that was given"):
        trace(scene.cloud.xyz[1:], edges)
