"""Edge points linked into ordered chains, by tangent and offset."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel.curves._smooth import Smoothed

_STEP = 0.25  # spacings: a chain steps at least so far
_REACH = 4.0  # spacings: and no gap is longer
_BESIDE = 0.35  # spacings aside, a spacing ahead: farther ones are not ahead
_TURN = 0.75  # cosine between the tangent of a chain and that of its next point
_TAKEN = 0.8  # spacings aside: such points belong to the chain though it does not run through them
_LOOP = 6.0  # spacings: a shorter way is no loop


@dataclass(frozen=True, eq=False)
class Chains:
    """Smooth runs of edge points.

    Attributes
    ----------
    points : (L,) int64
        Points that the chains run through, in order, chain after chain.
    start : (C + 1,) int64
        Where each chain begins in `points`.
    closed : (C,) bool
        Whether its last point is followed by its first.
    """

    points: np.ndarray
    start: np.ndarray
    closed: np.ndarray

    def __len__(self) -> int:
        return len(self.closed)


def link(smoothed: Smoothed, spacing: np.ndarray, kind: np.ndarray) -> Chains:
    """Walk from point to point along the tangents, from the surest points first.

    A walk ends where nothing lies ahead within its reach: at corners, which the tangent does not follow, and at ends.
    Only points that share a kind (E,) are linked.
    """
    position, tangent = smoothed.position, smoothed.tangent
    surest = smoothed.spread / spacing / np.sqrt(np.maximum(smoothed.support, 1))
    order = np.lexsort((*position.T, surest))
    points, start = np.empty(len(position), np.int64), np.zeros(len(position) + 1, np.int64)
    closed = np.zeros(len(position), np.bool_)
    count = _walk(order, position, tangent, spacing, kind, smoothed.neighbors, points, start, closed)
    return Chains(points[: start[count]], start[: count + 1], closed[:count])


@kernel
def _walk(order, position, tangent, spacing, kind, neighbors, points, start, closed):
    used = np.zeros(len(position), np.bool_)
    path = np.empty(len(position), np.int64)
    chains = 0
    for seed in order:
        if used[seed] or (tangent[seed, 0] == 0.0 and tangent[seed, 1] == 0.0 and tangent[seed, 2] == 0.0):
            continue
        used[seed] = True
        first = start[chains]
        filled, loop = first, False
        for sense in (1.0, -1.0):
            here, length, number = seed, 0.0, 0
            dx, dy, dz = sense * tangent[seed, 0], sense * tangent[seed, 1], sense * tangent[seed, 2]
            while True:
                following, around, ahead, dx, dy, dz = _next(
                    here, seed, length, dx, dy, dz, position, tangent, spacing, kind, neighbors, used
                )
                if around:
                    loop = True
                    break
                if following < 0:
                    break
                length += ahead
                path[number] = following
                number += 1
                here = following
            if sense > 0.0:
                for i in range(number):  # backwards, so that the other half may follow
                    points[filled + i] = path[number - 1 - i]
                filled += number
                points[filled] = seed
                filled += 1
                if loop:
                    break
            else:
                for i in range(number):
                    points[filled + i] = path[i]
                filled += number
        if filled - first >= 3:
            closed[chains] = loop
            chains += 1
            start[chains] = filled
    return chains


@routine
def _next(here, seed, length, dx, dy, dz, position, tangent, spacing, kind, neighbors, used):
    """Return the point that follows, whether that is the seed, how far it is, and the direction there; -1 for none."""
    h = spacing[here]
    best, cost = -1, math.inf
    back = math.inf
    for j in neighbors[here]:
        if used[j] and j != seed:
            continue
        x, y, z = (
            position[j, 0] - position[here, 0],
            position[j, 1] - position[here, 1],
            position[j, 2] - position[here, 2],
        )
        along = x * dx + y * dy + z * dz
        if along < _STEP * h or along > _REACH * h or kind[j] & kind[here] == 0:
            continue
        aside = math.sqrt(max(x * x + y * y + z * z - along * along, 0.0))
        alike = abs(tangent[j, 0] * dx + tangent[j, 1] * dy + tangent[j, 2] * dz)
        if aside > _BESIDE * (h + along) or alike < _TURN:
            continue
        price = along + 3.0 * aside + 2.0 * h * (1.0 - alike)
        if j == seed:
            if length > _LOOP * h:
                back = price
        elif price < cost:
            best, cost = j, price
    if back <= cost and back < math.inf:
        return -1, True, 0.0, dx, dy, dz
    if best < 0:
        return -1, False, 0.0, dx, dy, dz
    x, y, z = (
        position[best, 0] - position[here, 0],
        position[best, 1] - position[here, 1],
        position[best, 2] - position[here, 2],
    )
    ahead = math.sqrt(x * x + y * y + z * z)
    ux, uy, uz = x / ahead, y / ahead, z / ahead
    # What lies beside the way from here to there belongs to it.
    for origin in (here, best):
        for j in neighbors[origin]:
            if used[j] or j == best:
                continue
            x, y, z = (
                position[j, 0] - position[here, 0],
                position[j, 1] - position[here, 1],
                position[j, 2] - position[here, 2],
            )
            along = x * ux + y * uy + z * uz
            if along < -h or along > ahead + 0.1 * h:
                continue
            aside = x * x + y * y + z * z - along * along
            alike = abs(tangent[j, 0] * ux + tangent[j, 1] * uy + tangent[j, 2] * uz)
            if aside < _TAKEN * _TAKEN * h * h and alike > _TURN:
                used[j] = True
    used[best] = True
    sign = 1.0 if tangent[best, 0] * ux + tangent[best, 1] * uy + tangent[best, 2] * uz >= 0.0 else -1.0
    return best, False, ahead, sign * tangent[best, 0], sign * tangent[best, 1], sign * tangent[best, 2]
