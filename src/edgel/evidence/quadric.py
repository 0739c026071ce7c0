"""A quadric over the tangent plane: what a smooth surface would leave of the neighbours."""

from __future__ import annotations

import math

import numpy as np

from edgel.normals import tangents
from edgel.parallel import kernel, summing_kernel

_STIFF = 1e-4  # on the diagonal, so that what the neighbours leave open is small


@summing_kernel
def _powers(vectors, count, normal, radius, sums):
    """Sum the powers of x and y up to the fourth over the tangent plane, in radii, and those times z: `sums` (22,)."""
    nx, ny, nz = normal[0] / radius, normal[1] / radius, normal[2] / radius
    ux, uy, uz, vx, vy, vz = tangents(normal[0], normal[1], normal[2])
    ux, uy, uz, vx, vy, vz = ux / radius, uy / radius, uz / radius, vx / radius, vy / radius, vz / radius
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0
    sxxx, sxxy, sxyy, syyy = 0.0, 0.0, 0.0, 0.0
    s40, s31, s22, s13, s04 = 0.0, 0.0, 0.0, 0.0, 0.0
    sz, sxz, syz, sxxz, sxyz, syyz, szz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        a, b, c = xs[i], ys[i], zs[i]
        x, y, z = a * ux + b * uy + c * uz, a * vx + b * vy + c * vz, a * nx + b * ny + c * nz
        xx, xy, yy = x * x, x * y, y * y
        sx, sy, sxx, sxy, syy = sx + x, sy + y, sxx + xx, sxy + xy, syy + yy
        sxxx, sxxy, sxyy, syyy = sxxx + xx * x, sxxy + xx * y, sxyy + x * yy, syyy + yy * y
        s40, s31, s22, s13, s04 = s40 + xx * xx, s31 + xx * xy, s22 + xx * yy, s13 + xy * yy, s04 + yy * yy
        sz, sxz, syz, szz = sz + z, sxz + x * z, syz + y * z, szz + z * z
        sxxz, sxyz, syyz = sxxz + xx * z, sxyz + xy * z, syyz + yy * z
    sums[0], sums[1], sums[2], sums[3], sums[4] = sx, sy, sxx, sxy, syy
    sums[5], sums[6], sums[7], sums[8] = sxxx, sxxy, sxyy, syyy
    sums[9], sums[10], sums[11], sums[12], sums[13] = s40, s31, s22, s13, s04
    sums[14], sums[15], sums[16], sums[17], sums[18], sums[19], sums[20] = sz, sxz, syz, sxxz, sxyz, syyz, szz


_POWER = np.array(  # which power of `_powers` a product of two of the terms 1, x, y, xx, xy, yy is; -1: the count
    [
        [-1, 0, 1, 2, 3, 4, 14],
        [0, 2, 3, 5, 6, 7, 15],
        [1, 3, 4, 6, 7, 8, 16],
        [2, 5, 6, 9, 10, 11, 17],
        [3, 6, 7, 10, 11, 12, 18],
        [4, 7, 8, 11, 12, 13, 19],
    ]
)


@kernel
def fit_quadric(vectors, count, normal, radius, quadric):
    """Fit z = f0 + f1 x + f2 y + f3 x^2 + f4 x y + f5 y^2 over the tangent plane; returns the squares left.

    Lengths in radii: `quadric` (6,) too. The normal equations, solved by Cholesky.
    """
    sums, m = np.empty(22), np.empty((6, 7))
    _powers(vectors, count, normal, radius, sums)
    for i in range(6):
        for j in range(i, 7):
            m[i, j] = float(count) if _POWER[i, j] < 0 else sums[_POWER[i, j]]
        m[i, i] += _STIFF
    dot = 0.0
    for i in range(6):
        pivot = m[i, i]
        for k in range(i):
            pivot -= m[k, i] * m[k, i]
        pivot = math.sqrt(max(pivot, 1e-12))
        m[i, i] = pivot
        for j in range(i + 1, 7):
            value = m[i, j]
            for k in range(i):
                value -= m[k, i] * m[k, j]
            m[i, j] = value / pivot
        dot += m[i, 6] * m[i, 6]
    for i in range(5, -1, -1):
        value = m[i, 6]
        for j in range(i + 1, 6):
            value -= m[i, j] * quadric[j]
        quadric[i] = value / m[i, i]
    return max(sums[20] - dot, 0.0) * radius * radius
