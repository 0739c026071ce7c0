"""Lines and circles through points in space, by least squares."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.eigen import smallest_eigenpair
from edgel._kernels.frames import tangents
from edgel._kernels.parallel import routine

SHAPE = 13
"""Numbers of a shape: its origin (a line's middle, a circle's centre), three axes, and the radius, 0 of a line. The
third axis is the line's direction, or the circle's axis."""
RADIUS = 12
_ROUNDS = 4


@routine
def _moments(points, rows):
    """Return the mean of some rows of points, and the sums of squares and products about it."""
    count = len(rows)
    x = y = z = 0.0
    for i in rows:
        x, y, z = x + points[i, 0], y + points[i, 1], z + points[i, 2]
    x, y, z = x / count, y / count, z / count
    xx = xy = xz = yy = yz = zz = 0.0
    for i in rows:
        a, b, c = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        xx, xy, xz, yy, yz, zz = xx + a * a, xy + a * b, xz + a * c, yy + b * b, yz + b * c, zz + c * c
    return x, y, z, xx, xy, xz, yy, yz, zz


@routine
def fit_line(points, rows, shape):
    """Write the line through some rows of points, and return the mean of the squared distances."""
    count = len(rows)
    x, y, z, xx, xy, xz, yy, yz, zz = _moments(points, rows)
    total = xx + yy + zz
    smallest, middle, nx, ny, nz = smallest_eigenpair(xx, xy, xz, yy, yz, zz)
    # The largest eigenvector: in the plane across the smallest one, by the angle of the moments there.
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    iu, iv, iw = xx * ux + xy * uy + xz * uz, xy * ux + yy * uy + yz * uz, xz * ux + yz * uy + zz * uz
    uu, uv = ux * iu + uy * iv + uz * iw, vx * iu + vy * iv + vz * iw
    iu, iv, iw = xx * vx + xy * vy + xz * vz, xy * vx + yy * vy + yz * vz, xz * vx + yz * vy + zz * vz
    vv = vx * iu + vy * iv + vz * iw
    angle = 0.5 * math.atan2(2.0 * uv, uu - vv)
    c, s = math.cos(angle), math.sin(angle)
    dx, dy, dz = c * ux + s * vx, c * uy + s * vy, c * uz + s * vz
    set_frame(shape, x, y, z, dx, dy, dz)
    shape[RADIUS] = 0.0
    return max(smallest + middle, 0.0) / count if total > 0.0 else 0.0


@routine
def set_frame(shape, x, y, z, dx, dy, dz):
    """Write the origin and three axes, of which the third is given."""
    ux, uy, uz, vx, vy, vz = tangents(dx, dy, dz)
    shape[0], shape[1], shape[2] = x, y, z
    shape[3], shape[4], shape[5] = ux, uy, uz
    shape[6], shape[7], shape[8] = vx, vy, vz
    shape[9], shape[10], shape[11] = dx, dy, dz


@routine
def fit_circle(points, rows, shape):
    """Write the circle through some rows of points, and return the mean of the squared distances; inf if none fits."""
    count = len(rows)
    x, y, z, xx, xy, xz, yy, yz, zz = _moments(points, rows)
    _, _, nx, ny, nz = smallest_eigenpair(xx, xy, xz, yy, yz, zz)
    set_frame(shape, x, y, z, nx, ny, nz)
    # Kasa's circle in that plane: u^2 + v^2 = 2 a u + 2 b v + c; sums of u and v are 0.
    uu = uv = vv = wu = wv = square = 0.0
    for i in rows:
        px, py, pz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        u = px * shape[3] + py * shape[4] + pz * shape[5]
        v = px * shape[6] + py * shape[7] + pz * shape[8]
        q = u * u + v * v
        uu, uv, vv, wu, wv, square = uu + u * u, uv + u * v, vv + v * v, wu + q * u, wv + q * v, square + q
    det = uu * vv - uv * uv
    if not det > 1e-12 * square * square:
        return math.inf
    a, b = 0.5 * (wu * vv - wv * uv) / det, 0.5 * (wv * uu - wu * uv) / det
    r = math.sqrt(square / count + a * a + b * b)
    for _ in range(_ROUNDS):  # geometric distances: Kasa's circle is too small where a short arc is noisy
        aa = ab = bb = a1 = b1 = ra = rb = rr = 0.0
        for i in rows:
            px, py, pz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            u = px * shape[3] + py * shape[4] + pz * shape[5] - a
            v = px * shape[6] + py * shape[7] + pz * shape[8] - b
            rho = math.sqrt(u * u + v * v)
            if rho == 0.0:
                return math.inf
            u, v, off = u / rho, v / rho, rho - r
            aa, ab, bb, a1, b1 = aa + u * u, ab + u * v, bb + v * v, a1 + u, b1 + v
            ra, rb, rr = ra + u * off, rb + v * off, rr + off
        # Unknowns a, b, r; r is eliminated.
        saa, sab, sbb = aa - a1 * a1 / count, ab - a1 * b1 / count, bb - b1 * b1 / count
        sa, sb = ra - a1 * rr / count, rb - b1 * rr / count
        det = saa * sbb - sab * sab
        if not det > 1e-14 * count * count:
            return math.inf
        da, db = (sa * sbb - sb * sab) / det, (sb * saa - sa * sab) / det
        a, b, r = a + da, b + db, r + (rr - a1 * da - b1 * db) / count
        if not r > 0.0:
            return math.inf
    shape[0] += a * shape[3] + b * shape[6]
    shape[1] += a * shape[4] + b * shape[7]
    shape[2] += a * shape[5] + b * shape[8]
    shape[RADIUS] = r
    total = 0.0
    for i in rows:
        total += offset_of(shape, points[i, 0], points[i, 1], points[i, 2]) ** 2
    return total / count


def locals_of(shapes: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the coordinates, (N,) each, of places (N, 3) in the axes of shapes (N, 13), each in those of its own."""
    offset = places - shapes[:, :3]
    return tuple(np.einsum("ij,ij->i", offset, shapes[:, k : k + 3]) for k in (3, 6, 9))


