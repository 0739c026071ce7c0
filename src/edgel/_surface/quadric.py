"""A quadric over the tangent plane, for eight points in step: what a smooth surface would leave of the neighbours."""

from __future__ import annotations

import numpy as np

from edgel._kernels.frames import tangents_of_eight
from edgel._kernels.parallel import routine
from edgel._kernels.rows import load_row, load_three, store_row, store_rows
from edgel._kernels.simd import larger, multiply_add, root, spread

_STIFF = 1e-4  # on the diagonal, so that what the neighbours leave open is small


@routine
def _add_powers(vectors, count, plane, scale, sums):
    """Sum the powers of x and y up to the fourth over the tangent plane, those times z, and z squared, in radii.

    Into `sums` (21 rows), from the normal in `plane` (3 rows) and the radius in `scale` (1 row).
    """
    per = 1.0 / load_row(scale, 0)
    nx, ny, nz = load_three(plane, 0)
    ux, uy, uz, vx, vy, vz = tangents_of_eight(nx, ny, nz)
    nx, ny, nz = nx * per, ny * per, nz * per
    ux, uy, uz, vx, vy, vz = ux * per, uy * per, uz * per, vx * per, vy * per, vz * per
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    zero = spread(0.0)
    sx, sy, sxx, sxy, syy, sxxx, sxxy, sxyy, syyy = zero, zero, zero, zero, zero, zero, zero, zero, zero
    s40, s31, s22, s13, s04 = zero, zero, zero, zero, zero
    sz, sxz, syz, sxxz, sxyz, syyz, szz = zero, zero, zero, zero, zero, zero, zero
    for i in range(count):
        a, b, c = load_row(xs, i), load_row(ys, i), load_row(zs, i)
        x, y, z = a * ux + b * uy + c * uz, a * vx + b * vy + c * vz, a * nx + b * ny + c * nz
        xx, xy, yy = x * x, x * y, y * y
        sx, sy, sxx, sxy, syy = sx + x, sy + y, sxx + xx, sxy + xy, syy + yy
        sxxx, sxxy = multiply_add(xx, x, sxxx), multiply_add(xx, y, sxxy)
        sxyy, syyy = multiply_add(x, yy, sxyy), multiply_add(yy, y, syyy)
        s40, s31, s22 = multiply_add(xx, xx, s40), multiply_add(xx, xy, s31), multiply_add(xx, yy, s22)
        s13, s04 = multiply_add(xy, yy, s13), multiply_add(yy, yy, s04)
        sz, sxz, syz, szz = sz + z, multiply_add(x, z, sxz), multiply_add(y, z, syz), multiply_add(z, z, szz)
        sxxz, sxyz, syyz = multiply_add(xx, z, sxxz), multiply_add(xy, z, sxyz), multiply_add(yy, z, syyz)
    store_rows(sums, 0, (sx, sy, sxx, sxy, syy, sxxx, sxxy, sxyy, syyy))
    store_rows(sums, 9, (s40, s31, s22, s13, s04))
    store_rows(sums, 14, (sz, sxz, syz, sxxz, sxyz, syyz, szz))


_POWER = np.array(  # which power of `_add_powers` a product of two of the terms 1, x, y, xx, xy, yy is; -1: the count
    [
        [-1, 0, 1, 2, 3, 4, 14],
        [0, 2, 3, 5, 6, 7, 15],
        [1, 3, 4, 6, 7, 8, 16],
        [2, 5, 6, 9, 10, 11, 17],
        [3, 6, 7, 10, 11, 12, 18],
        [4, 7, 8, 11, 12, 13, 19],
    ]
)


@routine
def fit_quadric(vectors, count, plane, scale, scratch, bent):
    """Fit z = f0 + f1 x + f2 y + f3 x^2 + f4 x y + f5 y^2 over the tangent plane, by Cholesky of the normal equations.

    Writes f3, f4, f5, in radii, and the squares left to `bent` (4 rows); `scratch` is (2, 42 rows).
    """
    sums, m = scratch[0], scratch[1]
    _add_powers(vectors, count, plane, scale, sums)
    for i in range(6):
        for j in range(i, 7):
            power = _POWER[i, j]
            store_row(m, 7 * i + j, spread(float(count)) if power < 0 else load_row(sums, power))
        # Half of it for x y, which the form holds twice: else the fit would depend on where x points.
        store_row(m, 8 * i, load_row(m, 8 * i) + (0.5 * _STIFF if i == 4 else _STIFF))
    left = load_row(sums, 20)
    for i in range(6):
        pivot = load_row(m, 8 * i)
        for k in range(i):
            above = load_row(m, 7 * k + i)
            pivot = pivot - above * above
        pivot = root(larger(pivot, 1e-12))
        store_row(m, 8 * i, pivot)
        for j in range(i + 1, 7):
            value = load_row(m, 7 * i + j)
            for k in range(i):
                value = value - load_row(m, 7 * k + i) * load_row(m, 7 * k + j)
            store_row(m, 7 * i + j, value / pivot)
        last = load_row(m, 7 * i + 6)
        left = left - last * last
    for i in range(5, 2, -1):
        value = load_row(m, 7 * i + 6)
        for j in range(i + 1, 6):
            value = value - load_row(m, 7 * i + j) * load_row(bent, j - 3)
        store_row(bent, i - 3, value / load_row(m, 8 * i))
    radius = load_row(scale, 0)
    store_row(bent, 3, larger(left, 0.0) * radius * radius)
