"""Crease test 3: a hinge fits the neighbourhood better than a quadric, and its line passes near the point.

Least squares over all neighbours average noise away.
"""

from __future__ import annotations

import math

import numpy as np

from edgel.parallel import kernel

NEIGHBORS = 17  # of the fit, the point among them
_DIRECTIONS = 12  # of the hinge line that are tried, over half a turn
_OFFSETS = 13  # of the line that are tried, over 0.9 of the neighbourhood's radius
_ANGLE = math.radians(30.0)
_REACH = 0.35  # how far from the point the line may pass, in spacings
_FADE = 0.8  # how much less the farthest neighbour weighs


@kernel
def hinge_angle(vectors, count, spacing, nx, ny, nz, room):
    """Return by how much the surface turns at a hinge through the point in radians, 0 where there is none.

    Takes the neighbours (count, 3) relative to the point, nearest first; its spacing; the normal of their plane fit;
    and room (6, 7) to work in.
    """
    radius = math.sqrt(vectors[count - 1, 0] ** 2 + vectors[count - 1, 1] ** 2 + vectors[count - 1, 2] ** 2) * 1.0001
    if radius == 0.0:
        return 0.0
    if abs(nx) < 0.9:
        ux, uy, uz = 1.0 - nx * nx, -nx * ny, -nx * nz
    else:
        ux, uy, uz = -ny * nx, 1.0 - ny * ny, -ny * nz
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux / length, uy / length, uz / length
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    local = np.empty((count, 4))
    for k in range(count):
        qx, qy, qz = vectors[k, 0] / radius, vectors[k, 1] / radius, vectors[k, 2] / radius
        local[k, 0] = qx * ux + qy * uy + qz * uz
        local[k, 1] = qx * vx + qy * vy + qz * vz
        local[k, 2] = qx * nx + qy * ny + qz * nz
        local[k, 3] = 1.0 - _FADE * (qx * qx + qy * qy + qz * qz)
    best, angle, offset = np.inf, 0.0, 0.0
    for i in range(_DIRECTIONS):
        c, s = math.cos(math.pi * i / _DIRECTIONS), math.sin(math.pi * i / _DIRECTIONS)
        for j in range(_OFFSETS):
            o = (j - (_OFFSETS - 1) / 2) * 0.9 / (_OFFSETS - 1)
            residual = _hinge_fit(local, c, s, o, room)
            if residual < best:
                best, offset = residual, o
                angle = abs(math.atan(room[1, 4] + room[3, 4]) - math.atan(room[1, 4] - room[3, 4]))
    if angle < _ANGLE or abs(offset) * radius >= _REACH * spacing or _quadric_fit(local, room) <= best:
        return 0.0
    return angle


@kernel
def _hinge_fit(local, c, s, o, room):
    """Fit z = f0 + f1 t + f2 w + f3 |t - o|, t and w along and across (c, s); the solution goes to room[:4, 4]."""
    room[:4, :5] = 0.0
    total = 0.0
    for k in range(local.shape[0]):
        t = c * local[k, 0] + s * local[k, 1]
        w = c * local[k, 1] - s * local[k, 0]
        bend = abs(t - o)
        z, weight = local[k, 2], local[k, 3]
        total += weight * z * z
        wt, ww, wb = weight * t, weight * w, weight * bend
        room[0, 0] += weight
        room[0, 1] += wt
        room[0, 2] += ww
        room[0, 3] += wb
        room[1, 1] += wt * t
        room[1, 2] += wt * w
        room[1, 3] += wt * bend
        room[2, 2] += ww * w
        room[2, 3] += ww * bend
        room[3, 3] += wb * bend
        room[0, 4] += weight * z
        room[1, 4] += wt * z
        room[2, 4] += ww * z
        room[3, 4] += wb * z
    return _solved(room, 4, total)


@kernel
def _quadric_fit(local, room):
    """Fit z = f0 + f1 x + f2 y + f3 x^2 + f4 x y + f5 y^2 and return the weighted squares that are left."""
    terms = np.empty(6)
    room[:, :] = 0.0
    total = 0.0
    for k in range(local.shape[0]):
        x, y, z, weight = local[k, 0], local[k, 1], local[k, 2], local[k, 3]
        terms[0], terms[1], terms[2], terms[3], terms[4], terms[5] = 1.0, x, y, x * x, x * y, y * y
        total += weight * z * z
        for i in range(6):
            for j in range(i, 6):
                room[i, j] += weight * terms[i] * terms[j]
            room[i, 6] += weight * terms[i] * z
    return _solved(room, 6, total)


@kernel
def _solved(room, size, total):
    """Solve the normal equations in the upper triangle by Cholesky, in place; return the squares that are left.

    A little is added to the diagonal, so that what the neighbours leave open is small and not undefined.
    """
    right = size  # the column of the right-hand side, and of the solution
    dot = 0.0
    for i in range(size):
        room[i, i] += 1e-6
    for i in range(size):
        pivot = room[i, i]
        for k in range(i):
            pivot -= room[k, i] * room[k, i]
        pivot = math.sqrt(max(pivot, 1e-12))
        room[i, i] = pivot
        value = room[i, right]
        for k in range(i):
            value -= room[k, i] * room[k, right]
        room[i, right] = value / pivot
        dot += room[i, right] * room[i, right]
        for j in range(i + 1, size):
            value = room[i, j]
            for k in range(i):
                value -= room[k, i] * room[k, j]
            room[i, j] = value / pivot
    for i in range(size - 1, -1, -1):
        value = room[i, right]
        for j in range(i + 1, size):
            value -= room[i, j] * room[j, right]
        room[i, right] = value / room[i, i]
    return total - dot
