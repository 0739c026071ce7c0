"""Leaves of an octree whose cells lie where the coordinates say: handfuls of points that are near each other.

How a k-d tree cuts a cloud depends on all of its points. Here the cells are those of a grid through the origin, whose
sizes are powers of two: top cells, cut into eight while they hold too many points. So a leaf depends on the points in
its top cell and on nothing else: a part of a cloud has the same leaves as the whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel._neighbors.kdtree import NeighborIndex

MOST, FEWEST = 48, 8  # points of a leaf: a cell with more is cut, what has fewer joins another part of the same cell
LEVELS = 12  # by which cells are cut, at most: points at one place cannot be parted
BITS = 26  # coordinates are told apart to 2**-26 of a top cell


@dataclass(frozen=True, eq=False)
class Octree:
    """The points of an index, leaf by leaf; made by `build_octree`.

    Attributes
    ----------
    places : (N,) int64
        Places in the index, those of one leaf one after the other, in no particular order.
    starts : (L + 1,) int64
        Where each leaf begins in `places`, and their number.
    size : float
        Of the top cells, a power of two.
    """

    places: np.ndarray
    starts: np.ndarray
    size: float

    def leaf_of_places(self) -> np.ndarray:
        """Return the leaf (N,) int32 that each place lies in."""
        leaf = np.empty(len(self.places), np.int32)
        leaf[self.places] = np.repeat(np.arange(len(self.starts) - 1, dtype=np.int32), np.diff(self.starts))
        return leaf


def build_octree(index: NeighborIndex, size: float) -> Octree:
    """Sort the places of an index by the leaves of an octree with top cells of a size, a power of two.

    Leaves come in the order of their top cells, by x, y and z, and of the octants within.
    """
    xyz, count = index.xyz, len(index)
    # Places follow one another in space: what is sorted are the stretches of them that stay within a top cell.
    begins = np.empty(count, np.bool_)
    run_slices(_begin, count, xyz, 1 / size, begins, size=65536)
    runs = np.flatnonzero(begins)
    x, y, z = np.floor(xyz[:, runs] / size)
    order = np.lexsort((z, y, x))
    cells = np.stack([x, y, z])[:, order]
    first = np.flatnonzero(np.concatenate([[True], (np.diff(cells, axis=1) != 0).any(axis=0)]))
    lengths = np.diff(runs, append=count)[order]
    into = np.concatenate([[0], np.cumsum(lengths)])
    places, begins = np.empty(count, np.int64), np.zeros(count, np.bool_)
    arguments = (np.append(first, len(runs)), runs[order], into, xyz, size, places, begins)
    run_slices(_split_cells, len(first), *arguments, size=64)
    return Octree(places, np.append(np.flatnonzero(begins), count), size)


@routine
def step_within(x, size):
    """Return how far in its top cell a coordinate lies, in whole steps of ``2**-BITS`` of the cell's size."""
    cells = x / size
    return min(int((cells - np.floor(cells)) * 2.0**BITS), (1 << BITS) - 1)


@kernel
def _begin(start, stop, xyz, share, begins):
    """Tell the places that lie in another top cell than the one before them."""
    for p in range(start, stop):
        other = p == 0
        for axis in range(3):
            other |= p > 0 and np.floor(xyz[axis, p] * share) != np.floor(xyz[axis, p - 1] * share)
        begins[p] = other


@kernel
def _split_cells(start, stop, first, runs, into, xyz, size, places, begins):
    """Gather the places of each top cell, and sort them by the leaves that it is cut into."""
    for cell in range(start, stop):
        begin, end = into[first[cell]], into[first[cell + 1]]
        for run in range(first[cell], first[cell + 1]):
            for i in range(into[run], into[run + 1]):
                places[i] = runs[run] + i - into[run]
        _split(xyz, size, places[begin:end], begins[begin:end])


@routine
def _split(xyz, size, places, begins):
    """Cut a top cell: nodes that hold too many points are cut in turn, each on a stack of what is left to do."""
    count = len(places)
    if count <= MOST:
        begins[0] = True
        return
    here = np.empty((3, count), np.int32)
    for i in range(count):
        for axis in range(3):
            here[axis, i] = step_within(xyz[axis, places[i]], size)
    there, other, octants = np.empty((3, count), np.int32), np.empty(count, np.int64), np.empty(count, np.int8)
    todo, left = np.empty((8 * LEVELS, 3), np.int64), 1
    todo[0, 0], todo[0, 1], todo[0, 2] = 0, count, 0
    number, to, slots = np.empty(8, np.int64), np.empty(8, np.int64), np.empty(9, np.int64)
    while left > 0:
        left -= 1
        low, high, level = todo[left, 0], todo[left, 1], todo[left, 2]
        number[:] = 0
        shift = BITS - 1 - level
        for i in range(low, high):
            octant = 4 * ((here[0, i] >> shift) & 1) + 2 * ((here[1, i] >> shift) & 1) + ((here[2, i] >> shift) & 1)
            octants[i] = octant
            number[octant] += 1
        _join_few(number, to)
        slots[:] = 0
        for octant in range(8):
            slots[to[octant] + 1] += number[octant]
        for octant in range(8):
            slots[octant + 1] += slots[octant]
        for octant in range(8):
            if slots[octant + 1] == slots[octant]:
                continue
            if number[octant] <= MOST or level + 1 == LEVELS:
                begins[low + slots[octant]] = True
            else:
                todo[left, 0], todo[left, 1], todo[left, 2] = low + slots[octant], low + slots[octant + 1], level + 1
                left += 1
        for i in range(low, high):
            part = to[octants[i]]
            into = low + slots[part]
            slots[part] += 1
            other[into] = places[i]
            for axis in range(3):
                there[axis, into] = here[axis, i]
        for i in range(low, high):
            places[i] = other[i]
            for axis in range(3):
                here[axis, i] = there[axis, i]


@routine
def _join_few(number, to):
    """Say with which octant (8,) the points of each go: with fewer than `FEWEST`, with the largest that is not cut."""
    largest = -1
    for octant in range(8):
        to[octant] = octant
        if number[octant] <= MOST and (largest < 0 or number[octant] > number[largest]):
            largest = octant
    for octant in range(8):
        if 0 < number[octant] < FEWEST and largest >= 0:
            to[octant] = largest
