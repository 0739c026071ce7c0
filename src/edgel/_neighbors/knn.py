"""Exact nearest neighbours.

Ties of distance go to the smaller coordinates (x, then y, then z), so neighbours do not depend on the order of the
input.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from edgel._kernels.parallel import kernel, part, run_slices
from edgel._kernels.rows import aligned
from edgel._kernels.simd import LANES, as_floats, bits, counted, counts_of, load, store
from edgel._neighbors.candidates import CHUNK, gather_blocks, larger_scratch, make_scratch
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.queries import Queries, TreeArrays, anywhere, every_place, tree_of
from edgel._neighbors.search import first_of, nearest_of_eight
from edgel._neighbors.stretched import list_stretched

_SLICE = 1024  # queries whose neighbours exist at a time, for each thread
_KEPT = 64  # nearest of every point that are kept of a cloud of one slice: most who ask, ask at all points for fewer


@dataclass(frozen=True, eq=False)
class Neighbors:
    """The k nearest points of each query, nearest first.

    Attributes
    ----------
    points : (M, k) int64
        The neighbours.
    distances : (M, k) float64
        Distance to it, in the cloud's unit.
    """

    points: np.ndarray
    distances: np.ndarray


def knn(index: NeighborIndex, queries: np.ndarray | Queries, num_neighbors: int) -> Neighbors:
    """Find the exact k nearest points of each query (a query that is a point of the cloud finds itself first).

    Parameters
    ----------
    index : NeighborIndex
    queries : (M, 3) float64, finite, or Queries
    num_neighbors : int
        k, at least 1 and at most the number of points.

    Examples
    --------
    >>> import numpy as np
    >>> from edgel._neighbors.kdtree import build_index
    >>> cloud = np.random.default_rng(0).random((1000, 3))
    >>> knn(build_index(cloud), cloud[:5], 2).points[:, 0]
    array([0, 1, 2, 3, 4])
    """
    points = np.empty((len(queries), num_neighbors), np.int64)
    distances = np.empty((len(queries), num_neighbors))
    asked = queries if isinstance(queries, Queries) else anywhere(queries)
    visit_neighbors(_store, asked, index, num_neighbors, index.order, points, distances)
    return Neighbors(points, distances)


def visit_neighbors(
    visit: Callable[..., Any], queries: Queries, index: NeighborIndex, num_neighbors: int, *arguments: Any
) -> None:
    """Find the k nearest points of queries and hand them to a kernel, slice by slice.

    Only a slice's neighbours exist at a time, whatever the size of the cloud.

    Parameters
    ----------
    visit : kernel
        Takes ``(first, places, squared, queries.xyz, queries.targets, index.xyz, *arguments)``: the queries from
        `first` on, the (n, k) places of their neighbours, nearest first, and the squared distances to them.
    queries : Queries
    index : NeighborIndex
    num_neighbors : int
        k.

    Raises
    ------
    ValueError
        If the index has fewer points.
    """
    if not 1 <= num_neighbors <= len(index):
        raise ValueError(f"num_neighbors: expected 1 to {len(index)}, the number of points, got {num_neighbors}")
    tree, kept = tree_of(index), _kept_lists(index, queries, num_neighbors)

    def work(start: int, stop: int) -> None:
        if kept:
            places, squared = (array[:, :num_neighbors].take(queries.places, axis=0) for array in kept)
        else:
            places, squared = _lists(start, stop, queries, tree, num_neighbors)
        if queries.are_stretched:
            list_stretched(start, stop, queries.xyz, tree, places, squared)
        visit(start, places, squared, queries.xyz, queries.targets, index.xyz, *arguments)

    run_slices(work, len(queries), size=_SLICE)


def _kept_lists(index: NeighborIndex, queries: Queries, num_neighbors: int) -> list[np.ndarray]:
    """Return the kept lists of a small cloud's points that hold what is asked for, or nothing."""
    most = min(_KEPT, len(index))
    if queries.places is None or len(index) > _SLICE or num_neighbors > most:
        return []
    if not index.lists and len(queries) == len(index):
        index.lists[:] = _lists(0, len(index), every_place(index), tree_of(index), most)
    return index.lists


def _lists(
    start: int, stop: int, queries: Queries, tree: TreeArrays, num_neighbors: int
) -> tuple[np.ndarray, np.ndarray]:
    places = np.zeros((stop - start, num_neighbors), np.int64)  # a place even where no distance is a number
    squared = np.empty((stop - start, num_neighbors))
    _list(start, stop, queries.arrays, tree, places, squared)
    return places, squared


@kernel
def _list(start, stop, queries, tree, places, squared):
    """List the k nearest of the queries start..stop-1, nearest first."""
    scratch, reach, k = make_scratch(), np.inf, places.shape[1]
    length = (k + LANES - 1) // LANES * LANES
    distances, ranks, points = aligned(length + 1), aligned(length), np.empty(length + 1, np.int64)
    for first in range(start, stop, CHUNK):
        last = min(first + CHUNK, stop)
        near, near_reach = gather_blocks(tree, queries, first, last, reach, k, scratch)
        begin = first
        while begin < last:
            size, count, reach = nearest_of_eight(
                tree, queries, first, last, begin, near, near_reach, reach, k, scratch
            )
            if size == 0:
                scratch = larger_scratch(scratch)
            for lane in range(size):
                _take(scratch, count, lane, points, distances)
                q = begin + lane - start
                _rank(tree, points, distances, ranks, places[q], squared[q])
            begin += size


@part
def _take(scratch, count, lane, points, distances):
    """Copy the places and squared distances of a lane's k nearest, in the order of the tree."""
    found, squared, limit, kept = scratch.found, scratch.squared, scratch.limits[lane], 0
    for i in range(count):
        first = LANES * found[i]
        for j in range(LANES):
            d = squared[(i * LANES + j) * LANES + lane]
            points[kept], distances[kept] = first + j, d  # written in any case: no branch to guess
            kept = min(kept + (d <= limit), len(points) - 1)  # k always, were every distance a number


@part
def _rank(tree, points, distances, ranks, places, squared):
    """Sort a list of neighbours by distance, ties by coordinates: the rank of each is how many are nearer."""
    k = len(places)
    for i in range(k, len(ranks)):
        distances[i] = np.inf
    tied = False
    for i in range(0, k, LANES):
        d, nearer, equal = load(distances, i), counts_of(0), counts_of(0)
        for j in range(k):
            nearer = counted(nearer, d > distances[j])
            equal = counted(equal, d == distances[j])
        store(ranks, i, as_floats(nearer))
        tied |= bits((equal > 1) & (d < np.inf)) != 0
    if tied:
        x, y, z, order = tree.x, tree.y, tree.z, tree.order
        for i in range(k):
            slot, d, point = i, distances[i], points[i]
            while slot > 0 and (
                d < squared[slot - 1] or (d == squared[slot - 1] and first_of(x, y, z, order, point, places[slot - 1]))
            ):
                squared[slot], places[slot] = squared[slot - 1], places[slot - 1]
                slot -= 1
            squared[slot], places[slot] = d, point
        return
    for i in range(k):
        slot = min(int(ranks[i]), k - 1)
        squared[slot], places[slot] = distances[i], points[i]


@kernel
def _store(first, places, squared, queries, targets, xyz, order, points, distances):
    for q in range(places.shape[0]):
        for i in range(places.shape[1]):
            points[targets[first + q], i] = order[places[q, i]]
            distances[targets[first + q], i] = np.sqrt(squared[q, i])
