"""Context: how likely the neighbours of a likely edge point are edge points, along the edge and beside it.

An edge is a chain one point thick: a point is the likelier on it the surer the points before and behind it are, and the
less likely the surer those beside it are. This is Canny's non-maximum suppression and hysteresis, learned.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.arrays import copy_to, divide_rows
from edgel._kernels.eigen import smallest_eigenpair
from edgel._kernels.parallel import kernel, routine
from edgel._neighbors.neighborhood import drop_foot, relative, stretch, stretch_direction
from edgel._neighbors.spacing import disc_spacing

NEIGHBORS = 24

OWN, ALIGNMENT, AGREEMENT, FIRST, SECOND, THIRD, MEAN_8, MEAN_16, MEAN_ALL, OTHER_OWN, OTHER_BEST = range(11)
AHEAD, BEHIND, OVER_BESIDE, LINE_AHEAD, LINE_BEHIND, RIVALS, NEARER_RIVAL, FOOT_AWAY = range(11, 19)
FEATURES = {
    "own": "probability of this kind of edge at the point",
    "alignment": "how far the neighbours' probabilities lie on a line, 0 to 1",
    "agreement": "cosine between that line and the edge's own",
    "first": "largest probability among the 8 nearest",
    "second": "second largest",
    "third": "third largest",
    "mean_8": "mean probability of the 8 nearest",
    "mean_16": "mean of the 16 nearest",
    "mean_all": "mean of all",
    "other_own": "probability of the other kind at the point",
    "other_best": "largest probability of the other kind among the 8 nearest",
    "ahead": "largest probability before or behind the point along the probabilities' line",
    "behind": "largest on the other side of it",
    "over_beside": "probability of the point less the largest beside it",
    "line_ahead": "largest probability, times agreement, before or behind the point along its own line",
    "line_behind": "largest on the other side of it",
    "rivals": "sum of those beside it that place the edge on the same line",
    "nearer_rival": "by how much the nearest of them is nearer to the line, in spacings",
    "foot_away": "distance of the point from its own line, in spacings, at most 4",
}
NUM_FEATURES = len(FEATURES)
_AHEAD, _ASIDE = 0.8, 0.6  # cosines to the edge: neighbours before and behind it, and beside it
_FAR, _BESIDE = 3.0, 1.8  # spacings within which they lie
_SAME_LINE = 0.35  # spacings between lines that two points beside each other put the same edge on


@kernel
def gather_context(first, places, squared, queries, targets, xyz, probabilities, slot, lines, feet, features):
    """Describe the probabilities of each of two kinds of edge around some points.

    Parameters: the probability of either kind at every place, (2, N) float32; which row of `lines` and `feet` (M, 3),
    the direction of its line and the foot on it, is its own, (N,) int32, -1 for none. Writes `features`, `FEATURES` of
    either kind (2, Q, 19).
    """
    k = places.shape[1]
    away, near_lines, near_feet = np.empty((3, k)), np.empty((k, 3), np.float32), np.empty((k, 3), np.float32)
    for q in range(places.shape[0]):
        row, spacing = targets[first + q], disc_spacing(squared[q])
        if spacing == 0.0:
            features[:, row] = 0.0
            continue
        relative(places[q], queries, first + q, xyz, away)
        divide_rows(away, spacing)
        for i in range(k):
            j = slot[places[q, i]]
            if j >= 0:
                copy_to(lines[j], near_lines[i])
                copy_to(feet[j], near_feet[i])
                if queries.shape[0] > 3:
                    stretch_direction(queries[3:, first + q], near_lines[i], 0)
                    stretch(queries[3:, first + q], near_feet[i], 0)
                    drop_foot(near_feet[i], 0, near_lines[i], 0)
        for kind in range(2):
            _describe(
                places[q],
                away,
                spacing,
                probabilities[kind],
                probabilities[1 - kind],
                slot,
                near_lines,
                near_feet,
                features[kind, row],
            )


@routine
def _describe(places, away, spacing, probability, other, slot, lines, feet, out):
    """Describe the probabilities of one kind of edge around a point, by the lines and feet (k, 3) of its neighbours."""
    out[:] = 0.0
    own, placed = probability[places[0]], slot[places[0]] >= 0
    tx, ty, tz, line_like = _main_direction(places, away, probability)
    agree = abs(lines[0, 0] * tx + lines[0, 1] * ty + lines[0, 2] * tz) if placed else 0.0
    out[OWN], out[ALIGNMENT], out[AGREEMENT] = own, line_like, agree
    _sums(places, probability, other, out)
    _along_and_across(places, away, probability, tx, ty, tz, own, out)
    if placed:
        _along_and_across_line(places, away, probability, slot, lines, feet, spacing, out)


@routine
def _main_direction(places, away, probability):
    """Direction along which the probabilities lie, and how far they lie on a line, 0 to 1."""
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(1, len(places)):
        w = probability[places[i]]
        x, y, z = away[0, i], away[1, i], away[2, i]
        xx, xy, xz, yy, yz, zz = (
            xx + w * x * x,
            xy + w * x * y,
            xz + w * x * z,
            yy + w * y * y,
            yz + w * y * z,
            zz + w * z * z,
        )
    trace = xx + yy + zz
    if not trace > 0.0:
        return 1.0, 0.0, 0.0, 0.0
    # The largest eigenvector of a matrix is the smallest one of its negative.
    largest, middle, x, y, z = smallest_eigenpair(-xx, -xy, -xz, -yy, -yz, -zz)
    return x, y, z, (middle - largest) / trace


@routine
def _sums(places, probability, other, out):
    """Write the largest three of the 8 nearest, means over 8, 16 and all, and the largest of the other kind."""
    a, b, c, total, others = 0.0, 0.0, 0.0, 0.0, 0.0
    k = len(places)
    for i in range(1, k):
        p = probability[places[i]]
        total += p
        if i <= 8:
            if p > a:
                a, b, c = p, a, b
            elif p > b:
                b, c = p, b
            elif p > c:
                c = p
            others = max(others, other[places[i]])
        if i == min(8, k - 1):
            out[MEAN_8] = total / i
        if i == min(16, k - 1):
            out[MEAN_16] = total / i
    out[FIRST], out[SECOND], out[THIRD], out[MEAN_ALL] = a, b, c, total / max(k - 1, 1)
    out[OTHER_OWN], out[OTHER_BEST] = other[places[0]], others


@routine
def _along_and_across(places, away, probability, tx, ty, tz, own, out):
    """Write the largest before and behind the point, and beside it, by the direction in which probabilities lie."""
    ahead, behind, beside = 0.0, 0.0, 0.0
    for i in range(1, len(places)):
        x, y, z = away[0, i], away[1, i], away[2, i]
        far = math.sqrt(x * x + y * y + z * z)
        if far > _FAR or far == 0.0:
            continue
        cosine = (x * tx + y * ty + z * tz) / far
        p = probability[places[i]]
        if cosine > _AHEAD:
            ahead = max(ahead, p)
        elif cosine < -_AHEAD:
            behind = max(behind, p)
        elif abs(cosine) < _ASIDE and far < _BESIDE:
            beside = max(beside, p)
    out[AHEAD], out[BEHIND], out[OVER_BESIDE] = max(ahead, behind), min(ahead, behind), own - beside


@routine
def _along_and_across_line(places, away, probability, slot, lines, feet, spacing, out):
    """The same by the point's own line, and what those beside it that see the same line make of it."""
    tx, ty, tz = lines[0, 0], lines[0, 1], lines[0, 2]
    fx, fy, fz = feet[0, 0] / spacing, feet[0, 1] / spacing, feet[0, 2] / spacing
    own_away = math.sqrt(fx * fx + fy * fy + fz * fz)
    ahead, behind, rivals, nearer = 0.0, 0.0, 0.0, -2.0
    for i in range(1, len(places)):
        x, y, z = away[0, i], away[1, i], away[2, i]
        far = math.sqrt(x * x + y * y + z * z)
        if far > _FAR or far == 0.0 or slot[places[i]] < 0:
            continue
        cosine = (x * tx + y * ty + z * tz) / far
        p = probability[places[i]] * abs(tx * lines[i, 0] + ty * lines[i, 1] + tz * lines[i, 2])
        if cosine > _AHEAD:
            ahead = max(ahead, p)
        elif cosine < -_AHEAD:
            behind = max(behind, p)
        elif abs(cosine) < _ASIDE:
            gx, gy, gz = feet[i, 0] / spacing, feet[i, 1] / spacing, feet[i, 2] / spacing
            dx, dy, dz = x + gx - fx, y + gy - fy, z + gz - fz
            along = dx * tx + dy * ty + dz * tz
            apart = math.sqrt(max(dx * dx + dy * dy + dz * dz - along * along, 0.0))
            if apart < _SAME_LINE and p > 0.1:
                rivals += p
                nearer = max(nearer, own_away - math.sqrt(gx * gx + gy * gy + gz * gz))
    out[LINE_AHEAD], out[LINE_BEHIND] = max(ahead, behind), min(ahead, behind)
    out[RIVALS], out[NEARER_RIVAL], out[FOOT_AWAY] = rivals, nearer, min(own_away, 4.0)
