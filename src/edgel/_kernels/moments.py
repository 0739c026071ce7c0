"""Moments of points and the planes they determine: of one set of points, and of eight in step.

Moments are sums of 1, x, y, z, xx, xy, xz, yy, yz, zz, in this order.
"""

from __future__ import annotations

from edgel._kernels.eigen import smallest_eigenpair, smallest_eigenpairs
from edgel._kernels.parallel import part, routine, summing_routine
from edgel._kernels.rows import load_row, load_three, store_rows
from edgel._kernels.simd import larger, multiply_add, spread, where


@part
def scatter(ax, ay, az, bx, by, bz, xx, xy, xz, yy, yz, zz):
    """Second moments about the centroid, of numbers or of eight in step.

    `a` and `b` are the first moments and the centroid; which of them comes first changes nothing but rounding.
    """
    return xx - ax * bx, xy - ax * by, xz - ax * bz, yy - ay * by, yz - ay * bz, zz - az * bz


@summing_routine
def add_moments(vectors, start, stop, sums):
    """Add the moments of the points start..stop-1 of `vectors` (3, K) to `sums` (9,), which leaves out their number."""
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    mx, my, mz = 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(start, stop):
        x, y, z = xs[i], ys[i], zs[i]
        mx, my, mz = mx + x, my + y, mz + z
        xx, xy, xz, yy, yz, zz = xx + x * x, xy + x * y, xz + x * z, yy + y * y, yz + y * z, zz + z * z
    sums[0] += mx
    sums[1] += my
    sums[2] += mz
    sums[3] += xx
    sums[4] += xy
    sums[5] += xz
    sums[6] += yy
    sums[7] += yz
    sums[8] += zz


@routine
def move_moments(sums, x, y, z, out):
    """Add moments (10,) about their own centroid, which lies at x, y, z, to moments `out` (10,) about the origin."""
    n = sums[0]
    out[0] += n
    out[1] += n * x
    out[2] += n * y
    out[3] += n * z
    out[4] += sums[4] + n * x * x
    out[5] += sums[5] + n * x * y
    out[6] += sums[6] + n * x * z
    out[7] += sums[7] + n * y * y
    out[8] += sums[8] + n * y * z
    out[9] += sums[9] + n * z * z


@routine
def plane_of_moments(sums, plane):
    """Fit a plane to points of moments `sums` (10,): normal, centroid into `plane` (6,); returns the squares left."""
    n, sx, sy, sz = sums[0], sums[1], sums[2], sums[3]
    cx, cy, cz = sx / n, sy / n, sz / n
    smallest, _, nx, ny, nz = smallest_eigenpair(
        *scatter(sx, sy, sz, cx, cy, cz, sums[4], sums[5], sums[6], sums[7], sums[8], sums[9])
    )
    plane[0], plane[1], plane[2], plane[3], plane[4], plane[5] = nx, ny, nz, cx, cy, cz
    return max(smallest, 0.0)


@routine
def add_moments_of_eight(vectors, count, beyond, sums):
    """Sum the moments of the neighbours beyond a plane into `sums` (10 rows).

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


@routine
def planes_of_moments(sums, plane):
    """Fit planes to points of moments `sums` (10 rows): normal, centroid and squares left into `plane` (7 rows)."""
    sx, sy, sz = load_three(sums, 1)
    share = 1.0 / larger(load_row(sums, 0), 1.0)
    cx, cy, cz = sx * share, sy * share, sz * share
    xx, xy, xz = load_three(sums, 4)
    yy, yz, zz = load_three(sums, 7)
    smallest, _, nx, ny, nz = smallest_eigenpairs(*scatter(sx, sy, sz, cx, cy, cz, xx, xy, xz, yy, yz, zz))
    store_rows(plane, 0, (nx, ny, nz, cx, cy, cz, larger(smallest, 0.0)))
