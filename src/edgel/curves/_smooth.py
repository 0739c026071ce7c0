"""Edge points moved onto moving curves through their neighbours: places and tangents that can be linked."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._kernels.eigen import smallest_eigenpair
from edgel._kernels.frames import tangents as across_axes
from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn

NEIGHBORS = 20
"""Edge points around each that are looked at; on an edge alone they reach 10 spacings."""
_REACH = 2.5  # spacings along the curve, to either side
_ASIDE = 0.8  # spacings across it: farther ones belong to another edge
_ALIKE = 0.8  # cosine between tangents of one edge
_LONG = 0.3  # of the larger second moment: where no tangent is known, points as round as that have none


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Edge points on moving curves.

    Attributes
    ----------
    position : (E, 3) float64
    tangent : (E, 3) float64
        Unit vectors of either sign; zero where there is none.
    spread : (E,) float64
        Root mean square of the neighbours across the curve, before.
    support : (E,) int64
        How many neighbours took part.
    neighbors : (E, k) int64
        Of each point, nearest first, itself among them.
    """

    position: np.ndarray
    tangent: np.ndarray
    spread: np.ndarray
    support: np.ndarray
    neighbors: np.ndarray


def smooth(position: np.ndarray, direction: np.ndarray, spacing: np.ndarray, rounds: int = 2) -> Smoothed:
    """Move edge points (E, 3) across their tangents (E, 3), NaN where unknown, onto parabolas through their neighbours.

    `spacing` (E,) is that of the cloud there. The curve keeps its curvature: it is the parabola's vertex, no mean.
    """
    count = len(position)
    none = np.empty((0, 1), np.int64)
    neighbors = knn(build_index(position), position, min(NEIGHBORS, count)).points if count else none
    known = np.where(np.isfinite(direction), direction, 0.0)
    tangent = np.zeros_like(position)
    run_slices(_fill_tangents, count, position, known, spacing, neighbors, tangent)
    spread, support = np.zeros(count), np.zeros(count, np.int64)
    for turn in range(rounds):
        moved, turned = position.copy(), tangent.copy()
        run_slices(_move, count, position, tangent, spacing, neighbors, moved, turned, spread, support, turn == 0)
        position, tangent = moved, turned
    return Smoothed(position, tangent, spread, support, neighbors)


@kernel
def _fill_tangents(start, stop, position, known, spacing, neighbors, tangent):
    """Where no tangent is known: the main direction of the points around, if they have one."""
    for i in range(start, stop):
        if known[i, 0] != 0.0 or known[i, 1] != 0.0 or known[i, 2] != 0.0:
            tangent[i, 0], tangent[i, 1], tangent[i, 2] = known[i, 0], known[i, 1], known[i, 2]
            continue
        reach = _REACH * spacing[i]
        xx = xy = xz = yy = yz = zz = 0.0
        count = 0
        for j in neighbors[i]:
            x, y, z = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1], position[j, 2] - position[i, 2]
            if x * x + y * y + z * z > reach * reach:
                continue
            xx, xy, xz, yy, yz, zz = xx + x * x, xy + x * y, xz + x * z, yy + y * y, yz + y * z, zz + z * z
            count += 1
        if count < 3:
            continue
        smallest, middle, a, b, c = smallest_eigenpair(xx, xy, xz, yy, yz, zz)
        largest = xx + yy + zz - smallest - middle
        if largest <= 0.0 or middle > _LONG * largest:
            continue
        # Across the smallest eigenvector, the largest one: the image of any vector across, iterated.
        u, v, w, p, q, r = across_axes(a, b, c)
        best = 0.0
        for turn in range(2):
            if turn == 1:
                u, v, w = p, q, r
            iu, iv, iw = xx * u + xy * v + xz * w, xy * u + yy * v + yz * w, xz * u + yz * v + zz * w
            iu, iv, iw = (
                xx * iu + xy * iv + xz * iw - middle * iu,
                xy * iu + yy * iv + yz * iw - middle * iv,
                xz * iu + yz * iv + zz * iw - middle * iw,
            )
            length = math.sqrt(iu * iu + iv * iv + iw * iw)
            if length > best:
                best = length
                tangent[i, 0], tangent[i, 1], tangent[i, 2] = iu / length, iv / length, iw / length


@kernel
def _move(start, stop, position, tangent, spacing, neighbors, moved, turned, spread, support, first):
    """Move each point to the weighted parabola through its like-directed neighbours, and turn its tangent to it."""
    for i in range(start, stop):
        tx, ty, tz = tangent[i, 0], tangent[i, 1], tangent[i, 2]
        if tx == 0.0 and ty == 0.0 and tz == 0.0:
            continue
        ax, ay, az, bx, by, bz = across_axes(tx, ty, tz)
        h = spacing[i]
        s0 = s1 = s2 = s3 = s4 = 0.0
        a0 = a1 = a2 = b0 = b1 = b2 = square = 0.0
        count = 0
        for j in neighbors[i]:
            x, y, z = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1], position[j, 2] - position[i, 2]
            along = (x * tx + y * ty + z * tz) / h
            alike = abs(tx * tangent[j, 0] + ty * tangent[j, 1] + tz * tangent[j, 2])
            a, b = (x * ax + y * ay + z * az) / h, (x * bx + y * by + z * bz) / h
            if abs(along) > _REACH or alike < _ALIKE or a * a + b * b > _ASIDE * _ASIDE:
                continue
            weight = math.exp(-0.35 * along * along)
            count += 1
            one = weight * along
            two = one * along
            s0, s1, s2, s3, s4 = s0 + weight, s1 + one, s2 + two, s3 + two * along, s4 + two * along * along
            a0, a1, a2 = a0 + weight * a, a1 + one * a, a2 + two * a
            b0, b1, b2 = b0 + weight * b, b1 + one * b, b2 + two * b
            square += weight * (a * a + b * b)
        support[i] = count
        if count < 3:
            continue
        # A prior on the bend: few points, or points on one side alone, give a line.
        s4 += 0.5
        s2_ = s2 + 1e-6
        m00, m01, m02, m11, m12, m22 = s0, s1, s2, s2_, s3, s4
        c00, c01, c02 = m11 * m22 - m12 * m12, m02 * m12 - m01 * m22, m01 * m12 - m02 * m11
        det = m00 * c00 + m01 * c01 + m02 * c02
        if det <= 1e-9 * s0 * s0 * s0:
            continue
        c11, c12 = m00 * m22 - m02 * m02, m01 * m02 - m00 * m12
        pa, pb = (c00 * a0 + c01 * a1 + c02 * a2) / det, (c00 * b0 + c01 * b1 + c02 * b2) / det
        qa, qb = (c01 * a0 + c11 * a1 + c12 * a2) / det, (c01 * b0 + c11 * b1 + c12 * b2) / det
        if first:
            spread[i] = h * math.sqrt(max(square / s0 - pa * pa - pb * pb, 0.0))
        moved[i, 0] = position[i, 0] + h * (pa * ax + pb * bx)
        moved[i, 1] = position[i, 1] + h * (pa * ay + pb * by)
        moved[i, 2] = position[i, 2] + h * (pa * az + pb * bz)
        u, v, w = tx + qa * ax + qb * bx, ty + qa * ay + qb * by, tz + qa * az + qb * bz
        length = math.sqrt(u * u + v * v + w * w)
        turned[i, 0], turned[i, 1], turned[i, 2] = u / length, v / length, w / length
