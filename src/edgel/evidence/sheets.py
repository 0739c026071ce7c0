"""Two planes that meet in a line, fitted to the neighbours at one scale: a hinge of any angle.

Neighbours on either side of the plane that bisects the two belong to one each, so that noise can't part them.
"""

from __future__ import annotations

import math

import numpy as np

from edgel.evidence.quadric import fit_quadric
from edgel.normals import smallest_eigenpair, tangents
from edgel.parallel import kernel, summing_kernel

ROUNDS = 3
NUM_FEATURES = 13
SHEETS = 24  # numbers that describe two planes: see `fit_sheets`
_MARGIN_NEIGHBORS = 16


@summing_kernel
def moments(vectors, count, px, py, pz, level, sums):
    """Sum 1, x, y, z, xx, xy, xz, yy, yz, zz over the neighbours beyond a plane into `sums` (10,)."""
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    n, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        x, y, z = xs[i], ys[i], zs[i]
        w = 1.0 if px * x + py * y + pz * z > level else 0.0
        n, mx, my, mz = n + w, mx + w * x, my + w * y, mz + w * z
        xx, xy, xz = xx + w * x * x, xy + w * x * y, xz + w * x * z
        yy, yz, zz = yy + w * y * y, yz + w * y * z, zz + w * z * z
    sums[0], sums[1], sums[2], sums[3], sums[4] = n, mx, my, mz, xx
    sums[5], sums[6], sums[7], sums[8], sums[9] = xy, xz, yy, yz, zz


@kernel
def plane_of(s, plane):
    """Fit a plane to points of moments `s` (10,): normal and centroid into `plane` (6,); returns the squares left."""
    n = s[0]
    mx, my, mz = s[1] / n, s[2] / n, s[3] / n
    smallest, _, nx, ny, nz = smallest_eigenpair(
        s[4] - s[1] * mx, s[5] - s[1] * my, s[6] - s[1] * mz, s[7] - s[2] * my, s[8] - s[2] * mz, s[9] - s[3] * mz
    )
    plane[0], plane[1], plane[2], plane[3], plane[4], plane[5] = nx, ny, nz, mx, my, mz
    return max(smallest, 0.0)


@kernel
def _bisect(a, b, line):
    """Find where planes a and b (6,) meet, and the plane that parts their centroids; false where they are parallel.

    Writes to `line` (10,): the line's direction, its point nearest to the origin, and the parting plane's normal and
    level.
    """
    dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    tx, ty, tz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    sine2 = tx * tx + ty * ty + tz * tz
    if sine2 < 1e-4:
        return False
    da = a[0] * a[3] + a[1] * a[4] + a[2] * a[5]
    db = b[0] * b[3] + b[1] * b[4] + b[2] * b[5]
    u, v = (da - db * dot) / sine2, (db - da * dot) / sine2
    fx, fy, fz = u * a[0] + v * b[0], u * a[1] + v * b[1], u * a[2] + v * b[2]
    length = math.sqrt(sine2)
    line[0], line[1], line[2] = tx / length, ty / length, tz / length
    line[3], line[4], line[5] = fx, fy, fz
    # Of the two bisecting planes, the one that parts the centroids.
    px, py, pz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    qx, qy, qz = a[0] + b[0], a[1] + b[1], a[2] + b[2]
    cx, cy, cz = a[3] - b[3], a[4] - b[4], a[5] - b[5]
    p, q = px * cx + py * cy + pz * cz, qx * cx + qy * cy + qz * cz
    if p * p * (qx * qx + qy * qy + qz * qz) < q * q * (px * px + py * py + pz * pz):
        px, py, pz, p = qx, qy, qz, q
    if p < 0.0:
        px, py, pz = -px, -py, -pz
    line[6], line[7], line[8], line[9] = px, py, pz, px * fx + py * fy + pz * fz
    return True


