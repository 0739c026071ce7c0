"""Eigenvalues of symmetric matrices: the smallest of 3 x 3, of one and of eight in step, and all of any size."""

from __future__ import annotations

import math

from edgel._kernels.frames import across, across_of_eight
from edgel._kernels.parallel import part, routine
from edgel._kernels.simd import larger, root, spread, where

_EQUAL = 1e-7  # of the trace: eigenvalues nearer each other than that are not told apart
_SWEEPS = 30  # of Jacobi's rotations: far more than are taken
_SETTLED = 1e-24  # of a matrix's squares: what may be left beside its diagonal


@routine
def smallest_eigenpair(xx, xy, xz, yy, yz, zz):
    """Return the smallest and the middle eigenvalue of a symmetric 3 x 3 matrix, and the former's unit eigenvector.

    Closed form (Smith 1961, doi:10.1145/355578.366316), then Rayleigh quotients, which undo the rounding of the arccos.
    """
    scale = max(abs(xx), abs(yy), abs(zz), abs(xy), abs(xz), abs(yz))
    if scale == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 1.0
    xx, xy, xz, yy, yz, zz = xx / scale, xy / scale, xz / scale, yy / scale, yz / scale, zz / scale
    mean = (xx + yy + zz) / 3.0
    dx, dy, dz = xx - mean, yy - mean, zz - mean
    p = math.sqrt((dx * dx + dy * dy + dz * dz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if p < 1e-100:  # three equal eigenvalues
        return mean * scale, mean * scale, 0.0, 0.0, 1.0
    det = dx * (dy * dz - yz * yz) - xy * (xy * dz - yz * xz) + xz * (xy * yz - dy * xz)
    angle = math.acos(min(max(det / (2.0 * p * p * p), -1.0), 1.0)) / 3.0
    largest = mean + 2.0 * p * math.cos(angle)
    smallest = mean + 2.0 * p * math.cos(angle + 2.0943951023931953)
    # At rank 1 the longest row is the largest eigenvector.
    x, y, z = across(*_longest_row(xx - smallest, xy, xz, yy - smallest, yz, zz - smallest))
    for step in range(4):
        a, b, c = xx - smallest, yy - smallest, zz - smallest
        # Every column of the adjugate of A - lambda I points along the eigenvector; the longest is the safest.
        ax, ay, az = b * c - yz * yz, a * c - xz * xz, a * b - xy * xy
        kxy, kxz, kyz = xz * yz - xy * c, xy * yz - xz * b, xy * xz - yz * a
        if abs(ax) >= abs(ay) and abs(ax) >= abs(az):
            u, v, w = ax, kxy, kxz
        elif abs(ay) >= abs(az):
            u, v, w = kxy, ay, kyz
        else:
            u, v, w = kxz, kyz, az
        length = math.sqrt(u * u + v * v + w * w)
        if length > 1e-14 * p * p:
            x, y, z = u / length, v / length, w / length
        elif step > 0:  # the two smallest are equal: any direction across the largest will do
            break
        smallest = x * (xx * x + xy * y + xz * z) + y * (xy * x + yy * y + yz * z) + z * (xz * x + yz * y + zz * z)
    middle = 3.0 * mean - smallest - largest
    if middle < smallest:  # so near each other that the other one was found: turn to the direction across
        u, v, w = _longest_row(xx - smallest, xy, xz, yy - smallest, yz, zz - smallest)
        u, v, w = y * w - z * v, z * u - x * w, x * v - y * u
        length = math.sqrt(u * u + v * v + w * w)
        if length > 0.0:
            x, y, z, middle = u / length, v / length, w / length, smallest
            smallest = x * (xx * x + xy * y + xz * z) + y * (xy * x + yy * y + yz * z) + z * (xz * x + yz * y + zz * z)
    return smallest * scale, middle * scale, x, y, z


@routine
def _longest_row(a, xy, xz, b, yz, c):
    """Return the longest row of a symmetric matrix."""
    u, v, w = a, xy, xz
    if b * b + yz * yz + xy * xy > u * u + v * v + w * w:
        u, v, w = xy, b, yz
    if c * c + yz * yz + xz * xz > u * u + v * v + w * w:
        u, v, w = xz, yz, c
    return u, v, w


@part
def _longer(a, b, c, u, v, w):
    """The longer of two vectors in each lane."""
    second = u * u + v * v + w * w > a * a + b * b + c * c
    return where(second, u, a), where(second, v, b), where(second, w, c)


@part
def smallest_eigenpairs(xx, xy, xz, yy, yz, zz):
    """Smallest and middle eigenvalue of eight positive semidefinite matrices, and unit eigenvectors of the former.

    `smallest_eigenpair` in step. There is no arccos in step, so Laguerre's method climbs to the smallest
    root of the characteristic polynomial instead, from 0; then Rayleigh quotients undo its rounding.
    """
    zero, tiny = spread(0.0), spread(1e-300)
    scale = larger(xx + yy + zz, tiny)
    inverse = 1.0 / scale
    xx, xy, xz, yy, yz, zz = xx * inverse, xy * inverse, xz * inverse, yy * inverse, yz * inverse, zz * inverse
    trace = xx + yy + zz
    minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz
    det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    smallest = zero
    for _ in range(4):
        value = ((smallest - trace) * smallest + minors) * smallest - det
        slope = (3.0 * smallest - 2.0 * trace) * smallest + minors
        bend = 6.0 * smallest - 2.0 * trace
        under = larger(4.0 * slope * slope - 6.0 * value * bend, zero)
        below = slope + root(under)
        # Where two roots are equal but for rounding, both are near enough already, and the quotient would be noise.
        smallest = smallest - where(below > _EQUAL, 3.0 * value / larger(below, tiny), zero)
    # A vector across the longest row of the matrix less its smallest eigenvalue: at rank 1, across the largest.
    a, b, c = xx - smallest, yy - smallest, zz - smallest
    u, v, w = _longer(a, xy, xz, xy, b, yz)
    u, v, w = _longer(u, v, w, xz, yz, c)
    x, y, z = across_of_eight(u, v, w)
    for _ in range(4):
        a, b, c = xx - smallest, yy - smallest, zz - smallest
        # Every column of the adjugate of A - lambda I points along the eigenvector; the longest is the safest.
        kxy, kxz, kyz = xz * yz - xy * c, xy * yz - xz * b, xy * xz - yz * a
        u, v, w = _longer(b * c - yz * yz, kxy, kxz, kxy, a * c - xz * xz, kyz)
        u, v, w = _longer(u, v, w, kxz, kyz, a * b - xy * xy)
        length = root(u * u + v * v + w * w)
        good = length > 1e-14  # else the two smallest are equal: any direction across the largest will do
        length = 1.0 / larger(length, tiny)
        x, y, z = where(good, u * length, x), where(good, v * length, y), where(good, w * length, z)
        smallest = x * (xx * x + xy * y + xz * z) + y * (xy * x + yy * y + yz * z) + z * (xz * x + yz * y + zz * z)
    # The other two sum to the rest of the trace; their product is what is left of the minors.
    rest = trace - smallest
    product = minors - smallest * rest
    gap = root(larger(rest * rest - 4.0 * product, zero))
    return smallest * scale, 0.5 * (rest - gap) * scale, x, y, z


@routine
def turn_to_axes(matrix, vectors):
    """Make a symmetric matrix (K, K) diagonal in place, and write its eigenvectors, the columns of (K, K).

    Jacobi's rotations (Golub and Van Loan 2013, section 8.5); the whole matrix has to be given.
    """
    size, total = len(matrix), 0.0
    for i in range(size):
        for j in range(size):
            vectors[i, j] = 1.0 if i == j else 0.0
            total += matrix[i, j] * matrix[i, j]
    for _ in range(_SWEEPS):
        left = 0.0
        for p in range(size):
            for q in range(p):
                left += matrix[p, q] * matrix[p, q]
                if matrix[p, q] == 0.0:
                    continue
                half = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
                tangent = math.copysign(1.0, half) / (abs(half) + math.sqrt(half * half + 1.0))
                cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
                sine = tangent * cosine
                for k in range(size):
                    a, b = matrix[k, p], matrix[k, q]
                    matrix[k, p], matrix[k, q] = cosine * a - sine * b, sine * a + cosine * b
                for k in range(size):
                    a, b = matrix[p, k], matrix[q, k]
                    matrix[p, k], matrix[q, k] = cosine * a - sine * b, sine * a + cosine * b
                for k in range(size):
                    a, b = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = cosine * a - sine * b, sine * a + cosine * b
        if left <= _SETTLED * total:
            break
