"""A hinge: two planes that meet in a line at any angle, fitted to the neighbours of eight points in step.

Neighbours on either side of the plane that bisects the two belong to one each, so that noise can't part them.
"""

from __future__ import annotations

import numpy as np

from edgel._kernels.moments import add_moments_of_eight, planes_of_moments
from edgel._kernels.parallel import routine
from edgel._kernels.rows import keep_rows, load_row, load_three, store_row, store_rows
from edgel._kernels.simd import LANES, bits, root, spread, where
from edgel._neighbors.neighborhood import drop_foot, unstretch, unstretch_direction, unstretch_normal

ROUNDS = 3

# Rows of a hinge.
FIRST_NORMAL, SECOND_NORMAL, LINE, FOOT = 0, 3, 6, 9
FIRST_COUNT, SECOND_COUNT, FIRST_CENTROID, SECOND_CENTROID = 12, 13, 14, 17
PARTING, PARTING_LEVEL = 20, 23
HINGE = 24


@routine
def bisect(a, b, line):
    """Find where planes a and b (6 rows) meet, and the plane that parts their centroids.

    Writes to `line` (10 rows): the line's direction, its point nearest to the origin, and the parting plane's
    normal and level, which is infinite where a and b are parallel: nothing lies beyond.
    """
    ax, ay, az = load_three(a, 0)
    bx, by, bz = load_three(b, 0)
    dot = ax * bx + ay * by + az * bz
    tx, ty, tz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    sine2 = tx * tx + ty * ty + tz * tz
    meet = sine2 >= 1e-4
    inverse2 = 1.0 / where(meet, sine2, 1.0)
    x, y, z = load_three(a, 3)
    u, v, w = load_three(b, 3)
    da, db = ax * x + ay * y + az * z, bx * u + by * v + bz * w
    s, t = (da - db * dot) * inverse2, (db - da * dot) * inverse2
    fx, fy, fz = s * ax + t * bx, s * ay + t * by, s * az + t * bz
    # Of the two bisecting planes, the one that parts the centroids.
    px, py, pz, qx, qy, qz = ax - bx, ay - by, az - bz, ax + bx, ay + by, az + bz
    cx, cy, cz = x - u, y - v, z - w
    p, q = px * cx + py * cy + pz * cz, qx * cx + qy * cy + qz * cz
    other = p * p * (qx * qx + qy * qy + qz * qz) < q * q * (px * px + py * py + pz * pz)
    px, py, pz, p = where(other, qx, px), where(other, qy, py), where(other, qz, pz), where(other, q, p)
    sign = where(p < 0.0, -1.0, 1.0)
    px, py, pz = px * sign, py * sign, pz * sign
    length = root(inverse2)
    level = where(meet, px * fx + py * fy + pz * fz, np.inf)
    store_rows(line, 0, (tx * length, ty * length, tz * length, fx, fy, fz, px, py, pz, level))


@routine
def refine(vectors, count, whole, start, scratch, hinge, best):
    """Part the neighbours by the plane `start` (4 rows), fit, part again; `best` (1 row) takes the squares left.

    They are infinite where a side is too small, as it is beyond an infinite level. `whole` (10 rows) are the moments of
    all; `hinge` (24 rows), described at `edgel._surface.two_planes.fit_two_planes`, stays what it was where there is
    none. `scratch` is (5, 10 rows).
    """
    one, other, a, b, line = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    for i in range(4):
        store_row(line, 6 + i, load_row(start, i))
    store_row(best, 0, spread(np.inf))
    active = load_row(start, 3) < np.inf
    for _turn in range(ROUNDS):
        add_moments_of_eight(vectors, count, line[6 * LANES :], one)
        for i in range(10):
            store_row(other, i, load_row(whole, i) - load_row(one, i))
        planes_of_moments(one, a)
        planes_of_moments(other, b)
        bisect(a, b, line)
        left, before = load_row(a, 6) + load_row(b, 6), load_row(best, 0)
        large = (load_row(one, 0) >= 4.0) & (load_row(other, 0) >= 4.0)
        active = active & large & (left < before) & (load_row(line, 9) < np.inf)
        store_row(best, 0, where(active, left, before))
        keep_rows(active, a, 0, hinge, FIRST_NORMAL, 3)
        keep_rows(active, b, 0, hinge, SECOND_NORMAL, 3)
        keep_rows(active, line, 0, hinge, LINE, 6)
        keep_rows(active, one, 0, hinge, FIRST_COUNT, 1)
        keep_rows(active, other, 0, hinge, SECOND_COUNT, 1)
        keep_rows(active, a, 3, hinge, FIRST_CENTROID, 3)
        keep_rows(active, b, 3, hinge, SECOND_CENTROID, 3)
        keep_rows(active, line, 6, hinge, PARTING, 4)
        active = active & (left <= 0.999 * before)  # else it has settled
        if bits(active) == 0:
            break


@routine
def unstretch_hinge(own, fit):
    """Take a hinge (24,) back from the space that the stretch `own` (3,) makes."""
    for normal in (FIRST_NORMAL, SECOND_NORMAL):
        unstretch_normal(own, fit, normal)
    for place in (FOOT, FIRST_CENTROID, SECOND_CENTROID):
        unstretch(own, fit, place)
    unstretch_direction(own, fit, LINE)
    drop_foot(fit, FOOT, fit, LINE)
    length = unstretch_normal(own, fit, PARTING)
    if length > 0.0:
        fit[PARTING_LEVEL] /= length
