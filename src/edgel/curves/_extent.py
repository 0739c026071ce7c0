"""Where along shapes there are edges: where edge points lie, and where both faces meet though none was found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel._neighbors.kdtree import NeighborIndex
from edgel.curves import _fit
from edgel.curves._circle import RADIUS, along_of
from edgel.curves._gather import gather_all, widened
from edgel.curves._measure import Measured
from edgel.curves._profile import in_profile

_MOST = 12  # intervals of one shape
_GAP = 2.0  # spacings without anything: a curve goes on beyond
_DEPTH = 2.5  # spacings: so far into a face its points speak for it
_FAR = 2.7  # spacings: farther from a curve lie none of those
_ROOM = 4096  # points beside a shape that there is room for to begin with


@dataclass(frozen=True, eq=False)
class Extents:
    """Intervals along shapes.

    Attributes
    ----------
    shape : (I,) int64
        Which shape.
    ends : (I, 2) float64
        From where to where along it.
    closed : (I,) bool
        All round.
    found : (I,) int64
        How many of its edge points lie there.
    """

    shape: np.ndarray
    ends: np.ndarray
    closed: np.ndarray
    found: np.ndarray


def extents(
    measured: Measured,
    index: NeighborIndex,
    owned: tuple[np.ndarray, np.ndarray],
    position: np.ndarray,
    ranges: np.ndarray,
    spacing: np.ndarray,
    share: float = 0.0,
) -> Extents:
    """Find where measured shapes are edges, in bins of a spacing.

    Takes the edge points that each owns (as rows of `position`, and where each shape's begin), and the ranges (K, 2)
    in which they lie; beyond these it looks 4 spacings far, and at least a share of their length.
    """
    shapes = measured.shape
    count = len(shapes)
    low, high, whole = widened(shapes, ranges, spacing, share)
    ends, closed = np.zeros((count, _MOST, 2)), np.zeros((count, _MOST), np.bool_)
    found, number = np.zeros((count, _MOST), np.int64), np.zeros(count, np.int64)
    arguments = (shapes, measured.fit, index.xyz, index.boxes, *owned, position, spacing, low, high, whole)
    run_slices(_extents, count, *arguments, ends, closed, found, number, size=16)
    kept = np.arange(_MOST) < number[:, None]
    return Extents(np.repeat(np.arange(count), number), ends[kept], closed[kept], found[kept])


@kernel
def _extents(
    start, stop, shapes, fits, places, boxes, rows, first, position, spacing, low, high, whole,
    ends, closed, found, number,
):  # fmt: skip
    near = np.empty((_ROOM, 3))
    for k in range(start, stop):
        h, own = spacing[k], rows[first[k] : first[k + 1]]
        if len(own) == 0:
            continue
        bins = max(int(np.ceil((high[k] - low[k]) / h)), 1)
        width = (high[k] - low[k]) / bins
        around = 2.0 * np.pi * shapes[k, RADIUS]
        edges, sides = np.zeros(bins, np.int64), np.zeros((bins, 2), np.int64)
        for i in own:
            b = _bin(along_of(shapes[k], position[i, 0], position[i, 1], position[i, 2]), low[k], width, around)
            if 0 <= b < bins:
                edges[b] += 1
        if fits[k, _fit.STATE] == _fit.MEASURED:
            near, number_near = gather_all(places, boxes, shapes[k], low[k], high[k], _FAR * h, near)
            _count_sides(shapes[k], fits[k], near[:number_near], h, low[k], width, around, sides)
        speaks = (edges > 0) | ((sides[:, 0] > 0) & (sides[:, 1] > 0))
        _intervals(speaks, edges, h, low[k], width, whole[k], k, ends, closed, found, number)


@routine
def _bin(along, low, width, around):
    if around > 0.0:
        along -= around * np.floor((along - low) / around)
    return int(np.floor((along - low) / width))


@routine
def _count_sides(shape, fit, beside, h, low, width, around, sides):
    """Count the points of either face in each bin along a shape, near the edge."""
    for i in range(len(beside)):
        a, b, along = in_profile(shape, beside[i, 0], beside[i, 1], beside[i, 2])
        bin_ = _bin(along, low, width, around)
        if not 0 <= bin_ < len(sides):
            continue
        best, which = np.inf, -1
        for k in range(2):
            into = fit[_fit.INWARD + 2 * k] * a + fit[_fit.INWARD + 2 * k + 1] * b
            off = abs(
                fit[_fit.NORMALS + 2 * k] * a + fit[_fit.NORMALS + 2 * k + 1] * b - fit[_fit.BEND + k] * into * into
            )
            tolerance = min(max(3.0 * fit[_fit.SIGMA + k], 0.2 * h), 0.8 * h)
            if 0.3 * h < into < _DEPTH * h and off < tolerance and off < best:
                best, which = off, k
        if which >= 0:
            sides[bin_, which] += 1


@routine
def _intervals(speaks, edges, h, low, width, whole, k, ends, closed, found, number):
    """Write the runs of bins that speak for the edge, small gaps bridged, and edge points among them."""
    bins = len(speaks)
    most = int(max(_GAP * h / width, 1.0) + 0.5)
    shift = 0
    if whole:
        # Begin behind the longest silence; where there is none to speak of, the curve is closed.
        longest = run = 0
        for q in range(2 * bins):
            run = 0 if speaks[q % bins] else run + 1
            if run > longest and run <= bins:
                longest, shift = run, (q + 1) % bins
        if longest <= most:
            ends[k, 0, 0], ends[k, 0, 1] = low, low + bins * width
            closed[k, 0], found[k, 0], number[k] = True, edges.sum(), 1
            return
    begin, silence, points, count = -1, 0, 0, 0
    for q in range(bins + most + 1):
        b = (q + shift) % bins
        if q < bins and speaks[b]:
            if begin < 0:
                begin, points = q, 0
            points += edges[b]
            silence = 0
            continue
        silence += 1
        if begin >= 0 and silence > most:
            if points >= 2 and count < len(ends[k]):
                stop = q + 1 - silence
                ends[k, count, 0] = low + (shift + begin) * width
                ends[k, count, 1] = low + (shift + stop) * width
                found[k, count] = points
                count += 1
            begin = -1
    number[k] = count
