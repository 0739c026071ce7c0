"""Two planes that meet in a line, fitted to the neighbours at one scale: a hinge of any angle.

Neighbours on either side of the plane that bisects the two belong to one each, so that noise can't part them.
"""

from __future__ import annotations

import math

import numpy as np

from edgel.normals import smallest_eigenpair
from edgel.parallel import kernel

ROUNDS = 3
NUM_FEATURES = 13
SHEETS = 20  # numbers that describe two planes: see `fit_sheets`


@kernel
def _plane_of(vectors, count, side, want, plane):
    """Fit a plane to the neighbours whose `side` is `want`; returns their number and the sum of squares left.

    `plane` (6,) becomes normal and centroid.
    """
    mx, my, mz, n = 0.0, 0.0, 0.0, 0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        if side[i] == want:
            dx, dy, dz = vectors[i, 0], vectors[i, 1], vectors[i, 2]
            mx, my, mz, n = mx + dx, my + dy, mz + dz, n + 1
            xx, xy, xz = xx + dx * dx, xy + dx * dy, xz + dx * dz
            yy, yz, zz = yy + dy * dy, yz + dy * dz, zz + dz * dz
    if n < 3:
        return n, 0.0
    mx, my, mz = mx / n, my / n, mz / n
    smallest, _, nx, ny, nz = smallest_eigenpair(
        xx - n * mx * mx, xy - n * mx * my, xz - n * mx * mz, yy - n * my * my, yz - n * my * mz, zz - n * mz * mz
    )
    plane[0], plane[1], plane[2], plane[3], plane[4], plane[5] = nx, ny, nz, mx, my, mz
    return n, max(smallest, 0.0)


@kernel
def _bisect(vectors, count, a, b, side, sheets):
    """Part the neighbours by the plane that bisects planes a and b; false where these are parallel.

    Writes the line's direction and its point nearest to the origin to `sheets` [6:12].
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
    sheets[6], sheets[7], sheets[8] = tx / length, ty / length, tz / length
    sheets[9], sheets[10], sheets[11] = fx, fy, fz
    # Of the two bisecting planes, the one that parts the centroids.
    px, py, pz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    qx, qy, qz = a[0] + b[0], a[1] + b[1], a[2] + b[2]
    cx, cy, cz = a[3] - b[3], a[4] - b[4], a[5] - b[5]
    p, q = px * cx + py * cy + pz * cz, qx * cx + qy * cy + qz * cz
    p2, q2 = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz
    if p * p * q2 < q * q * p2:
        px, py, pz, p = qx, qy, qz, q
    if p < 0.0:
        px, py, pz = -px, -py, -pz
    level = px * fx + py * fy + pz * fz
    for i in range(count):
        across = px * vectors[i, 0] + py * vectors[i, 1] + pz * vectors[i, 2] - level
        side[i] = 0 if across > 0.0 else 1
    return True


@kernel
def _refine(vectors, count, side, sheets, room):
    """Fit, part, fit again; returns the squares left in all, infinite where a side runs out of neighbours."""
    a, b = room[0], room[1]
    best = np.inf
    for _turn in range(ROUNDS):
        n_a, left_a = _plane_of(vectors, count, side, 0, a)
        n_b, left_b = _plane_of(vectors, count, side, 1, b)
        if n_a < 4 or n_b < 4:
            break
        if left_a + left_b < best:
            if _bisect(vectors, count, a, b, side, room[2]):
                best = left_a + left_b
                sheets[0:3] = a[0:3]
                sheets[3:6] = b[0:3]
                sheets[6:12] = room[2, 6:12]
                sheets[12], sheets[13] = n_a, n_b
                sheets[14:17] = a[3:6]
                sheets[17:20] = b[3:6]
            else:
                break
        elif not _bisect(vectors, count, a, b, side, room[2]):
            break
    return best


@kernel
def _part_by_curvature(vectors, count, normal, quadric, side):
    """Part the neighbours by the plane through the point across the direction in which the quadric bends most."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    ux, uy, uz = tangent(nx, ny, nz)
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    angle = 0.5 * math.atan2(quadric[4], quadric[3] - quadric[5])
    c, s = math.cos(angle), math.sin(angle)
    along = quadric[3] * c * c + quadric[4] * c * s + quadric[5] * s * s
    across = quadric[3] * s * s - quadric[4] * c * s + quadric[5] * c * c
    if abs(across) > abs(along):
        c, s = -s, c
    dx, dy, dz = c * ux + s * vx, c * uy + s * vy, c * uz + s * vz
    for i in range(count):
        side[i] = 0 if dx * vectors[i, 0] + dy * vectors[i, 1] + dz * vectors[i, 2] > 0.0 else 1


