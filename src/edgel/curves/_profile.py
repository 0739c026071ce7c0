"""The faces beside a curve in its profile: the plane across a line, or radius against height of a circle.

In the profile a plane, a cylinder and a cone are straight: unit normal (a, b), and a direction into the face along it.
"""

from __future__ import annotations

import math

from edgel._kernels.parallel import routine
from edgel.curves._circle import RADIUS, local

NEAR = 0.6
"""Spacings: points nearer to the edge could belong to either face."""


@routine
def in_profile(shape, x, y, z):
    """Return a place's coordinates across a shape, and the one along it."""
    a, b, c = local(shape, x, y, z)
    if shape[RADIUS] == 0.0:
        return a, b, c
    return math.sqrt(a * a + b * b) - shape[RADIUS], c, shape[RADIUS] * math.atan2(b, a)


@routine
def turn_to_profile(shape, x, y, z, nx, ny, nz):
    """Return the components of a vector at a place in the profile there."""
    u = nx * shape[3] + ny * shape[4] + nz * shape[5]
    v = nx * shape[6] + ny * shape[7] + nz * shape[8]
    if shape[RADIUS] == 0.0:
        return u, v
    a, b, _ = local(shape, x, y, z)
    rho = math.sqrt(a * a + b * b)
    return ((a * u + b * v) / rho if rho > 0.0 else 0.0), nx * shape[9] + ny * shape[10] + nz * shape[11]


@routine
def mean_normals(shape, rows, position, normals, faces):
    """Write the mean normals of both faces in the profile (2, 2); of length 0 where there is none."""
    for turn in range(3):
        fa = fb = sa = sb = 0.0
        for i in rows:
            x, y, z = position[i, 0], position[i, 1], position[i, 2]
            a, b = turn_to_profile(shape, x, y, z, normals[i, 0, 0], normals[i, 0, 1], normals[i, 0, 2])
            c, d = turn_to_profile(shape, x, y, z, normals[i, 1, 0], normals[i, 1, 1], normals[i, 1, 2])
            if not (math.isfinite(a) and math.isfinite(b)):
                continue
            if not (math.isfinite(c) and math.isfinite(d)):
                c, d = 0.0, 0.0
            if turn == 0:
                # To begin with, the pair that is surest: both across the curve.
                if a * a + b * b + c * c + d * d > fa * fa + fb * fb + sa * sa + sb * sb + 1e-3:
                    fa, fb, sa, sb = a, b, c, d
                continue
            straight = abs(a * faces[0, 0] + b * faces[0, 1]) + abs(c * faces[1, 0] + d * faces[1, 1])
            swapped = abs(c * faces[0, 0] + d * faces[0, 1]) + abs(a * faces[1, 0] + b * faces[1, 1])
            if swapped > straight:
                a, b, c, d = c, d, a, b
            one = 1.0 if a * faces[0, 0] + b * faces[0, 1] >= 0.0 else -1.0
            two = 1.0 if c * faces[1, 0] + d * faces[1, 1] >= 0.0 else -1.0
            fa, fb, sa, sb = fa + one * a, fb + one * b, sa + two * c, sb + two * d
        first, second = math.sqrt(fa * fa + fb * fb), math.sqrt(sa * sa + sb * sb)
        faces[0, 0], faces[0, 1] = (fa / first, fb / first) if first > 0.2 else (0.0, 0.0)
        faces[1, 0], faces[1, 1] = (sa / second, sb / second) if second > 0.2 else (0.0, 0.0)
    # Two nearly equal ones are one face.
    if abs(faces[0, 0] * faces[1, 1] - faces[0, 1] * faces[1, 0]) < 0.1:
        faces[1, 0], faces[1, 1] = 0.0, 0.0


@routine
def choose_sides(profile, h, tolerance, faces, inward):
    """Write for each face (2, 2) on which side of the edge it lies: the one with more points."""
    for k in range(2):
        a, b = -faces[k, 1], faces[k, 0]
        ahead = behind = 0.0
        for i in range(len(profile)):
            off = faces[k, 0] * profile[i, 0] + faces[k, 1] * profile[i, 1]
            along = a * profile[i, 0] + b * profile[i, 1]
            if abs(off) > tolerance:
                continue
            weight = 1.0 - (off / tolerance) ** 2
            if 0.8 * h < along:
                ahead += weight
            elif along < -0.8 * h:
                behind += weight
        sign = 1.0 if ahead >= behind else -1.0
        inward[k, 0], inward[k, 1] = sign * a, sign * b


@routine
def face_of(a, b, h, tolerance, reach, faces, inward, bend):
    """Return which face a point of the profile belongs to, its distance from it, and how far along it: -1 for none."""
    found, least, far = -1, tolerance, 0.0
    for k in range(2):
        if faces[k, 0] == 0.0 and faces[k, 1] == 0.0:
            continue
        along = inward[k, 0] * a + inward[k, 1] * b
        if along < NEAR * h or along > reach * h:
            continue
        off = faces[k, 0] * a + faces[k, 1] * b - bend[k] * along * along
        if abs(off) < abs(least):
            found, least, far = k, off, along
    return found, least, far
