"""Where a surface ends: the line along its outermost points, smoothed over those beside each."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.arrays import copy_to, divide_rows, multiply
from edgel._kernels.cholesky import explain, factorize, solve, variance_of
from edgel._kernels.parallel import kernel, routine
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.neighborhood import relative
from edgel._neighbors.queries import anywhere, at_points
from edgel._neighbors.spacing import disc_spacing

AROUND = 16  # neighbours whose middle says on which side the surface lies
COUNTS = (7, 17)  # outermost points of each fit; that which is surest of its position is taken
POSITION, LINE, STD = 0, 3, 6
RIM = 7
OUTWARD = 5  # columns of `find_outward`

_TERMS = 3  # 1, s along the rim, s^2 / 2
_CURVATURE = 0.3  # of a rim, in 1 / spacing: standard deviation of what is expected of all
_FLOOR = 0.05  # spacings: the outermost points lie no nearer to the rim
_WEIGHT, _NOISE = 2.0, 0.3  # residuals that are expected, and how many of them that weighs as
_LIFTED = 0.8  # of noise along the surface, which lifts the outermost points out of it: measured, 0.6 to 1.2
_DEPTH = 1.25  # of outermost points inside the true end, over their spread: measured on random samples, 0.9 to 1.3
_ASIDE = 2.0  # spacings from the line: farther ones belong to another rim


def find_outward(index: NeighborIndex, points: np.ndarray, normals: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Say on which side of some points the surface ends.

    Parameters
    ----------
    index : NeighborIndex
    points : (M,) int64
        Ascending.
    normals : (M, 3) float64
        Of the surface there, of either sign.
    noise : (M,) float64
        Standard deviation of the points off it, in the cloud's unit.

    Returns
    -------
    (M, 5) float64
        The unit vector along the surface away from it (NaN where there is none), the spacing, and the noise in it.
    """
    across = np.full((len(points), OUTWARD), np.nan)
    if len(points):
        k = min(AROUND, len(index))
        visit_neighbors(_find_across, at_points(index, points), index, k, normals, noise, across)
    return across