@kernel
def tangent(nx, ny, nz):
    """Return a unit vector across a unit normal."""
    if abs(nx) <= abs(ny) and abs(nx) <= abs(nz):
        x, y, z = 0.0, nz, -ny
    elif abs(ny) <= abs(nz):
        x, y, z = -nz, 0.0, nx
    else:
        x, y, z = ny, -nx, 0.0
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return 1.0, 0.0, 0.0
    return x / length, y / length, z / length


@kernel
def _part_by_normals(places, squared, count, normals, side_planes, reach2):
    """Choose the two neighbours' planes that differ most, near and flat ones first; false where all are alike."""
    a, best = -1, -1.0
    for i in range(count):
        score = normals[places[i], 3] * math.exp(-squared[i] / (0.5 * reach2))
        if score > best:
            a, best = i, score
    pa = places[a]
    b, best = -1, 0.0
    for i in range(count):
        p = places[i]
        cosine = abs(normals[p, 0] * normals[pa, 0] + normals[p, 1] * normals[pa, 1] + normals[p, 2] * normals[pa, 2])
        score = normals[p, 3] * (1.0 - cosine) * math.exp(-squared[i] / reach2)
        if score > best:
            b, best = i, score
    side_planes[0], side_planes[1] = a, b
    return b >= 0 and best > 1e-6


@kernel
def _quadric(vectors, count, normal, radius, room, quadric):
    """Fit z = f0 + f1 x + f2 y + f3 x^2 + f4 x y + f5 y^2 over the tangent plane; returns the squares left.

    Lengths in radii. Solved by Cholesky with a little on the diagonal, so that what is open is small.
    """
    nx, ny, nz = normal[0], normal[1], normal[2]
    ux, uy, uz = tangent(nx, ny, nz)
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    terms = np.empty(6)
    room[:, :] = 0.0
    total = 0.0
    for i in range(count):
        x = (vectors[i, 0] * ux + vectors[i, 1] * uy + vectors[i, 2] * uz) / radius
        y = (vectors[i, 0] * vx + vectors[i, 1] * vy + vectors[i, 2] * vz) / radius
        z = (vectors[i, 0] * nx + vectors[i, 1] * ny + vectors[i, 2] * nz) / radius
        terms[0], terms[1], terms[2], terms[3], terms[4], terms[5] = 1.0, x, y, x * x, x * y, y * y
        total += z * z
        for j in range(6):
            for k in range(j, 6):
                room[j, k] += terms[j] * terms[k]
            room[j, 6] += terms[j] * z
    dot = 0.0
    for i in range(6):
        room[i, i] += 1e-4
    for i in range(6):
        pivot = room[i, i]
        for k in range(i):
            pivot -= room[k, i] * room[k, i]
        pivot = math.sqrt(max(pivot, 1e-12))
        room[i, i] = pivot
        for j in range(i + 1, 7):
            value = room[i, j]
            for k in range(i):
                value -= room[k, i] * room[k, j]
            room[i, j] = value / pivot
        dot += room[i, 6] * room[i, 6]
    for i in range(5, -1, -1):
        value = room[i, 6]
        for j in range(i + 1, 6):
            value -= room[i, j] * quadric[j]
        quadric[i] = value / room[i, i]
    return max(total - dot, 0.0) * radius * radius