def offsets_of(shapes: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return how far places (N, 3) are from shapes (N, 13), (N,), each from its own; NaN where it has none."""
    x, y, z = locals_of(shapes, places)
    rho = np.hypot(x, y)
    return np.where(shapes[:, RADIUS] == 0, rho, np.hypot(rho - shapes[:, RADIUS], z))


@routine
def offset_of(shape, x, y, z):
    """Return how far a place is from a shape."""
    a, b, c = local(shape, x, y, z)
    rho = math.sqrt(a * a + b * b)
    return rho if shape[RADIUS] == 0.0 else math.sqrt((rho - shape[RADIUS]) ** 2 + c * c)


@routine
def local(shape, x, y, z):
    """Return the coordinates of a place in the axes of a shape."""
    x, y, z = x - shape[0], y - shape[1], z - shape[2]
    return (
        x * shape[3] + y * shape[4] + z * shape[5],
        x * shape[6] + y * shape[7] + z * shape[8],
        x * shape[9] + y * shape[10] + z * shape[11],
    )


@routine
def along_of(shape, x, y, z):
    """Return how far along a shape a place is: from a line's origin, from a circle's first axis -pi r to pi r."""
    a, b, c = local(shape, x, y, z)
    return c if shape[RADIUS] == 0.0 else shape[RADIUS] * math.atan2(b, a)


@routine
def tangent_of(shape, x, y, z):
    """Return the unit tangent of a shape beside a place."""
    if shape[RADIUS] == 0.0:
        return shape[9], shape[10], shape[11]
    a, b, _ = local(shape, x, y, z)
    rho = math.sqrt(a * a + b * b)
    a, b = (a / rho, b / rho) if rho > 0.0 else (1.0, 0.0)
    return (
        a * shape[6] - b * shape[3],
        a * shape[7] - b * shape[4],
        a * shape[8] - b * shape[5],
    )


@routine
def lean(shape, by_u, by_v):
    """Lean the direction of a line, or the axis of a circle, by slopes along both axes across it."""
    u, v, w = shape[3:6], shape[6:9], shape[9:12]
    length, inside = math.sqrt(1.0 + by_u * by_u + by_v * by_v), 0.0
    for axis in range(3):
        w[axis] = (w[axis] + by_u * u[axis] + by_v * v[axis]) / length
        inside += w[axis] * u[axis]
    length = math.sqrt(1.0 - inside * inside)
    for axis in range(3):
        u[axis] = (u[axis] - inside * w[axis]) / length
    v[0], v[1], v[2] = w[1] * u[2] - w[2] * u[1], w[2] * u[0] - w[0] * u[2], w[0] * u[1] - w[1] * u[0]
