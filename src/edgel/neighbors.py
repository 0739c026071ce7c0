"""Exact nearest neighbours.

Queries are answered in chunks of points that lie together, which share the walk through the tree. Ties of distance go to
the smaller coordinates (x, then y, then z), so neighbours do not depend on the order of the input.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from edgel.kdtree import BUCKET, NeighborIndex, build_index, node_start
from edgel.parallel import kernel, run_slices


@dataclass(frozen=True, eq=False)
class Neighbors:
    """The k nearest points of each query, nearest first.

    Attributes
    ----------
    rows : (M, k) int64
        Row of the input of each neighbour.
    distances : (M, k) float64
        Distance to it, in the cloud's unit.
    """

    rows: np.ndarray
    distances: np.ndarray


def knn(index: NeighborIndex, queries: np.ndarray, num_neighbors: int) -> Neighbors:
    """Find the exact k nearest points of each query (a query that is a point of the cloud finds itself first).

    Parameters
    ----------
    index : NeighborIndex
    queries : (M, 3) float64, finite
    num_neighbors : int
        k, at least 1 and at most the number of points.

    Examples
    --------
    >>> import numpy as np
    >>> cloud = np.random.default_rng(0).random((1000, 3))
    >>> knn(build_index(cloud), cloud[:5], 2).rows[:, 0]
    array([0, 1, 2, 3, 4])
    """
    sorted_queries = build_index(queries)
    rows = np.empty((len(queries), num_neighbors), np.int64)
    distances = np.empty((len(queries), num_neighbors))
    run_chunks(_knn, sorted_queries, index, rows, distances)
    return Neighbors(rows, distances)


def run_chunks(compiled: Callable[..., Any], queries: NeighborIndex, index: NeighborIndex, *arguments: Any) -> None:
    """Run a kernel over chunks of queries, which are themselves sorted as an index is.

    The kernel takes ``(start, stop, leaves, queries.xyz, queries.order, index.xyz, index.order, index.boxes,
    *arguments)``, start and stop counting leaves of the queries.
    """
    leaves = len(queries.boxes) // 2
    run_slices(
        compiled, leaves, leaves, queries.xyz, queries.order, index.xyz, index.order, index.boxes, *arguments, size=64
    )


@kernel
def _box_distance(boxes, node, low_x, low_y, low_z, high_x, high_y, high_z):
    """Squared distance between a node's box and another box."""
    dx = max(boxes[node, 0] - high_x, low_x - boxes[node, 3], 0.0)
    dy = max(boxes[node, 1] - high_y, low_y - boxes[node, 4], 0.0)
    dz = max(boxes[node, 2] - high_z, low_z - boxes[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@kernel
def _first_of(xyz, order, a, b):
    """Whether sorted point a comes before b by x, y, z; duplicates by their row in the input."""
    for axis in range(3):
        if xyz[axis, a] != xyz[axis, b]:
            return xyz[axis, a] < xyz[axis, b]
    return order[a] < order[b]


@kernel
def _scan_leaf(xyz, order, first, count, x, y, z, k, best, rows, distances):
    """Offer the points of a leaf to a query's list of the k best, which stays sorted."""
    px, py, pz = xyz[0], xyz[1], xyz[2]
    for i in range(count):
        dx, dy, dz = px[first + i] - x, py[first + i] - y, pz[first + i] - z
        distances[i] = dx * dx + dy * dy + dz * dz
    worst = best[k - 1]
    for i in range(count):
        d = distances[i]
        if d <= worst:
            row, slot = first + i, k
            while slot > 0 and (
                d < best[slot - 1]
                or (d == best[slot - 1] and (rows[slot - 1] < 0 or _first_of(xyz, order, row, rows[slot - 1])))
            ):
                slot -= 1
                if slot < k - 1:
                    best[slot + 1], rows[slot + 1] = best[slot], rows[slot]
            if slot < k:
                best[slot], rows[slot] = d, row
                worst = best[k - 1]
    return worst


@kernel
def knn_chunk(queries, first, count, xyz, order, boxes, k, best, rows, stack, reaches, distances):
    """Find the k nearest of `count` queries from `first` on: squared distances in best, sorted places in rows.

    `stack` (64,), `reaches` (64,) and `distances` (BUCKET,) are room to work in, made once a slice by the caller.
    """
    low_x, low_y, low_z = np.inf, np.inf, np.inf
    high_x, high_y, high_z = -np.inf, -np.inf, -np.inf
    for q in range(first, first + count):
        low_x, high_x = min(low_x, queries[0, q]), max(high_x, queries[0, q])
        low_y, high_y = min(low_y, queries[1, q]), max(high_y, queries[1, q])
        low_z, high_z = min(low_z, queries[2, q]), max(high_z, queries[2, q])
    best[:] = np.inf
    rows[:] = -1
    num_points, leaves = xyz.shape[1], boxes.shape[0] // 2
    reach, depth = np.inf, 1
    stack[0], reaches[0] = 1, 0.0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if reaches[depth] > reach:
            continue
        if node < leaves:
            near, far = 2 * node, 2 * node + 1
            near_d = _box_distance(boxes, near, low_x, low_y, low_z, high_x, high_y, high_z)
            far_d = _box_distance(boxes, far, low_x, low_y, low_z, high_x, high_y, high_z)
            if far_d < near_d:
                near, far, near_d, far_d = far, near, far_d, near_d
            # The nearer child lies on top: its points shorten the reach before the other is looked at.
            stack[depth], reaches[depth] = far, far_d
            stack[depth + 1], reaches[depth + 1] = near, near_d
            depth += 2
            continue
        start = node_start(node - leaves, num_points, leaves)
        size = node_start(node - leaves + 1, num_points, leaves) - start
        reach = 0.0
        for q in range(count):
            x, y, z = queries[0, first + q], queries[1, first + q], queries[2, first + q]
            worst = best[q, k - 1]
            if _box_distance(boxes, node, x, y, z, x, y, z) <= worst:
                worst = _scan_leaf(xyz, order, start, size, x, y, z, k, best[q], rows[q], distances)
            reach = max(reach, worst)


@kernel
def _knn(start, stop, leaves, queries, query_order, xyz, order, boxes, out_rows, out_distances):
    k = out_rows.shape[1]
    best, rows = np.empty((BUCKET, k)), np.empty((BUCKET, k), np.int64)
    stack, reaches, distances = np.empty(64, np.int64), np.empty(64), np.empty(BUCKET)
    for leaf in range(start, stop):
        first = node_start(leaf, queries.shape[1], leaves)
        count = node_start(leaf + 1, queries.shape[1], leaves) - first
        knn_chunk(queries, first, count, xyz, order, boxes, k, best, rows, stack, reaches, distances)
        for q in range(count):
            for i in range(k):
                out_rows[query_order[first + q], i] = order[rows[q, i]]
                out_distances[query_order[first + q], i] = np.sqrt(best[q, i])