@kernel
def _refine(vectors, count, whole, start, sheets, room):
    """Part by a plane `start` (4,), fit, part again; returns the squares left, infinite where a side is too small.

    `whole` (10,) are the moments of all; `room` is (5, 10).
    """
    one, other, a, b, line = room[0], room[1], room[2], room[3], room[4]
    px, py, pz, level = start[0], start[1], start[2], start[3]
    best = np.inf
    for _turn in range(ROUNDS):
        moments(vectors, count, px, py, pz, level, one)
        for i in range(10):
            other[i] = whole[i] - one[i]
        if one[0] < 4.0 or other[0] < 4.0:
            break
        left = plane_of(one, a) + plane_of(other, b)
        if not left < best or not _bisect(a, b, line):
            break
        settled = left > 0.999 * best
        best = left
        sheets[0:3], sheets[3:6] = a[0:3], b[0:3]
        sheets[6:12] = line[0:6]
        sheets[12], sheets[13] = one[0], other[0]
        sheets[14:17], sheets[17:20] = a[3:6], b[3:6]
        sheets[20:24] = line[6:10]
        if settled:
            break
        px, py, pz, level = line[6], line[7], line[8], line[9]
    return best


@kernel
def _across_bend(normal, quadric, start):
    """Put the plane through the point across the direction in which the quadric bends most into `start` (4,)."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    angle = 0.5 * math.atan2(quadric[4], quadric[3] - quadric[5])
    c, s = math.cos(angle), math.sin(angle)
    along = quadric[3] * c * c + quadric[4] * c * s + quadric[5] * s * s
    across = quadric[3] * s * s - quadric[4] * c * s + quadric[5] * c * c
    if abs(across) > abs(along):
        c, s = -s, c
    start[0], start[1], start[2], start[3] = c * ux + s * vx, c * uy + s * vy, c * uz + s * vz, 0.0


@kernel
def _most_different(places, squared, count, normals):
    """Choose the two neighbours whose planes differ most, near and flat ones first; -1 where all are alike."""
    reach2 = squared[count - 1]
    a, best = 0, -1.0
    for i in range(count):
        score = normals[places[i], 3] * _nearness(2.0 * squared[i] / reach2)
        if score > best:
            a, best = i, score
    ax, ay, az = normals[places[a], 0], normals[places[a], 1], normals[places[a], 2]
    b, best = -1, 1e-6
    for i in range(count):
        p = places[i]
        cosine = abs(normals[p, 0] * ax + normals[p, 1] * ay + normals[p, 2] * az)
        score = normals[p, 3] * (1.0 - cosine) * _nearness(squared[i] / reach2)
        if score > best:
            b, best = i, score
    return a, b


@kernel
def _nearness(far2):
    """Fall off like a Gaussian of the distance: 1, 0.4, 0.14 at squares 0, 1, 2."""
    return 1.0 / (1.0 + far2 * (1.0 + 0.5 * far2 * (1.0 + far2 / 3.0)))


@kernel
def _of_neighbor(normals, place, vectors, i, plane):
    for axis in range(3):
        plane[axis], plane[3 + axis] = normals[place, axis], vectors[axis, i]


@summing_kernel
def _reaches(vectors, count, sheets, near):
    """How near the line those on either side come, squared, how far they reach, and how far along it: `near` (6,)."""
    tx, ty, tz, fx, fy, fz = sheets[6], sheets[7], sheets[8], sheets[9], sheets[10], sheets[11]
    px, py, pz, level = sheets[20], sheets[21], sheets[22], sheets[23]
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    near_a, near_b, far_a, far_b, low, high = 1e300, 1e300, 0.0, 0.0, 0.0, 0.0
    beside2 = near[0]
    for i in range(count):
        x, y, z = xs[i], ys[i], zs[i]
        dx, dy, dz = x - fx, y - fy, z - fz
        along = dx * tx + dy * ty + dz * tz
        across2 = dx * dx + dy * dy + dz * dz - along * along
        across2 = across2 if across2 > 0.0 else 0.0
        first = px * x + py * y + pz * z > level
        own, other = across2 if first else 1e300, 1e300 if first else across2
        near_a, near_b = own if own < near_a else near_a, other if other < near_b else near_b
        own, other = across2 if first else 0.0, 0.0 if first else across2
        far_a, far_b = own if own > far_a else far_a, other if other > far_b else far_b
        along = along if across2 < beside2 else 0.0
        low, high = along if along < low else low, along if along > high else high
    near[0], near[1], near[2], near[3], near[4], near[5] = near_a, near_b, far_a, far_b, low, high


@kernel
def _margin(vectors, count, spacing, sheets):
    """Least difference, over stretches of the line, of the point's distance and that of the nearest other, in spacings.

    Below zero a stretch of the line runs through the point's own cell.
    """
    margin = 2.0
    for step in range(-2, 3):
        shift = 0.3 * step * spacing
        x, y, z = sheets[9] + shift * sheets[6], sheets[10] + shift * sheets[7], sheets[11] + shift * sheets[8]
        nearest = np.inf
        for i in range(1, min(count, _MARGIN_NEIGHBORS)):
            dx, dy, dz = vectors[0, i] - x, vectors[1, i] - y, vectors[2, i] - z
            nearest = min(nearest, dx * dx + dy * dy + dz * dz)
        margin = min(margin, (math.sqrt(x * x + y * y + z * z) - math.sqrt(nearest)) / spacing)
    return margin


@kernel
def fit_sheets(vectors, places, squared, count, spacing, normals, room, features, sheets):
    """Fit two planes to the `count` nearest neighbours, and describe how well that explains them.

    Parameters: the neighbours (3, k) relative to the point, nearest first, their places and squared distances; the
    spacing; the planes fitted at each sorted point (N, 4) at a smaller scale; room (12, 24). Writes `features` (13,)
    and `sheets` (24,): both normals, the line's direction and its point nearest to the query, the number of neighbours
    of either and their centroids, and the plane (normal and level) that parts them.
    """
    features[:] = 0.0
    sheets[:] = 0.0
    radius = math.sqrt(squared[count - 1])
    if radius == 0.0 or spacing == 0.0:
        return
    whole, plane, quadric, start, fits = room[0, :10], room[1, :6], room[2], room[3, :4], room[4:9, :10]
    # The one plane and the quadric: what a smooth surface would leave.
    moments(vectors, count, 0.0, 0.0, 0.0, -1.0, whole)
    one = plane_of(whole, plane)
    bent = fit_quadric(vectors, count, plane, radius, quadric)
    _across_bend(plane, quadric, start)
    two = _refine(vectors, count, whole, start, sheets, fits)
    i, j = _most_different(places, squared, count, normals)
    if j >= 0:
        a, b, line, second = room[9], room[10], room[11, :10], room[1]
        _of_neighbor(normals, places[i], vectors, i, a)
        _of_neighbor(normals, places[j], vectors, j, b)
        if _bisect(a, b, line):
            start[0], start[1], start[2], start[3] = line[6], line[7], line[8], line[9]
            other = _refine(vectors, count, whole, start, second, fits)
            if other < two:
                two = other
                sheets[:] = second
    rms_one, rms_bent = math.sqrt(one / count) / spacing, math.sqrt(bent / count) / spacing
    features[0] = math.log(rms_one + 0.01)
    features[1] = math.log(rms_bent + 0.01)
    if not two < np.inf:
        features[2] = features[0]
        features[5:8] = 4.0
        features[11] = 2.0
        return
    rms_two = math.sqrt(two / count) / spacing
    features[2] = math.log(rms_two + 0.01)
    cosine = abs(sheets[0] * sheets[3] + sheets[1] * sheets[4] + sheets[2] * sheets[5])
    features[3] = math.acos(min(cosine, 1.0))
    features[4] = min(sheets[12], sheets[13]) / count
    fx, fy, fz = sheets[9], sheets[10], sheets[11]
    away = math.sqrt(fx * fx + fy * fy + fz * fz) / spacing
    features[5] = min(away, 4.0)
    features[6] = min(abs(sheets[0] * fx + sheets[1] * fy + sheets[2] * fz) / spacing, 4.0)
    features[7] = min(abs(sheets[3] * fx + sheets[4] * fy + sheets[5] * fz) / spacing, 4.0)
    near = room[3]
    near[0] = 2.25 * spacing * spacing
    _reaches(vectors, count, sheets, near)
    features[8] = min(math.sqrt(max(near[0], near[1])) / spacing, 4.0)
    features[9] = math.sqrt(min(near[2], near[3])) / radius
    features[10] = min(-near[4], near[5]) / radius
    features[11] = min(_margin(vectors, count, spacing, sheets), 2.0) if away < 3.0 else 2.0
    features[12] = math.log((rms_two + 0.01) / (rms_bent + 0.01))
