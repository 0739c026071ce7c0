"""A hinge: two planes that meet in a line at any angle, fitted to the neighbours of eight points in step.

Neighbours on either side of the plane that bisects the two belong to one each, so that noise can't part them.
"""

from __future__ import annotations

import numpy as np

from edgel.evidence.rows import keep_rows, load_row, load_three, store_row, store_rows
from edgel.lanes import LANES, bits, larger, multiply_add, root, spread, where
from edgel.parallel import kernel
from edgel.planes import smallest_eigenpairs

ROUNDS = 3


@kernel
def add_moments(vectors, count, beyond, sums):
    """Sum 1, x, y, z, xx, xy, xz, yy, yz, zz over the neighbours beyond a plane into `sums` (10 rows).

    `beyond` (4 rows): normal and level of the plane.
    """
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    px, py, pz, level = *load_three(beyond, 0), load_row(beyond, 3)
    zero, one = spread(0.0), spread(1.0)
    n, mx, my, mz = zero, zero, zero, zero
    xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
    for i in range(count):
        x, y, z = load_row(xs, i), load_row(ys, i), load_row(zs, i)
        w = where(px * x + py * y + pz * z > level, one, zero)
        wx, wy, wz = w * x, w * y, w * z
        n, mx, my, mz = n + w, mx + wx, my + wy, mz + wz
        xx, xy, xz = multiply_add(wx, x, xx), multiply_add(wx, y, xy), multiply_add(wx, z, xz)
        yy, yz, zz = multiply_add(wy, y, yy), multiply_add(wy, z, yz), multiply_add(wz, z, zz)
    store_rows(sums, 0, (n, mx, my, mz, xx, xy, xz, yy, yz, zz))


@kernel
def fit_plane(sums, plane):
    """Fit a plane to points of moments `sums` (10 rows): normal, centroid and squares left into `plane` (7 rows)."""
    mx, my, mz = load_three(sums, 1)
    share = 1.0 / larger(load_row(sums, 0), 1.0)
    cx, cy, cz = mx * share, my * share, mz * share
    smallest, _, nx, ny, nz = smallest_eigenpairs(
        load_row(sums, 4) - mx * cx,
        load_row(sums, 5) - mx * cy,
        load_row(sums, 6) - mx * cz,
        load_row(sums, 7) - my * cy,
        load_row(sums, 8) - my * cz,
        load_row(sums, 9) - mz * cz,
    )
    store_rows(plane, 0, (nx, ny, nz, cx, cy, cz, larger(smallest, 0.0)))


@kernel
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


@kernel
def refine(vectors, count, whole, start, room, hinge, best):
    """Part the neighbours by the plane `start` (4 rows), fit, part again; `best` (1 row) takes the squares left.

    They are infinite where a side is too small, as it is beyond an infinite level. `whole` (10 rows) are the moments of
    all; `hinge` (24 rows) is described at `edgel.evidence.sheets.fit_sheets`, and stays what it was where there is
    none. `room` is (5, 10 rows).
    """
    one, other, a, b, line = room[0], room[1], room[2], room[3], room[4]
    for i in range(4):
        store_row(line, 6 + i, load_row(start, i))
    store_row(best, 0, spread(np.inf))
    active = load_row(start, 3) < np.inf
    for _turn in range(ROUNDS):
        add_moments(vectors, count, line[6 * LANES :], one)
        for i in range(10):
            store_row(other, i, load_row(whole, i) - load_row(one, i))
        fit_plane(one, a)
        fit_plane(other, b)
        bisect(a, b, line)
        left, before = load_row(a, 6) + load_row(b, 6), load_row(best, 0)
        large = (load_row(one, 0) >= 4.0) & (load_row(other, 0) >= 4.0)
        active = active & large & (left < before) & (load_row(line, 9) < np.inf)
        store_row(best, 0, where(active, left, before))
        keep_rows(active, a, 0, hinge, 0, 3)
        keep_rows(active, b, 0, hinge, 3, 3)
        keep_rows(active, line, 0, hinge, 6, 6)
        keep_rows(active, one, 0, hinge, 12, 1)
        keep_rows(active, other, 0, hinge, 13, 1)
        keep_rows(active, a, 3, hinge, 14, 3)
        keep_rows(active, b, 3, hinge, 17, 3)
        keep_rows(active, line, 6, hinge, 20, 4)
        active = active & (left <= 0.999 * before)  # else it has settled
        if bits(active) == 0:
            break
