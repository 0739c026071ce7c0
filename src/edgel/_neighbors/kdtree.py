"""A balanced k-d tree laid out in place: the order of points in which neighbour queries are fast.

Three index spaces, here and everywhere: a **row** is a row of the user's input, a **point** a row among its finite
points (`edgel.cloud.Points` maps points to rows), and a **place** a position in the order of a tree
(`NeighborIndex.order` maps places to points).

Halving the widest axis at the median follows any density (a scan, a LiDAR sweep) and needs no cell size. Ties at a
median go by the other axes, then by the row, and leaves are sorted: where points lie depends on the points alone, not
on their order, and those at one place follow one another by their rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel._kernels.simd import LANES, larger, largest_of, load, smaller, smallest_of, spread
from edgel._neighbors.selection import sort_leaf, sort_places, value_at

BUCKET = 32  # most points a leaf holds
_SHARED_LEVELS = 5  # levels split one after the other; below them each subtree fits a core's own cache


@dataclass(frozen=True, eq=False)
class NeighborIndex:
    """A cloud sorted for neighbour queries; made by `build_index`.

    Attributes
    ----------
    order : (N,) int64
        The point at each place.
    xyz : (3, N) float64, C-contiguous
        Coordinates by place, one axis a row so that distances are computed by SIMD.
    boxes : (2 L, 6) float64
        Lower and upper corner of each node: node 1 is the root, node i has children 2 i and 2 i + 1, leaves begin at
        L; the places of leaf i begin at ``node_start(i, N, L)``.
    blocks : (6, ceil(N / 8)) float64
        Lower and upper corner of every eight consecutive places, whose cell they fill: leaves are sorted along
        their widest axis.
    """

    order: np.ndarray
    xyz: np.ndarray
    boxes: np.ndarray
    blocks: np.ndarray

    def __len__(self) -> int:
        return len(self.order)

    @cached_property
    def lists(self) -> list[np.ndarray]:
        """What `edgel._neighbors.knn` keeps of a small cloud: places and squared distances of the nearest of all."""
        return []

    def at(self, places: np.ndarray) -> np.ndarray:
        """Return the coordinates at some places (M,), (M, 3) float64."""
        return np.ascontiguousarray(self.xyz[:, places].T)

    def places_of(self, points: np.ndarray) -> np.ndarray:
        """Return the places (M,) of some points (M,)."""
        place = np.empty(len(self), np.int64)
        place[self.order] = np.arange(len(self))
        return place[points]

    def by_point(self) -> np.ndarray:
        """Return the coordinates of all points, (N, 3) float64."""
        xyz = np.empty((len(self), 3))
        xyz[self.order] = self.xyz.T
        return xyz

    def sampled(self, number: int, total: int | None = None) -> np.ndarray:
        """Return about `number` places, ascending, by a hash of the coordinates and nothing else.

        `total` is the number of points of the cloud that these are a part of, by default their own.
        """
        return np.flatnonzero(chosen(self.xyz, number, len(self) if total is None else total))

    def evenly_sampled(self, number: int) -> np.ndarray:
        """Return about `number` places, evenly sampled over the tree, whatever the order of the input."""
        return np.arange(0, len(self), max(len(self) // number, 1))


def build_index(xyz: np.ndarray) -> NeighborIndex:
    """Sort points for neighbour queries.

    Parameters
    ----------
    xyz : (N, 3) float64, finite, N > 0

    Returns
    -------
    NeighborIndex

    Examples
    --------
    >>> import numpy as np
    >>> index = build_index(np.random.default_rng(0).random((1000, 3)))
    >>> len(index), index.boxes.shape
    (1000, (64, 6))
    """
    count = len(xyz)
    depth = max(-(-count // BUCKET) - 1, 0).bit_length()
    # Each level is split from one pair of arrays into the other, and then the leaves sorted into the other once more.
    here, there = [(_axes(count), np.empty(count, np.int64)) for _ in range(2)]
    run_slices(_load, count, xyz, *here, size=65536)
    boxes, blocks = np.empty((2 << depth, 6)), np.empty((6, -(-count // LANES)))
    shared = min(depth, _SHARED_LEVELS)
    for level in range(shared):
        run_slices(_split_level, 1 << level, level, *here, *there, size=1)
        here, there = there, here
    run_slices(_split_subtrees, 1 << shared, shared, depth, *here, *there, boxes, blocks, size=1)
    here, there = (there, here) if (depth - shared) % 2 == 0 else (here, there)
    boxes[0] = 0.0
    _inner_boxes(1 << depth, boxes)
    return NeighborIndex(here[1], here[0], boxes, blocks)


def chosen(xyz: np.ndarray, number: int, total: int) -> np.ndarray:
    """Choose about `number` of `total` points, of which these are (3, N) float64, by a hash of the coordinates alone.

    Returns (N,) bool; all where there are no more. A smaller number chooses some of the same.
    """
    some = np.ones(xyz.shape[1], np.bool_)
    if total > number:
        run_slices(_choose, len(some), xyz.view(np.uint64), np.uint64(2**64 * number // total), some, size=65536)
    return some


@kernel
def _choose(start, stop, bits, below, chosen):
    """Choose the points whose coordinates' bits come out low once mixed (splitmix64, doi:10.1145/2660193.2660195)."""
    for p in range(start, stop):
        mixed = np.uint64(0)
        for axis in range(3):
            mixed = (mixed ^ bits[axis, p]) + np.uint64(0x9E3779B97F4A7C15)
            mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            mixed ^= mixed >> np.uint64(31)
        chosen[p] = mixed < below


