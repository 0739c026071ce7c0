"""Edge points that scatter about a line which no faces confirm."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from edgel.curves import CurveKind, trace
from edgel.edges import EdgeKind, Edges


def edges_at(points, place, across):
    """Ends of a surface, of which nothing is known but where they are."""
    count = len(points)
    unknown = np.full(count, np.nan)
    return Edges(
        index=points, kind=np.full(count, EdgeKind.BOUNDARY, np.uint8), strength=np.full(count, 0.9),
        position=place[points], position_std=np.full(count, across), scale=np.ones(count),
        direction=np.full((count, 3), np.nan), normals=np.full((count, 2, 3), np.nan), angle=unknown,
        convex=np.zeros(count, np.int8), orientation="unknown", num_points=len(place), num_dropped=0, method="surface",
        reason="", parameters={}, seconds={},
    )  # fmt: skip


def scattered(across, seed):
    """An L of edge points, 30 and 20 spacings long, that scatter across it, in a cloud that has no faces."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(0, 50, 75)
    place = np.zeros((75, 3))
    place[:, 0], place[:, 1] = np.minimum(along, 30), np.maximum(along - 30, 0)
    first = along < 30
    place[first, 1] += rng.normal(0, across, first.sum())
    place[~first, 0] += rng.normal(0, across, (~first).sum())
    cloud = np.concatenate([place, rng.uniform((-5, -5, -2), (35, 25, 2), (4000, 3))])
    return cloud, edges_at(np.arange(75), cloud, across)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_scattered_points_along_two_sides_are_lines_along_them(seed):
    curves = trace(*scattered(0.25, seed))
    lines = np.flatnonzero((curves.kind == CurveKind.LINE) & (curves.length > 6))
    assert len(lines)
    assert not curves.measured[lines].any()
    alike = np.abs(curves.direction[lines][:, :2]).max(axis=1)
    assert (alike > np.cos(np.radians(6))).all()
    ends = [curves.points_of(k) for k in lines.tolist()]
    there = np.concatenate([np.linspace(each[0], each[-1], 200) for each in ends])
    true = np.concatenate([np.linspace((0, 0, 0), (30, 0, 0), 120), np.linspace((30, 0, 0), (30, 20, 0), 80)])
    assert (KDTree(there).query(true)[0] < 0.75).mean() > 0.5
    assert np.median(KDTree(true).query(there)[0]) < 0.25


@pytest.mark.parametrize("seed", range(4))
def test_a_line_runs_along_the_outermost_points_where_these_lie_in_a_row(seed):
    """Of a scan in rows, edge points are those of the last three rows as it comes."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(15.0), np.arange(0.0, 9.0, 0.6))
    cloud = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) + 0.03 * rng.standard_normal((x.size, 3))
    edges = edges_at(np.flatnonzero((cloud[:, 1] < 1.5) & (rng.random(len(cloud)) < 0.6)), cloud, 0.3)
    curves = trace(cloud, edges)
    long = (curves.kind == CurveKind.LINE) & (curves.length > 8)
    assert long.any()
    assert (np.abs(curves.direction[long, 1]) < np.sin(np.radians(0.5))).all()
