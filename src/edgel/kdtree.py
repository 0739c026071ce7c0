"""A balanced k-d tree laid out in place: the order of points in which neighbour queries are fast.

Halving the widest axis at the median follows any density (a scan, a LiDAR sweep) and needs no cell size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel.parallel import kernel, run_slices

BUCKET = 16  # most points a leaf holds
_SHARED_LEVELS = 5  # levels split one after the other; below them each subtree fits a core's own cache


@dataclass(frozen=True, eq=False)
class NeighborIndex:
    """A cloud sorted for neighbour queries; made by `build_index`.

    Attributes
    ----------
    order : (N,) int64
        Row of the input of each sorted point.
    xyz : (3, N) float64, C-contiguous
        Sorted coordinates, one axis a row so that distances are computed by SIMD.
    boxes : (2 L, 6) float64
        Lower and upper corner of each node: node 1 is the root, node i has children 2 i and 2 i + 1, leaves begin at
        L; leaf i holds the sorted points from ``i N // L`` to ``(i + 1) N // L``.
    """

    order: np.ndarray
    xyz: np.ndarray
    boxes: np.ndarray

    def __len__(self) -> int:
        return len(self.order)


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
    (1000, (128, 6))
    """
    count = len(xyz)
    by_axis = np.empty((3, count))
    order = np.empty(count, np.int64)
    run_slices(_load, count, xyz, by_axis, order, size=65536)
    depth = max(-(-count // BUCKET) - 1, 0).bit_length()
    boxes = np.empty((2 << depth, 6))
    shared = min(depth, _SHARED_LEVELS)
    for level in range(shared):
        run_slices(_split_level, 1 << level, level, by_axis, order, size=1)
    run_slices(_split_subtrees, 1 << shared, shared, depth, by_axis, order, boxes, size=1)
    _inner_boxes(1 << depth, boxes)
    return NeighborIndex(order, by_axis, boxes)


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
def node_start(place, count, nodes):
    """First sorted point of a node: its place in its level, and how many nodes the level has."""
    return place * count // nodes


@kernel
def _select(key, second, third, order, low, high, middle):
    """Reorder places low..high of four arrays so that the keys before `middle` are the smallest (Floyd & Rivest 1975).

    Their sampling step makes it 5 times as fast here as quickselect with a median of three.
    """
    while high > low:
        if high - low > 600:
            count, rank = high - low + 1, middle - low + 1
            z = math.log(count)
            sample = 0.5 * math.exp(2.0 * z / 3.0)
            spread = 0.5 * math.sqrt(z * sample * (count - sample) / count) * (1.0 if 2 * rank > count else -1.0)
            sample_low = max(low, int(middle - rank * sample / count + spread))
            sample_high = min(high, int(middle + (count - rank) * sample / count + spread))
            _select(key, second, third, order, sample_low, sample_high, middle)
        pivot, i, j = key[middle], low, high
        while i <= j:
            while key[i] < pivot:
                i += 1
            while key[j] > pivot:
                j -= 1
            if i <= j:
                key[i], key[j] = key[j], key[i]
                second[i], second[j] = second[j], second[i]
                third[i], third[j] = third[j], third[i]
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@kernel
def _box(xyz, first, last, box):
    """Lower and upper corner of the sorted points first..last-1."""
    for axis in range(3):
        coordinate = xyz[axis]
        low, high = np.inf, -np.inf
        for p in range(first, last):
            low, high = min(low, coordinate[p]), max(high, coordinate[p])
        box[axis], box[3 + axis] = low, high


@kernel
def _split_node(place, level, xyz, order, box):
    """Halve a node at the median of its widest axis."""
    count, nodes = xyz.shape[1], 1 << level
    first, last = node_start(place, count, nodes), node_start(place + 1, count, nodes)
    _box(xyz, first, last, box)
    axis = 0
    for a in range(1, 3):
        if box[3 + a] - box[a] > box[3 + axis] - box[axis]:
            axis = a
    middle = node_start(2 * place + 1, count, 2 * nodes)
    _select(xyz[axis], xyz[(axis + 1) % 3], xyz[(axis + 2) % 3], order, first, last - 1, middle)


@kernel
def _split_level(start, stop, level, xyz, order):
    box = np.empty(6)
    for place in range(start, stop):
        _split_node(place, level, xyz, order, box)


@kernel
def _split_subtrees(start, stop, top, depth, xyz, order, boxes):
    box = np.empty(6)
    for level in range(top, depth):
        for place in range(start << (level - top), stop << (level - top)):
            _split_node(place, level, xyz, order, box)
    leaves = 1 << depth
    for leaf in range(start << (depth - top), stop << (depth - top)):
        first, last = node_start(leaf, xyz.shape[1], leaves), node_start(leaf + 1, xyz.shape[1], leaves)
        _box(xyz, first, last, boxes[leaves + leaf])


@kernel
def _inner_boxes(leaves, boxes):
    for node in range(leaves - 1, 0, -1):
        for axis in range(3):
            boxes[node, axis] = min(boxes[2 * node, axis], boxes[2 * node + 1, axis])
            boxes[node, 3 + axis] = max(boxes[2 * node, 3 + axis], boxes[2 * node + 1, 3 + axis])
