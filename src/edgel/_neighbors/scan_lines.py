"""Scan lines: where points lie far closer along lines than these lie apart, and how far to stretch what is along them.

The nearest of a point on a scanner's line, or on a ring of a spinning one, lie on its own line and know nothing of the
surface across it. Stretched along the line as `edgel._neighbors.stretched` does, they lie all round it.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.eigen import smallest_eigenpair
from edgel._kernels.moments import add_moments
from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.neighborhood import relative
from edgel._neighbors.queries import Queries, at_places, every_place

STRAIGHT = ((8, 0.2), (16, 0.35))
"""Neighbours of a point, and how far across their main direction, over along it, they spread at most on a line."""
AROUND = 24  # neighbours among which the straightest stretch of line is looked for
AREA = 64  # neighbours whose disc tells how much area a point stands for: lines apart by half their number it misses
LEAST, MOST = 2.5, 32.0  # distance of lines over that of the points on them
FULL = 0.5
ABREAST = 24  # neighbours, stretched by the most, among which the lines on either side are looked for
_OPPOSITE = -0.93  # cosine between the ways to them, at most
_OWN = (1.5, 3.0)  # distances of points, and deviations from the line, within which a point is on it
_ON_LINES = 1 / 12  # share of the neighbours that have to lie on lines: chance seldom does that
_CLOUD = 0.5  # share of a cloud's points that have to, or it has no lines
SAMPLE = 4_000  # points that tell whether it has
_EVEN = 0.2  # of the most spread there may be on a line: below it one stretch is as straight as the other
_U, _SPREAD, _RATIO, _OFF, _APART, _REACH, _ACROSS, _LINE = 0, 3, 4, 5, 6, 7, 8, 11
"""Columns of a line: direction, spread over its most, distance of lines over that of points, deviation from it, their
distance, how far away anything matters, and the way from the line on one side to that on the other, or 0."""


def scan_line_stretch(index: NeighborIndex) -> np.ndarray | None:
    """Return what `stretch_along_lines` does; None where the cloud has no lines."""
    has_lines = len(index) >= AREA and are_lines(on_lines(index, index.sampled(SAMPLE)))
    return stretch_along_lines(index) if has_lines else None


def stretch_along_lines(index: NeighborIndex) -> np.ndarray:
    """Return the stretch (3, N) float64 at each place of a cloud that has lines, 0 where points lie on none.

    Stretched, points of a line lie as far apart as the lines. A point takes the direction of the straightest stretch
    of line near it: where a line turns round a crease it is that of one face.
    """
    return _chosen(index, np.empty(0))


def scan_line_normals(index: NeighborIndex, places: np.ndarray) -> np.ndarray:
    """Return the normals (M, 3) of the surface through the lines at some places (M,), ascending, and those beside them.

    NaN where no straight line or none on one side is known. Of a plate thinner than the distance of the lines no plane
    fit knows them, since the nearest lines are those of its other side.
    """
    lines = _lines(index, places)
    normals = np.cross(lines[:, :_SPREAD], lines[:, _ACROSS:])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    length[lines[:, _SPREAD] >= 1.0] = 0.0
    return normals / np.where(length > 0.0, length, np.nan)


def stretch_reach(index: NeighborIndex) -> np.ndarray:
    """Bound how far from each place its stretch depends on other points, (N,) float64, given that the cloud has lines.

    Infinite where there are too few points for any.
    """
    reach = np.full(len(index), np.inf)
    _chosen(index, reach)
    return reach


def _chosen(index: NeighborIndex, reach: np.ndarray) -> np.ndarray:
    """Choose the line of each place; returns the stretch (3, N), and writes the reach unless that is empty."""
    stretch = np.zeros((3, len(index)))
    if len(index) >= AREA:
        lines = _lines(index, np.arange(len(index)))
        visit_neighbors(_choose, every_place(index), index, AROUND, lines, stretch, reach)
    return stretch


def are_lines(on: np.ndarray) -> bool:
    """Whether a cloud has lines of which so many of the sampled places lie on one, in any order."""
    return bool(np.mean(on) >= _CLOUD)


def on_lines(index: NeighborIndex, places: np.ndarray) -> np.ndarray:
    """Return whether some places (M,), ascending, lie on straight lines, (M,) bool."""
    return _lines(index, places)[:, _SPREAD] < 1.0


def _lines(index: NeighborIndex, places: np.ndarray) -> np.ndarray:
    """Fit a line at some places (M,), ascending: (M, 11) float64."""
    lines = np.empty((len(places), _LINE))
    visit_neighbors(_fit_lines, at_places(index, places), index, AREA, np.array(STRAIGHT), lines)
    on = np.flatnonzero(lines[:, _SPREAD] < 1.0)
    if len(on):
        away = np.concatenate([index.xyz.take(places[on], axis=1), (MOST - 1.0) * lines[on, :_SPREAD].T])
        visit_neighbors(_look_abreast, Queries(away, on), index, min(ABREAST, len(index)), lines)
    return lines


@kernel
def _fit_lines(first, places, squared, queries, targets, xyz, straight, lines):
    """Write direction, spread, and how many times farther apart than its points lines lie, of the straightest fit."""
    vectors, sums = np.empty((3, places.shape[1])), np.empty(9)
    for q in range(places.shape[0]):
        relative(places[q], queries, first + q, xyz, vectors)
        line, done = lines[targets[first + q]], 0
        line[:], line[_SPREAD], line[_REACH], sums[:] = 0.0, np.inf, math.sqrt(squared[q, AREA - 1]), 0.0
        for s in range(len(straight)):
            k = int(straight[s, 0])
            add_moments(vectors, done, k, sums)
            done = k
            cx, cy, cz = sums[0] / k, sums[1] / k, sums[2] / k
            xx, xy, xz = sums[3] / k - cx * cx, sums[4] / k - cx * cy, sums[5] / k - cx * cz
            yy, yz, zz = sums[6] / k - cy * cy, sums[7] / k - cy * cz, sums[8] / k - cz * cz
            # The largest eigenvector of a matrix is the smallest one of its negative.
            largest, middle, x, y, z = smallest_eigenpair(-xx, -xy, -xz, -yy, -yz, -zz)
            if not largest < 0.0:
                continue
            spread = math.sqrt(max(middle / largest, 0.0)) / straight[s, 1]
            if spread < line[_SPREAD]:
                apart2 = -12.0 * largest / (k * k - 1.0)  # of points evenly along the line
                line[_U], line[_U + 1], line[_U + 2], line[_SPREAD] = x, y, z, spread
                line[_RATIO] = math.pi * squared[q, AREA - 1] / (AREA * apart2)
                line[_OFF], line[_APART] = math.sqrt(max(-middle, 0.0)), math.sqrt(apart2)


@kernel
def _look_abreast(first, places, squared, queries, targets, xyz, lines):
    """Write how many times farther apart than its points the lines on either side of one lie, where there are two.

    The disc around a point holds both sides of a thin plate; the lines on either side belong to its own.
    """
    k = places.shape[1]
    across = np.empty((4, k))
    for q in range(places.shape[0]):
        line = lines[targets[first + q]]
        line[_REACH] = max(line[_REACH], math.sqrt(squared[q, k - 1]))
        own, count, least, a, b = max(_OWN[0] * line[_APART], _OWN[1] * line[_OFF]), 0, np.inf, 0, 0
        for i in range(1, k):
            along, length = 0.0, 0.0
            for axis in range(3):
                across[axis, count] = xyz[axis, places[q, i]] - queries[axis, first + q]
                along += across[axis, count] * line[_U + axis]
            for axis in range(3):
                across[axis, count] -= along * line[_U + axis]
                length += across[axis, count] ** 2
            across[3, count] = math.sqrt(length)
            count += across[3, count] > own
        for i in range(count):
            for j in range(i):
                dot = across[0, i] * across[0, j] + across[1, i] * across[1, j] + across[2, i] * across[2, j]
                if dot < _OPPOSITE * across[3, i] * across[3, j] and across[3, i] + across[3, j] < least:
                    least, a, b = across[3, i] + across[3, j], i, j
        if least < np.inf:
            line[_RATIO] = 0.5 * least / line[_APART]
            for axis in range(3):
                line[_ACROSS + axis] = across[axis, a] - across[axis, b]


@kernel
def _choose(first, places, squared, queries, targets, xyz, lines, stretch, reach):
    """Write the stretch of the straightest line among the neighbours, the nearest of those that are as straight.

    And, unless `reach` is empty, how far away anything matters for it.
    """
    for q in range(places.shape[0]):
        best, least, count, farthest = -1, np.inf, 0, 0.0
        for i in range(places.shape[1]):
            spread = lines[places[q, i], _SPREAD]
            count += spread < 1.0
            farthest = max(farthest, lines[places[q, i], _REACH])
            spread = max(spread, _EVEN)
            if spread < least:
                best, least = places[q, i], spread
        if len(reach):
            reach[targets[first + q]] = math.sqrt(squared[q, places.shape[1] - 1]) + farthest
        if best < 0 or count < _ON_LINES * places.shape[1]:
            continue
        ratio = lines[best, _RATIO]
        if LEAST <= ratio <= MOST:
            for axis in range(3):
                stretch[axis, targets[first + q]] = (max(FULL * ratio, 1.0) - 1.0) * lines[best, _U + axis]
