"""What two planes that meet make of the neighbours at one scale, for eight points in step.

One point after the other, nearly all the time went into scalar eigenvectors; in step a fit takes a fifth of it.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.frames import tangents_of_eight
from edgel._kernels.moments import add_moments_of_eight, planes_of_moments
from edgel._kernels.parallel import part, routine
from edgel._kernels.rows import aligned, keep_rows, load_row, load_three, store_row, store_rows
from edgel._kernels.simd import LANES, larger, magnitude, root, smaller, spread, where
from edgel._surface.hinge import (
    FIRST_COUNT,
    FIRST_NORMAL,
    FOOT,
    HINGE,
    LINE,
    PARTING,
    PARTING_LEVEL,
    SECOND_COUNT,
    SECOND_NORMAL,
    bisect,
    refine,
)
from edgel._surface.quadric import fit_quadric

FITS = ((8, 0), (12, 0), (24, 0), (48, 1), (96, 2))
"""Neighbours of each fit, and which of `plane_scales.SCALES` the small planes have that it starts from."""

ONE_PLANE, QUADRIC, TWO_PLANES, TURN, SMALLER_SIDE, FOOT_AWAY, OFF_FIRST, OFF_SECOND = range(8)
NEAR_SIDES, FAR_SIDES, ALONG, MARGIN, QUADRIC_GAIN = range(8, 13)
FEATURES = {
    "one_plane": "log of the root mean square residual of one plane, in spacings",
    "quadric": "the same of a quadric",
    "two_planes": "the same of two planes",
    "turn": "angle between the two planes, radians",
    "smaller_side": "share of the neighbours on the smaller side",
    "foot_away": "distance of the point from the line in which they meet, in spacings, at most 4",
    "off_first": "distance of the first plane from the point at the foot, in spacings, at most 4",
    "off_second": "the same of the second",
    "near_sides": "how near the line both sides come, in spacings",
    "far_sides": "how far from the line both sides reach, in radii",
    "along": "how far the neighbours beside the line reach along it both ways, in radii",
    "margin": "by how much the line lies outside the point's own cell, in spacings; below 0 it runs through it",
    "quadric_gain": "how much less a quadric leaves than two planes, difference of the logs",
}
NUM_FEATURES = len(FEATURES)
_MARGIN_NEIGHBORS = 16


@routine
def make_scratch():
    """Make the scratch buffers of `fit_two_planes`: (16, 42 rows)."""
    return aligned(16 * 42 * LANES).reshape(16, -1)


@routine
def _measure(vectors, count, spacings, scale):
    """Write radius, spacing, and whether both are above 0, 1 where not, to `scale` (3 rows)."""
    x, y, z = load_row(vectors[0], count - 1), load_row(vectors[1], count - 1), load_row(vectors[2], count - 1)
    radius, spacing = root(x * x + y * y + z * z), load_row(spacings, 0)
    scattered = (radius > 0.0) & (spacing > 0.0)
    store_rows(
        scale, 0, (where(scattered, radius, 1.0), where(scattered, spacing, 1.0), where(scattered, spread(1.0), 0.0))
    )


@routine
def _across_bend(plane, quadric, whole, start):
    """Put the plane through the point across the direction in which the quadric bends most into `start`.

    The centroid lies beyond it, the point itself does not: which way the direction points must not matter.
    """
    ux, uy, uz, vx, vy, vz = tangents_of_eight(*load_three(plane, 0))
    xx, xy, yy = load_three(quadric, 0)
    # The direction of the larger eigenvalue halves the angle between (xx - yy, xy) and (1, 0).
    difference = xx - yy
    size = root(difference * difference + xy * xy)
    flat, steep = size + magnitude(difference), magnitude(xy)
    c, s = where(difference < 0.0, steep, flat), where(difference < 0.0, flat, steep)
    length = root(c * c + s * s)
    c, s = where(length > 0.0, c / length, 1.0), where(length > 0.0, s / length, 0.0)
    s = where(xy < 0.0, 0.0 - s, s)
    other = xx + yy < 0.0  # the smaller eigenvalue is farther from zero
    c, s = where(other, 0.0 - s, c), where(other, c, s)
    x, y, z = c * ux + s * vx, c * uy + s * vy, c * uz + s * vz
    mx, my, mz = load_three(whole, 1)
    sign = where(x * mx + y * my + z * mz < 0.0, -1.0, 1.0)
    store_rows(start, 0, (sign * x, sign * y, sign * z, spread(0.0)))


@part
def _nearness(far2):
    """Fall off like a Gaussian of the distance: 1, 0.4, 0.14 at squares 0, 1, 2."""
    return 1.0 / (1.0 + far2 * (1.0 + 0.5 * far2 * (1.0 + far2 * (1.0 / 3.0))))


@routine
def _most_different(vectors, normals, count, scale, a, b):
    """Choose the planes of the two neighbours whose planes differ most, near and flat ones first.

    `b` becomes `a` where all are alike. Writes normals and places to `a` and `b`.
    """
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    us, vs, ws, flatness = normals[0], normals[1], normals[2], normals[3]
    shrink = 1.0 / load_row(scale, 0)
    shrink = shrink * shrink
    zero, best = spread(0.0), spread(-1.0)
    au, av, aw, ax, ay, az = zero, zero, zero, zero, zero, zero
    for i in range(count):
        x, y, z = load_row(xs, i), load_row(ys, i), load_row(zs, i)
        score = load_row(flatness, i) * _nearness(2.0 * (x * x + y * y + z * z) * shrink)
        better = score > best
        best, ax, ay, az = where(better, score, best), where(better, x, ax), where(better, y, ay), where(better, z, az)
        au, av = where(better, load_row(us, i), au), where(better, load_row(vs, i), av)
        aw = where(better, load_row(ws, i), aw)
    best, bu, bv, bw, bx, by, bz = spread(1e-6), au, av, aw, ax, ay, az
    for i in range(count):
        x, y, z = load_row(xs, i), load_row(ys, i), load_row(zs, i)
        u, v, w = load_row(us, i), load_row(vs, i), load_row(ws, i)
        turn = 1.0 - magnitude(u * au + v * av + w * aw)
        score = load_row(flatness, i) * turn * _nearness((x * x + y * y + z * z) * shrink)
        better = score > best
        best, bx, by, bz = where(better, score, best), where(better, x, bx), where(better, y, by), where(better, z, bz)
        bu, bv, bw = where(better, u, bu), where(better, v, bv), where(better, w, bw)
    store_rows(a, 0, (au, av, aw, ax, ay, az))
    store_rows(b, 0, (bu, bv, bw, bx, by, bz))


@part
def _reaches(vectors, count, spacing, hinge):
    """How near the line both sides come, squared, how far both reach, squared, and how far both ways along it."""
    tx, ty, tz = load_three(hinge, LINE)
    fx, fy, fz = load_three(hinge, FOOT)
    px, py, pz = load_three(hinge, PARTING)
    level, beside2 = load_row(hinge, PARTING_LEVEL), 2.25 * spacing * spacing
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    zero, far = spread(0.0), spread(1e300)
    near_a, near_b, far_a, far_b, low, high = far, far, zero, zero, zero, zero
    for i in range(count):
        x, y, z = load_row(xs, i), load_row(ys, i), load_row(zs, i)
        dx, dy, dz = x - fx, y - fy, z - fz
        along = dx * tx + dy * ty + dz * tz
        across2 = larger(dx * dx + dy * dy + dz * dz - along * along, zero)
        first = px * x + py * y + pz * z > level
        near_a, near_b = smaller(near_a, where(first, across2, far)), smaller(near_b, where(first, far, across2))
        far_a, far_b = larger(far_a, where(first, across2, zero)), larger(far_b, where(first, zero, across2))
        along = where(across2 < beside2, along, zero)
        low, high = smaller(low, along), larger(high, along)
    return larger(near_a, near_b), smaller(far_a, far_b), smaller(zero - low, high)


@part
def _margin(vectors, count, spacing, hinge):
    """Least difference, over stretches of the line, of the point's distance and that of the nearest other.

    Below zero a stretch of the line runs through the point's own cell.
    """
    tx, ty, tz = load_three(hinge, LINE)
    fx, fy, fz = load_three(hinge, FOOT)
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    margin = spread(np.inf)
    for step in range(-2, 3):
        shift = 0.3 * step * spacing
        x, y, z = fx + shift * tx, fy + shift * ty, fz + shift * tz
        nearest = spread(np.inf)
        for i in range(1, min(count, _MARGIN_NEIGHBORS)):
            dx, dy, dz = load_row(xs, i) - x, load_row(ys, i) - y, load_row(zs, i) - z
            nearest = smaller(nearest, dx * dx + dy * dy + dz * dz)
        margin = smaller(margin, root(x * x + y * y + z * z) - root(nearest))
    return margin


@routine
def _describe(vectors, count, scale, plane, bent, two, hinge, features):
    """Write what `fit_two_planes` says of the fits, before logarithms are taken; erase the hinges that are none."""
    radius, spacing, scattered = load_three(scale, 0)
    found = (scattered > 0.0) & (load_row(two, 0) < np.inf)
    for i in range(HINGE):
        store_row(hinge, i, where(found, load_row(hinge, i), 0.0))
    ax, ay, az = load_three(hinge, FIRST_NORMAL)
    bx, by, bz = load_three(hinge, SECOND_NORMAL)
    fx, fy, fz = load_three(hinge, FOOT)
    per, share = 1.0 / spacing, 1.0 / count
    one, smooth = root(load_row(plane, 6) * share) * per, root(load_row(bent, 3) * share) * per
    both = where(found, root(load_row(two, 0) * share) * per, one)
    cosine = where(found, smaller(magnitude(ax * bx + ay * by + az * bz), 1.0), 1.0)
    fewer = smaller(load_row(hinge, FIRST_COUNT), load_row(hinge, SECOND_COUNT)) * share
    store_rows(features, ONE_PLANE, (one + 0.01, smooth + 0.01, both + 0.01, cosine, fewer))
    away = where(found, root(fx * fx + fy * fy + fz * fz) * per, 4.0)
    off_a = where(found, magnitude(ax * fx + ay * fy + az * fz) * per, 4.0)
    off_b = where(found, magnitude(bx * fx + by * fy + bz * fz) * per, 4.0)
    store_rows(features, FOOT_AWAY, (smaller(away, 4.0), smaller(off_a, 4.0), smaller(off_b, 4.0)))
    near2, far2, along = _reaches(vectors, count, spacing, hinge)
    near, far, along = smaller(root(near2) * per, 4.0), root(far2) / radius, along / radius
    store_rows(features, NEAR_SIDES, (where(found, near, 0.0), where(found, far, 0.0), where(found, along, 0.0)))
    margin = smaller(_margin(vectors, count, spacing, hinge) * per, 2.0)
    store_rows(features, MARGIN, (where(away < 3.0, margin, 2.0), where(found, 1.0, spread(0.0))))


@routine
def _take_logarithms(features, scale):
    """Finish what `_describe` wrote lane by lane: there are no logarithms and no arccos in step."""
    for lane in range(LANES):
        for i in (ONE_PLANE, QUADRIC, TWO_PLANES):
            features[i * LANES + lane] = math.log(features[i * LANES + lane])
        features[TURN * LANES + lane] = math.acos(features[TURN * LANES + lane])
        features[QUADRIC_GAIN * LANES + lane] *= features[TWO_PLANES * LANES + lane] - features[QUADRIC * LANES + lane]
        for i in range(NUM_FEATURES):
            features[i * LANES + lane] *= scale[2 * LANES + lane]


@routine
def fit_two_planes(vectors, normals, count, spacings, scratch, features, hinges):
    """Fit two planes to the `count` nearest neighbours of eight points, and describe how well that explains them.

    No lane depends on what is in the others.

    Parameters
    ----------
    vectors : (3, K rows) float64
        Neighbours relative to the points, nearest first: see `edgel._kernels.rows`.
    normals : (4, count rows) float64
        Normals and planarity of the planes fitted at the neighbours at a smaller scale.
    count : int
        At most K.
    spacings : (1 row) float64
    scratch
        What `make_scratch` made.
    features : (13 rows) float64
        Written: `FEATURES`. Zero where all are at one place.
    hinges : (24 rows) float64
        Written, by the rows that `edgel._surface.hinge` names: both normals, the line's direction and its point nearest
        to the query (the foot), the number of neighbours of either and their centroids, and the plane (normal and
        level) that parts them. Zero where there are none.
    """
    whole, plane, bent, start, a, b, line, second = (
        scratch[0],
        scratch[1],
        scratch[2],
        scratch[3],
        scratch[4],
        scratch[5],
        scratch[6],
        scratch[7],
    )
    two, other, scale, rest = scratch[8], scratch[9], scratch[10], scratch[11:]
    _measure(vectors, count, spacings, scale)
    # The one plane and the quadric: what a smooth surface would leave.
    store_rows(start, 0, (spread(0.0), spread(0.0), spread(0.0), spread(-1.0)))  # all are beyond it
    add_moments_of_eight(vectors, count, start, whole)
    planes_of_moments(whole, plane)
    fit_quadric(vectors, count, plane, scale, rest, bent)
    # Two planes, parted at first where the quadric bends most, or between the neighbours that differ most.
    _across_bend(plane, bent, whole, start)
    refine(vectors, count, whole, start, rest, hinges, two)
    _most_different(vectors, normals, count, scale, a, b)
    bisect(a, b, line)
    refine(vectors, count, whole, line[6 * LANES :], rest, second, other)
    # Often both come to the same hinge, its sides swapped: rounding must not choose.
    radius, first_left, second_left = load_row(scale, 0), load_row(two, 0), load_row(other, 0)
    less = second_left < first_left - 1e-12 * count * radius * radius
    keep_rows(less, second, 0, hinges, 0, HINGE)
    store_row(two, 0, where(less, second_left, first_left))
    _describe(vectors, count, scale, plane, bent, two, hinges, features)
    _take_logarithms(features, scale)
