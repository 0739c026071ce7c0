"""Two planes through the point itself, each spanned with two of its neighbours.

Minimal samples average nothing away: the test works on plates little thicker than the spacing, and suffers under noise.
"""

from __future__ import annotations

import math

import numpy as np

from edgel.parallel import kernel

_SPANNING = 10  # nearest ones that span planes
FITS = ((11, 0.08), (21, 0.15), (21, 0.3))  # neighbours that vote, and how far from a plane inliers lie, in spacings
NUM_FEATURES = 5
_ASIDE = 0.4  # nearer to the line, in spacings, an inlier lies on no side of it
_FLAT = 0.3  # neighbours in line with the point, area below this many spacings squared, span no plane


@kernel
def planes_through(vectors, count, spacing, inlier, cos_min, features):
    """Describe the two best planes through a point that differ by the least angle or more.

    Takes the neighbours (count, 3) relative to the point, nearest first; its spacing; how far from a plane its inliers
    lie at most, in spacings; the cosine of the least angle. Writes to `features` (5,): the angle between the planes,
    their support, and how evenly the inliers of each lie on both sides of their line: a smooth bend has inliers of its
    tangent plane on both, a face only on its own.
    """
    features[:] = 0.0
    tolerance = inlier * spacing
    a, b = np.zeros(3), np.zeros(3)
    features[1] = _best_plane(vectors, count, spacing, tolerance, a, 2.0, a)
    features[2] = _best_plane(vectors, count, spacing, tolerance, a, cos_min, b)
    lx, ly, lz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    length = math.sqrt(lx * lx + ly * ly + lz * lz)
    if features[2] == 0.0 or length == 0.0:
        features[3] = features[4] = 1.0
        return
    lx, ly, lz = lx / length, ly / length, lz / length
    features[0] = math.acos(min(abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]), 1.0))
    features[3] = _balance(vectors, count, tolerance, spacing, a, lx, ly, lz)
    features[4] = _balance(vectors, count, tolerance, spacing, b, lx, ly, lz)


@kernel
def _best_plane(vectors, count, spacing, tolerance, other, cos_min, plane):
    """Put the normal of the best supported plane through the point into `plane` and return its support.

    Planes within the least angle of `other`, and points that lie in it, are left out; a zero vector leaves out none.
    """
    first = other[0] == 0.0 and other[1] == 0.0 and other[2] == 0.0
    best = 0.0
    nx, ny, nz = 0.0, 0.0, 0.0
    for i in range(1, min(_SPANNING + 1, count)):
        for j in range(i + 1, min(_SPANNING + 1, count)):
            x = vectors[i, 1] * vectors[j, 2] - vectors[i, 2] * vectors[j, 1]
            y = vectors[i, 2] * vectors[j, 0] - vectors[i, 0] * vectors[j, 2]
            z = vectors[i, 0] * vectors[j, 1] - vectors[i, 1] * vectors[j, 0]
            area = math.sqrt(x * x + y * y + z * z)
            if not area > _FLAT * spacing * spacing:  # not even where all are one point
                continue
            x, y, z = x / area, y / area, z / area
            if not first and abs(x * other[0] + y * other[1] + z * other[2]) > cos_min:
                continue
            score = 0.0
            for k in range(1, count):
                vx, vy, vz = vectors[k, 0], vectors[k, 1], vectors[k, 2]
                if not first and abs(vx * other[0] + vy * other[1] + vz * other[2]) < tolerance:
                    continue
                off = abs(vx * x + vy * y + vz * z)
                if off < tolerance:
                    score += 1.0 - 0.5 * off / tolerance
            if score > best:
                best, nx, ny, nz = score, x, y, z
    plane[0], plane[1], plane[2] = nx, ny, nz
    return best


@kernel
def _balance(vectors, count, tolerance, spacing, plane, lx, ly, lz):
    """Of a plane's inliers beside a line in it: those on the emptier side over those on the fuller."""
    tx, ty, tz = plane[1] * lz - plane[2] * ly, plane[2] * lx - plane[0] * lz, plane[0] * ly - plane[1] * lx
    left, right = 0, 0
    for k in range(1, count):
        vx, vy, vz = vectors[k, 0], vectors[k, 1], vectors[k, 2]
        if abs(vx * plane[0] + vy * plane[1] + vz * plane[2]) < tolerance:
            across = vx * tx + vy * ty + vz * tz
            if across > _ASIDE * spacing:
                left += 1
            elif across < -_ASIDE * spacing:
                right += 1
    return min(left, right) / max(left, right, 1)
