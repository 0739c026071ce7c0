"""Two planes through the point itself, each spanned with two of its neighbours.

Minimal samples average nothing away: the test works on plates little thicker than the spacing, and suffers under noise.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import routine

SPANNING = 10  # nearest ones that span planes
PLANES = SPANNING * (SPANNING - 1) // 2
VOTERS = 21  # neighbours that vote, the point itself among them
FITS = ((11, 0.08), (21, 0.15), (21, 0.3))  # neighbours that vote, and how far from a plane inliers lie, in spacings

ANGLE, FIRST_SUPPORT, SECOND_SUPPORT, FIRST_BALANCE, SECOND_BALANCE = range(5)
FEATURES = {
    "angle": "angle between the two best planes, radians; 0 where there is only one",
    "first_support": "weighted inliers of the better one",
    "second_support": "weighted inliers of the other, those of the better one left out",
    "first_balance": "inliers on the emptier side of the line in which they meet, over those on the fuller",
    "second_balance": "the same of the other",
}
NUM_FEATURES = len(FEATURES)
_ASIDE = 0.4  # nearer to the line, in spacings, an inlier lies on no side of it
_FLAT = 0.3  # neighbours in line with the point, area below this many spacings squared, span no plane


@routine
def span_planes(vectors, spacing, planes, off):
    """Span planes (3, PLANES) float32 by the point with two neighbours, and measure how far off the others lie.

    `off` (VOTERS, PLANES) float32 is in spacings; planes of neighbours in line with the point are 0.
    """
    k = vectors.shape[1]
    near = min(SPANNING + 1, k)
    plane = 0
    planes[:] = 0.0
    for i in range(1, near):
        for j in range(i + 1, near):
            x = vectors[1, i] * vectors[2, j] - vectors[2, i] * vectors[1, j]
            y = vectors[2, i] * vectors[0, j] - vectors[0, i] * vectors[2, j]
            z = vectors[0, i] * vectors[1, j] - vectors[1, i] * vectors[0, j]
            area = math.sqrt(x * x + y * y + z * z)
            if area > _FLAT * spacing * spacing:  # not even where all are one point
                planes[0, plane], planes[1, plane], planes[2, plane] = x / area, y / area, z / area
            plane += 1
    nx, ny, nz = planes[0], planes[1], planes[2]
    for v in range(1, min(VOTERS, k)):
        x, y, z = vectors[0, v] / spacing, vectors[1, v] / spacing, vectors[2, v] / spacing
        x, y, z = np.float32(x), np.float32(y), np.float32(z)
        row = off[v]
        for p in range(PLANES):  # all planes at once, by SIMD
            row[p] = abs(x * nx[p] + y * ny[p] + z * nz[p])


@routine
def planes_through(vectors, count, spacing, inlier, cos_min, planes, off, score, features):
    """Describe the two best planes through a point that differ by the least angle or more.

    Takes the neighbours (3, k) relative to the point, nearest first, of which `count` vote; its spacing; how far from a
    plane its inliers lie at most, in spacings; the cosine of the least angle; what `span_planes` found; `score`, a
    scratch buffer (PLANES,) float32. Writes `FEATURES` to `features`. The balance tells bends from faces: a smooth bend
    has inliers of its tangent plane on both sides of the line, a face only on its own.
    """
    features[:] = 0.0
    count = min(count, vectors.shape[1])
    a = _best_plane(count, inlier, cos_min, planes, off, -1, score)
    features[FIRST_SUPPORT] = score[a] if a >= 0 else 0.0
    b = _best_plane(count, inlier, cos_min, planes, off, a, score)
    features[SECOND_SUPPORT] = score[b] if b >= 0 else 0.0
    if a < 0 or b < 0:
        features[FIRST_BALANCE] = features[SECOND_BALANCE] = 1.0
        return
    na, nb = planes[:, a], planes[:, b]
    lx, ly, lz = na[1] * nb[2] - na[2] * nb[1], na[2] * nb[0] - na[0] * nb[2], na[0] * nb[1] - na[1] * nb[0]
    length = math.sqrt(lx * lx + ly * ly + lz * lz)
    if length == 0.0:
        features[FIRST_BALANCE] = features[SECOND_BALANCE] = 1.0
        return
    lx, ly, lz = lx / length, ly / length, lz / length
    features[ANGLE] = math.acos(min(abs(na[0] * nb[0] + na[1] * nb[1] + na[2] * nb[2]), 1.0))
    features[FIRST_BALANCE] = _balance(vectors, count, inlier, spacing, na, off[:, a], lx, ly, lz)
    features[SECOND_BALANCE] = _balance(vectors, count, inlier, spacing, nb, off[:, b], lx, ly, lz)


@routine
def _best_plane(count, inlier, cos_min, planes, off, other, score):
    """Return which plane is best supported, -1 for none; `score` (PLANES,) becomes the support of each.

    Planes within the least angle of the plane `other`, and points that lie in it, are left out.
    """
    score[:] = 0.0
    limit, slope = np.float32(inlier), np.float32(0.5 / inlier)
    for v in range(1, count):
        if other >= 0 and off[v, other] < limit:
            continue
        row = off[v]
        for p in range(PLANES):
            score[p] += np.float32(1.0) - slope * row[p] if row[p] < limit else np.float32(0.0)
    best, most = -1, np.float32(0.0)
    for p in range(PLANES):
        x, y, z = planes[0, p], planes[1, p], planes[2, p]
        apart = other < 0 or abs(x * planes[0, other] + y * planes[1, other] + z * planes[2, other]) <= cos_min
        if apart and score[p] > most and (x != 0.0 or y != 0.0 or z != 0.0):
            best, most = p, score[p]
    return best


@routine
def _balance(vectors, count, inlier, spacing, plane, off, lx, ly, lz):
    """Of a plane's inliers beside a line in it: those on the emptier side over those on the fuller."""
    tx, ty, tz = plane[1] * lz - plane[2] * ly, plane[2] * lx - plane[0] * lz, plane[0] * ly - plane[1] * lx
    left, right = 0, 0
    for k in range(1, count):
        if off[k] < inlier:
            across = vectors[0, k] * tx + vectors[1, k] * ty + vectors[2, k] * tz
            if across > _ASIDE * spacing:
                left += 1
            elif across < -_ASIDE * spacing:
                right += 1
    return min(left, right) / max(left, right, 1)
