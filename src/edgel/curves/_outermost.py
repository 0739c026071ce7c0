"""Lines where a surface ends, turned along its outermost points: edge points lie up to a spacing and more inside."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel.curves import _fit
from edgel.curves._circle import RADIUS, lean, local
from edgel.curves._gather import gather_all
from edgel.curves._points import EdgePoints
from edgel.curves._strands import Strands

_REACH = 2.5  # spacings beside a line
_ONE_SIDED = 0.25  # spacings: where the points beside a line lie on the mean nearer to it, the surface goes on
_INSIDE, _OUTSIDE, _OFF = 1.5, 1.2, 1.0  # spacings from the line, along the surface and off it, of an outermost point
_PAST = 0.3  # spacings, past the ends
_LEAST = 4  # outermost points, one a spacing
_ROUNDS, _FLOOR = 5, 0.05  # of the fit; spacings: least scatter
_MOST = 0.35  # slope: a line that would turn by more is left
_ROOM = 2048


def along_outermost(strands: Strands, points: EdgePoints) -> Strands:
    """Turn the lines that no two faces confirm along the outermost points of the surface beside them.

    Only where these say it more surely than edge points: scans in rows end in a row, and random points do not. Lines
    turn about their middle, which stays: how far beyond its outermost points a surface ends, the edge points say.
    """
    which = np.flatnonzero((strands.shape[:, RADIUS] == 0) & (strands.fit[:, _fit.STATE] == _fit.EDGE_ALONE))
    shape, fit, along = strands.shape.copy(), strands.fit.copy(), strands.along.copy()
    tree = points.index
    run_slices(_turn, len(which), which, shape, fit, along, tree.xyz, tree.boxes, strands.spacing, size=32)
    return replace(strands, shape=shape, fit=fit, along=along)


@kernel
def _turn(start, stop, which, shapes, fits, ranges, places, boxes, spacing):
    near = np.empty((_ROOM, 3))
    for q in range(start, stop):
        k = which[q]
        shape, h, half = shapes[k], spacing[k], 0.5 * (ranges[k, 1] - ranges[k, 0])
        middle = ranges[k, 0] + half
        low, high = ranges[k, 0] - _PAST * h, ranges[k, 1] + _PAST * h
        near, number = gather_all(places, boxes, shape, low, high, _REACH * h, near)
        for axis in range(3):
            shape[axis] += middle * shape[9 + axis]
        ranges[k, 0], ranges[k, 1] = -half, half
        outermost = np.full((int((high - low) / h) + 1, 2), -np.inf)
        a, b = _inward(shape, near[:number], h)
        if a == 0.0 and b == 0.0:
            continue
        _find_outermost(shape, near[:number], a, b, 0.5 * (high - low), h, outermost)
        slope, deviation = _slope(outermost, h)
        if abs(slope) <= _MOST and deviation < fits[k, _fit.TURN_STD]:
            lean(shape, -slope * a, -slope * b)
            fits[k, _fit.TURN_STD] = deviation


@routine
def _inward(shape, near, h):
    """Return the direction across a line in which the surface lies, in the line's own frame; zeros on both sides."""
    a = b = 0.0
    for i in range(len(near)):
        u, v, _ = local(shape, near[i, 0], near[i, 1], near[i, 2])
        a, b = a + u / len(near), b + v / len(near)
    length = math.sqrt(a * a + b * b)
    return (a / length, b / length) if length > _ONE_SIDED * h else (0.0, 0.0)


@routine
def _find_outermost(shape, near, a, b, half, h, outermost):
    """Write how far along the line and how far outside the outermost point of each spacing lies."""
    for i in range(len(near)):
        u, v, along = local(shape, near[i, 0], near[i, 1], near[i, 2])
        out, off = -(a * u + b * v), b * u - a * v
        if out < -_INSIDE * h or out > _OUTSIDE * h or abs(off) > _OFF * h:
            continue
        best = outermost[min(max(int((along + half) / h), 0), len(outermost) - 1)]
        if out > best[1] or (out == best[1] and along > best[0]):
            best[0], best[1] = along, out


@routine
def _slope(outermost, h):
    """Return the slope of the robust line through the outermost points, and its deviation: NaN for too few points."""
    scatter, slope, offset, lever = math.inf, 0.0, 0.0, 0.0
    for _ in range(_ROUNDS):
        s = sx = sy = sxx = sxy = rest = 0.0
        count = 0
        for x, y in outermost:
            if y == -math.inf:
                continue
            off = y - offset - slope * x
            weight = 1.0 / (1.0 + (off / (2.0 * scatter)) ** 2)
            s, sx, sy = s + weight, sx + weight * x, sy + weight * y
            sxx, sxy = sxx + weight * x * x, sxy + weight * x * y
            count += 1
        if count < _LEAST:
            return 0.0, math.nan
        lever = sxx - sx * sx / s
        slope = (sxy - sx * sy / s) / lever
        offset = (sy - slope * sx) / s
        for x, y in outermost:
            if y > -math.inf:
                off = y - offset - slope * x
                rest += off * off / (1.0 + (off / (2.0 * scatter)) ** 2)
        scatter = max(math.sqrt(rest / s), _FLOOR * h)
    return slope, scatter / math.sqrt(lever)