def fit_rims(xyz: np.ndarray, outermost: np.ndarray, normals: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Fit a line with a bend to the outermost points around some.

    Parameters
    ----------
    xyz : (M, 3) float64
    outermost : (K, 3) float64
        The points that surely are where the surface ends.
    normals : (M, 3) float64
        Of the surface there.
    across : (M, 5) float64
        See `find_outward`.

    Returns
    -------
    (M, 7) float64
        Place on the rim relative to the point, unit tangent, and the standard deviation of the place across the
        tangent; NaN where there are too few points, or no normal.
    """
    rims = np.full((len(xyz), RIM), np.nan)
    if len(xyz) and len(outermost) >= COUNTS[0]:
        k = min(COUNTS[-1], len(outermost))
        visit_neighbors(_fit_rims, anywhere(xyz), build_index(outermost), k, normals, across, rims)
    return rims


@kernel
def _find_across(first, places, squared, queries, targets, xyz, normals, noise, across):
    """Write the unit vector (M, 5) along the surface away from the neighbours' middle, the spacing, and noise in it."""
    vectors = np.empty((3, places.shape[1]))
    for q in range(places.shape[0]):
        row = targets[first + q]
        relative(places[q], queries, first + q, xyz, vectors)
        normal, out = normals[row], across[row]
        for axis in range(3):
            total = 0.0
            for i in range(vectors.shape[1]):
                total += vectors[axis, i]
            out[axis] = -total / vectors.shape[1]
        height = out[0] * normal[0] + out[1] * normal[1] + out[2] * normal[2]
        for axis in range(3):
            out[axis] -= height * normal[axis]
        length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
        out[3] = disc_spacing(squared[q])
        out[4] = noise[row] / out[3] if out[3] > 0.0 else 0.0
        if length > 1e-6 * out[3]:
            for axis in range(3):
                out[axis] /= length
        else:
            out[:3] = np.nan


@kernel
def _fit_rims(first, places, squared, queries, targets, xyz, normals, across, rims):
    vectors, found = np.empty((3, places.shape[1])), np.empty(RIM)
    square = (_TERMS, _TERMS)
    scratch = np.empty(square), np.empty(square), np.empty(square), np.empty(_TERMS), np.empty(_TERMS), np.empty(_TERMS)
    for q in range(places.shape[0]):
        row = targets[first + q]
        spacing, best = across[row, 3], rims[row]
        if not (spacing > 0.0 and math.isfinite(across[row, 0]) and math.isfinite(normals[row, 0])):
            continue
        relative(places[q], queries, first + q, xyz, vectors)
        divide_rows(vectors, spacing)
        least = np.inf
        for count in COUNTS:
            if count > places.shape[1]:
                break
            if _fit(vectors[:, :count], normals[row], across[row], scratch, found) and found[STD] < least:
                copy_to(found, best)
                least = found[STD]
        multiply(best, POSITION, POSITION + 3, spacing)
        best[STD] *= spacing


@routine
def _fit(vectors, normal, outward, scratch, rim):
    """Fit a line to points (3, K), in spacings, straight at first, then bent, each along the one before."""
    matrix, lower, inverse, right, along, line = scratch
    ox, oy, oz = outward[0], outward[1], outward[2]
    shift, sigma, left, free = 0.0, _NOISE, 0.0, 0.0
    for turn in range(3):
        tx = normal[1] * oz - normal[2] * oy
        ty = normal[2] * ox - normal[0] * oz
        tz = normal[0] * oy - normal[1] * ox
        stiff = 1e6 if turn == 0 else (sigma / _CURVATURE) ** 2
        matrix[:], right[:], total, number = 0.0, 0.0, 0.0, 0
        for i in range(vectors.shape[1]):
            x, y, z = vectors[0, i], vectors[1, i], vectors[2, i]
            s, d = x * tx + y * ty + z * tz, x * ox + y * oy + z * oz - shift
            if abs(d) > _ASIDE + 0.5 * abs(s):
                continue
            terms = (1.0, s, 0.5 * s * s)
            for j in range(_TERMS):
                for k in range(_TERMS):
                    matrix[j, k] += terms[j] * terms[k]
                right[j] += terms[j] * d
            total, number = total + d * d, number + 1
        if number < 4:
            return False
        matrix[1, 1] += 1e-6
        matrix[2, 2] += stiff
        factorize(matrix, lower, inverse)
        explain(inverse, right, along)
        left = total - solve(inverse, along, line) - stiff * line[2] * line[2]
        free = number - _TERMS + stiff * variance_of(inverse, _TERMS, 2)
        offset, slope = line[0], line[1]
        sigma = math.sqrt((max(left, 0.0) + _WEIGHT * _NOISE * _NOISE) / (free + _WEIGHT)) + _FLOOR
        shift = (shift + offset) / math.sqrt(1.0 + slope * slope)
        x, y, z = ox - slope * tx, oy - slope * ty, oz - slope * tz
        length = math.sqrt(x * x + y * y + z * z)
        ox, oy, oz = x / length, y / length, z / length
    # What is ragged is so because the surface goes on beyond its outermost points; noise is as large off it.
    depth = _DEPTH * math.sqrt(max(left / free - outward[4] ** 2, 0.0)) if free > 0.5 else 0.0
    shift += depth
    rim[POSITION], rim[POSITION + 1], rim[POSITION + 2] = shift * ox, shift * oy, shift * oz
    rim[LINE] = normal[1] * oz - normal[2] * oy
    rim[LINE + 1] = normal[2] * ox - normal[0] * oz
    rim[LINE + 2] = normal[0] * oy - normal[1] * ox
    lifted = (_LIFTED * outward[4]) ** 2
    rim[STD] = math.sqrt(sigma * sigma * variance_of(inverse, _TERMS, 0) + 0.4 * left / max(free, 1.0) + lifted)
    return True
