"""Exact nearest neighbours.

Queries are answered in chunks of points that lie together, which share the walk through the tree. Ties of distance go
to the smaller coordinates (x, then y, then z), so neighbours do not depend on the order of the input.
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
    rows = np.empty((len(queries), num_neighbors), np.int64)
    distances = np.empty((len(queries), num_neighbors))
    visit_neighbors(_store, build_index(queries), index, num_neighbors, index.order, rows, distances)
    return Neighbors(rows, distances)


def visit_neighbors(
    visit: Callable[..., Any], queries: NeighborIndex, index: NeighborIndex, num_neighbors: int, *arguments: Any
) -> None:
    """Find the k nearest points of sorted queries and hand them to a kernel, slice by slice.

    Only a slice's neighbours exist at a time, whatever the size of the cloud.

    Parameters
    ----------
    visit : kernel
        Takes ``(first, places, squared, queries.xyz, queries.order, index.xyz, *arguments)``: the sorted queries from
        `first` on, the (n, k) sorted places of their neighbours, nearest first, and the squared distances to them.
    queries : NeighborIndex
        Made by `build_index`; may be the index itself.
    index : NeighborIndex
    num_neighbors : int
        k.
    """
    leaves = len(queries.boxes) // 2

    def work(start: int, stop: int) -> None:
        first, last = node_start(start, len(queries), leaves), node_start(stop, len(queries), leaves)
        places = np.empty((last - first, num_neighbors), np.int64)
        squared = np.empty((last - first, num_neighbors))
        _knn(start, stop, leaves, queries.xyz, index.xyz, index.order, index.boxes, places, squared)
        visit(first, places, squared, queries.xyz, queries.order, index.xyz, *arguments)

    run_slices(work, leaves, size=256)


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
def _scan_leaf(xyz, order, first, count, x, y, z, best, places, distances):
    """Offer the points of a leaf to a query's list of the k best, which stays sorted."""
    px, py, pz = xyz[0], xyz[1], xyz[2]
    for i in range(count):
        dx, dy, dz = px[first + i] - x, py[first + i] - y, pz[first + i] - z
        distances[i] = dx * dx + dy * dy + dz * dz
    k = len(best)
    worst = best[k - 1]
    for i in range(count):
        d = distances[i]
        if d <= worst:
            place, slot = first + i, k
            while slot > 0 and (
                d < best[slot - 1]
                or (d == best[slot - 1] and (places[slot - 1] < 0 or _first_of(xyz, order, place, places[slot - 1])))
            ):
                slot -= 1
                if slot < k - 1:
                    best[slot + 1], places[slot + 1] = best[slot], places[slot]
            if slot < k:
                best[slot], places[slot] = d, place
                worst = best[k - 1]
    return worst


@kernel
def _knn_chunk(queries, first, count, xyz, order, boxes, best, places, stack, reaches, distances):
    """Find the k nearest of `count` queries from `first` on, which lie together, in one walk through the tree.

    `stack` (64,), `reaches` (64,) and `distances` (BUCKET,) are room to work in.
    """
    low_x, low_y, low_z = np.inf, np.inf, np.inf
    high_x, high_y, high_z = -np.inf, -np.inf, -np.inf
    for q in range(first, first + count):
        low_x, high_x = min(low_x, queries[0, q]), max(high_x, queries[0, q])
        low_y, high_y = min(low_y, queries[1, q]), max(high_y, queries[1, q])
        low_z, high_z = min(low_z, queries[2, q]), max(high_z, queries[2, q])
    k, num_points, leaves = best.shape[1], xyz.shape[1], boxes.shape[0] // 2
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
                worst = _scan_leaf(xyz, order, start, size, x, y, z, best[q], places[q], distances)
            reach = max(reach, worst)


@kernel
def _knn(start, stop, leaves, queries, xyz, order, boxes, places, squared):
    """Find the k nearest of the queries in leaves start..stop-1 of their own tree."""
    places[:] = -1
    squared[:] = np.inf
    stack, reaches, distances = np.empty(64, np.int64), np.empty(64), np.empty(BUCKET)
    base = node_start(start, queries.shape[1], leaves)
    for leaf in range(start, stop):
        first = node_start(leaf, queries.shape[1], leaves)
        last = node_start(leaf + 1, queries.shape[1], leaves)
        own = slice(first - base, last - base)
        _knn_chunk(
            queries, first, last - first, xyz, order, boxes, squared[own], places[own], stack, reaches, distances
        )


@kernel
def _store(first, places, squared, queries, query_order, xyz, order, rows, distances):
    for q in range(places.shape[0]):
        for i in range(places.shape[1]):
            rows[query_order[first + q], i] = order[places[q, i]]
            distances[query_order[first + q], i] = np.sqrt(squared[q, i])