def _axes(count: int) -> np.ndarray:
    """Make an array for (3, N) coordinates, and some behind them: the last eight may be read as if they were whole."""
    return np.zeros(3 * count + LANES)[: 3 * count].reshape(3, count)


def bounds(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and the upper corner (3,) of the bounding box of (N, 3) float64 points, N > 0."""
    size = 65536
    parts = np.empty((-(-len(xyz) // size), 2, 3))
    run_slices(_bounds, len(xyz), xyz, size, parts, size=size)
    return parts[:, 0].min(axis=0), parts[:, 1].max(axis=0)


@kernel
def _bounds(start, stop, xyz, size, parts):
    low_x, low_y, low_z = np.inf, np.inf, np.inf
    high_x, high_y, high_z = -np.inf, -np.inf, -np.inf
    for p in range(start, stop):
        low_x, high_x = min(low_x, xyz[p, 0]), max(high_x, xyz[p, 0])
        low_y, high_y = min(low_y, xyz[p, 1]), max(high_y, xyz[p, 1])
        low_z, high_z = min(low_z, xyz[p, 2]), max(high_z, xyz[p, 2])
    part = parts[start // size]
    part[0, 0], part[0, 1], part[0, 2] = low_x, low_y, low_z
    part[1, 0], part[1, 1], part[1, 2] = high_x, high_y, high_z


@kernel
def _load(start, stop, xyz, by_axis, order):
    for p in range(start, stop):
        order[p] = p
        for axis in range(3):
            by_axis[axis, p] = xyz[p, axis]


@kernel
def node_start(number, count, nodes):
    """First place of a node: the `number` of the node in its level, and how many nodes the level has.

    Nodes begin at multiples of eight, so that eight points in step share a leaf.
    """
    return min(number * ((count + LANES - 1) // LANES) // nodes * LANES, count)


@routine
def _extent(values, first, last):
    """Smallest and largest of values[first:last]."""
    low, high = spread(np.inf), spread(-np.inf)
    whole = first + (last - first) // LANES * LANES
    for p in range(first, whole, LANES):
        v = load(values, p)
        low, high = smaller(low, v), larger(high, v)
    least, most = smallest_of(low), largest_of(high)
    for p in range(whole, last):
        least, most = min(least, values[p]), max(most, values[p])
    return least, most


@routine
def _box(xyz, first, last, box):
    """Lower and upper corner of the places first..last-1; returns the widest axis."""
    widest = 0
    for axis in range(3):
        box[axis], box[3 + axis] = _extent(xyz[axis], first, last)
        if box[3 + axis] - box[axis] > box[3 + widest] - box[widest]:
            widest = axis
    return widest


@routine
def _split_node(node, level, xyz, order, to_xyz, to_order, scratch, box):
    """Halve a node at the median of its widest axis, from one pair of arrays into the other."""
    count, nodes = xyz.shape[1], 1 << level
    first, last = node_start(node, count, nodes), node_start(node + 1, count, nodes)
    middle = node_start(2 * node + 1, count, 2 * nodes)
    axis = _box(xyz, first, last, box)
    key, second, third = xyz[axis], xyz[(axis + 1) % 3], xyz[(axis + 2) % 3]
    to_key, to_second, to_third = to_xyz[axis], to_xyz[(axis + 1) % 3], to_xyz[(axis + 2) % 3]
    pivot = value_at(middle - first, key, first, last - first, scratch)
    left, right = first, last - 1
    for p in range(first, last):
        below = key[p] < pivot
        to = left if below else right
        to_key[to], to_second[to], to_third[to], to_order[to] = key[p], second[p], third[p], order[p]
        left += below
        right -= not below
    if left < middle:  # some that equal the median belong to the left
        tied = left
        for p in range(left, last):
            if to_key[p] == pivot:
                to_key[p], to_key[tied] = to_key[tied], to_key[p]
                to_second[p], to_second[tied] = to_second[tied], to_second[p]
                to_third[p], to_third[tied] = to_third[tied], to_third[p]
                to_order[p], to_order[tied] = to_order[tied], to_order[p]
                tied += 1
        sort_places(to_key, to_second, to_third, to_order, left, tied)


@routine
def _make_scratch(node, count, nodes):
    """Make a scratch buffer for the keys of a node, and some more to fill up eights."""
    return np.empty(node_start(node + 1, count, nodes) - node_start(node, count, nodes) + LANES + BUCKET)


@kernel
def _split_level(start, stop, level, xyz, order, to_xyz, to_order):
    box = np.empty(6)
    for node in range(start, stop):
        scratch = _make_scratch(node, xyz.shape[1], 1 << level)
        _split_node(node, level, xyz, order, to_xyz, to_order, scratch, box)


@kernel
def _split_subtrees(start, stop, top, depth, xyz, order, other_xyz, other_order, boxes, blocks):
    for subtree in range(start, stop):
        scratch, box = _make_scratch(subtree, xyz.shape[1], 1 << top), np.empty(6)
        here, rows, there, other_rows = xyz, order, other_xyz, other_order
        for level in range(top, depth):
            for node in range(subtree << (level - top), (subtree + 1) << (level - top)):
                _split_node(node, level, here, rows, there, other_rows, scratch, box)
            here, rows, there, other_rows = there, other_rows, here, rows
        leaves = 1 << depth
        for leaf in range(subtree << (depth - top), (subtree + 1) << (depth - top)):
            first, last = node_start(leaf, xyz.shape[1], leaves), node_start(leaf + 1, xyz.shape[1], leaves)
            axis = _box(here, first, last, boxes[leaves + leaf])
            sort_leaf(axis, here, rows, there, other_rows, first, last, scratch)
            for p in range(first, last, LANES):
                for axis in range(3):
                    low, high = _extent(there[axis], p, min(p + LANES, last))
                    blocks[axis, p // LANES], blocks[3 + axis, p // LANES] = low, high


@kernel
def _inner_boxes(leaves, boxes):
    for node in range(leaves - 1, 0, -1):
        for axis in range(3):
            boxes[node, axis] = min(boxes[2 * node, axis], boxes[2 * node + 1, axis])
            boxes[node, 3 + axis] = max(boxes[2 * node, 3 + axis], boxes[2 * node + 1, 3 + axis])
