"""Arcs that go on beyond their edge points: as far as both faces do, of which they are measured again."""

from __future__ import annotations

import numpy as np

from edgel.curves._circle import RADIUS
from edgel.curves._extent import extents
from edgel.curves._measure import REACH, Measured, refit
from edgel.curves._points import EdgePoints
from edgel.curves._rows import take_rows

_ROUNDS = 6
_AHEAD = 0.4  # of its length: so far beyond either end is looked, a round
_MORE = 2.0  # spacings: an arc that gains less has grown


def grow(
    measured: Measured,
    rows: tuple[np.ndarray, np.ndarray],
    points: EdgePoints,
    position: np.ndarray,
    spacing: np.ndarray,
) -> Measured:
    """Measure arcs on all of their faces, and return all shapes with the ranges that they have then.

    Under noise chains break, and a third of a rim says little of the rest; its faces say where that is. Takes the same
    as `_measure.measure`.
    """
    growing = measured.both & (measured.shape[:, RADIUS] > 0)
    for _ in range(_ROUNDS):
        which = np.flatnonzero(growing)
        if not len(which):
            break
        own, ranges = take_rows(rows, which), measured.ranges[which]
        found = extents(measured.take(which), points.index, own, position, ranges, spacing[which], _AHEAD)
        # Of the stretches found, that with most edge points.
        order = np.lexsort((found.found, found.shape))
        last = np.flatnonzero(np.diff(found.shape[order], append=-1))
        of, ends = found.shape[order][last], found.ends[order][last]
        gains = (ends[:, 1] - ends[:, 0]) - (ranges[of, 1] - ranges[of, 0]) > _MORE * spacing[which[of]]
        growing[:] = False
        which, ends = which[of[gains]], ends[gains]
        if len(which):
            better = refit(measured, which, ends, REACH, rows, points, spacing)
            growing[which[better]] = True
    return measured