@kernel
def fit_sheets(vectors, places, squared, count, spacing, normals, side, best_side, room, solve, features, sheets):
    """Fit two planes to the `count` nearest neighbours, and describe how well that explains them.

    Parameters: the neighbours (k, 3) relative to the point, nearest first, their places and squared distances; the
    spacing; the plane (4,) fitted to these neighbours; those fitted at each sorted point (N, 4) at a smaller scale;
    room. Writes `features` (13,) and `sheets` (20,): both normals, the line's direction and its point nearest to the
    query, the number of neighbours of either and their centroids.
    """
    features[:] = 0.0
    sheets[:] = 0.0
    radius2 = squared[count - 1]
    radius = math.sqrt(radius2)
    if radius == 0.0 or spacing == 0.0:
        return
    # The one plane and the quadric: what a smooth surface would leave.
    side[:count] = 0
    _, one = _plane_of(vectors, count, side, 0, room[3])
    quadric = room[4]
    bent = _quadric(vectors, count, room[3], radius, solve, quadric)
    _part_by_curvature(vectors, count, room[3], quadric, side)
    two = _refine(vectors, count, side, sheets, room)
    best_side[:count] = side[:count]
    chosen = room[5]
    if _part_by_normals(places, squared, count, normals, chosen, radius2):
        i, j = int(chosen[0]), int(chosen[1])
        room[0, 0:3] = normals[places[i], 0:3]
        room[1, 0:3] = normals[places[j], 0:3]
        room[0, 3:6] = vectors[i]
        room[1, 3:6] = vectors[j]
        if _bisect(vectors, count, room[0], room[1], side, room[2]):
            other = _refine(vectors, count, side, room[6], room)
            if other < two:
                two = other
                sheets[:] = room[6]
                best_side[:count] = side[:count]
    scale2 = spacing * spacing
    rms_one = math.sqrt(one / count / scale2)
    rms_bent = math.sqrt(bent / count / scale2)
    features[0] = math.log(rms_one + 0.01)
    features[1] = math.log(rms_bent + 0.01)
    if not two < np.inf:
        features[2] = features[0]
        features[5:8] = 4.0
        features[11] = 2.0
        return
    rms_two = math.sqrt(two / count / scale2)
    features[2] = math.log(rms_two + 0.01)
    cosine = abs(sheets[0] * sheets[3] + sheets[1] * sheets[4] + sheets[2] * sheets[5])
    features[3] = math.acos(min(cosine, 1.0))
    # How sharply: turn of the surface over what noise alone would turn it.
    n_a, n_b = sheets[12], sheets[13]
    features[4] = min(n_a, n_b) / count
    fx, fy, fz = sheets[9], sheets[10], sheets[11]
    tx, ty, tz = sheets[6], sheets[7], sheets[8]
    away = math.sqrt(fx * fx + fy * fy + fz * fz) / spacing
    features[5] = min(away, 4.0)
    features[6] = min(abs(sheets[0] * fx + sheets[1] * fy + sheets[2] * fz) / spacing, 4.0)
    features[7] = min(abs(sheets[3] * fx + sheets[4] * fy + sheets[5] * fz) / spacing, 4.0)
    # How near the line the neighbours of either plane come and how far they reach, along the line too.
    near_a, near_b, far_a, far_b, low, high = np.inf, np.inf, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        dx, dy, dz = vectors[i, 0] - fx, vectors[i, 1] - fy, vectors[i, 2] - fz
        along = dx * tx + dy * ty + dz * tz
        across = math.sqrt(max(dx * dx + dy * dy + dz * dz - along * along, 0.0))
        if best_side[i] == 0:
            near_a, far_a = min(near_a, across), max(far_a, across)
        else:
            near_b, far_b = min(near_b, across), max(far_b, across)
        if across < 1.5 * spacing:
            low, high = min(low, along), max(high, along)
    features[8] = min(max(near_a, near_b) / spacing, 4.0)
    features[9] = min(far_a, far_b) / radius
    features[10] = min(-low, high) / radius
    # Whether any stretch of the line near the point is nearer to it than to all neighbours.
    margin = 2.0
    if away < 3.0:
        for step in range(-2, 3):
            x, y, z = fx + 0.3 * step * spacing * tx, fy + 0.3 * step * spacing * ty, fz + 0.3 * step * spacing * tz
            own = math.sqrt(x * x + y * y + z * z)
            nearest = np.inf
            for i in range(1, min(count, 16)):
                dx, dy, dz = vectors[i, 0] - x, vectors[i, 1] - y, vectors[i, 2] - z
                nearest = min(nearest, dx * dx + dy * dy + dz * dz)
            margin = min(margin, (own - math.sqrt(nearest)) / spacing)
    features[11] = margin
    features[12] = math.log((rms_two + 0.01) / (rms_bent + 0.01))
