"""Two curved faces that meet in an edge: where exactly, and how sure that is.

Each face is a quadric over its own tangent plane. Its curvatures have a prior, since few neighbours under noise tell
little of them: then it is nearly a plane, and the standard deviation of the position holds what that leaves open. Planes
alone place the rim of a hole on the chord of its arc.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.cholesky import factorize, invert_factorized
from edgel._kernels.parallel import kernel
from edgel._neighbors.spacing import disc_spacing
from edgel._surface import hinge
from edgel._surface.neighborhood import relative

COUNTS, SMALLER = (24, 48, 96), (12, 8)
"""Neighbours of the fits: the first tells both faces' twelve unknowns and the noise, others are tried while surer."""
POSITION, LINE, FIRST, SECOND, STD = 0, 3, 6, 9, 12
"""Where the parts of an edge are: its foot, direction, both normals outside the wedge, and the deviation."""
EDGE = 13

_TERMS = 6  # 1, t into the face, s along the edge, s^2 / 2, t s, t^2 / 2
_MODELS = (3, 4, 6)  # terms of a plane, of a face bent along the edge, of any quadric
_CURVATURE = 0.3  # of a face, in 1 / spacing: standard deviation of what is expected of all surfaces
_FLOOR = 0.01  # spacings: residuals below say nothing
_WEIGHT, _WEIGHT_SMALLER = 4.0, 1.0  # residuals that the noise of the first fit stands for in the others
_BAND = 1.5  # standard deviations from the edge within which noise decides on which face a neighbour lies
_LEAST = 4  # neighbours of a face
_ROUNDS = 5
_SETTLED = 0.05  # standard deviations of the residuals
_SUMS = 22  # of powers: see `_POWER`
_POWER = np.array(  # which sum each product of two terms, and of a term with the height, is
    [
        [0, 1, 2, 3, 4, 5, 15],
        [1, 3, 4, 6, 7, 8, 16],
        [2, 4, 5, 7, 8, 9, 17],
        [5, 8, 9, 14, 13, 12, 20],
        [4, 7, 8, 13, 12, 11, 19],
        [3, 6, 7, 12, 11, 10, 18],
    ]
)
_FACTOR = np.array([1.0, 1.0, 1.0, 0.5, 1.0, 0.5])  # of each term, over its powers


@kernel
def fit_curved_faces(first, places, squared, queries, targets, xyz, fits, max_away, min_turn, edges):
    """Refine the edges of fits (M, 24) of two planes, by the rows that `edgel._surface.hinge` names.

    Writes `edges` (M, 13), relative to the points, in the cloud's unit. Where curved faces make no edge within `max_away`
    spacings of the point that turns by `min_turn` they are those of the planes, and the deviation is NaN.
    """
    k = places.shape[1]
    vectors, start, found = np.empty((3, k)), np.empty(EDGE), np.empty(EDGE)
    scratch = make_scratch()
    for q in range(places.shape[0]):
        best, spacing = edges[targets[first + q]], disc_spacing(squared[q])
        if not spacing > 0.0:
            outside(fits[targets[first + q]], 1.0, best)
            continue
        relative(places[q], queries, first + q, xyz, vectors)
        vectors /= spacing
        outside(fits[targets[first + q]], spacing, start)
        best[:] = start
        noise, weight, least, at = 0.0, 0.0, np.inf, COUNTS[0]
        for count in COUNTS:
            sigma = _fit(vectors[:, : min(count, k)], start, noise, weight, max_away, min_turn, scratch, found)
            if found[STD] < least:
                best[:], least, at = found, found[STD], count
            if count == COUNTS[0]:
                noise, weight = sigma, _WEIGHT
        if at == COUNTS[0]:
            for count in SMALLER:
                _fit(vectors[:, : min(count, k)], start, noise, _WEIGHT_SMALLER, max_away, min_turn, scratch, found)
                if found[STD] < least:
                    best[:], least = found, found[STD]
        best[POSITION : POSITION + 3] *= spacing
        best[STD] *= spacing


@kernel
def make_scratch():
    """Make the scratch buffers of a fit: faces, frames, sums; powers; normal equations, factor, inverse, both sides."""
    square = (_TERMS, _TERMS)
    return (
        np.empty((2, _TERMS)),
        np.empty((2, 3)),
        np.empty((2, _SUMS)),
        np.empty(_SUMS),
        np.empty(square),
        np.empty(square),
        np.empty(square),
        np.empty(_TERMS),
        np.empty(_TERMS),
    )


@kernel
def outside(fit, spacing, edge):
    """Take the edge of a hinge, both normals turned to the outside of its wedge."""
    for axis in range(3):
        edge[POSITION + axis] = fit[hinge.FOOT + axis] / spacing
        edge[LINE + axis] = fit[hinge.LINE + axis]
    for own, normal, other in (
        (FIRST, hinge.FIRST_NORMAL, hinge.SECOND_CENTROID),
        (SECOND, hinge.SECOND_NORMAL, hinge.FIRST_CENTROID),
    ):
        height = 0.0
        for axis in range(3):
            height += (fit[other + axis] - fit[hinge.FOOT + axis]) * fit[normal + axis]
        for axis in range(3):
            edge[own + axis] = -fit[normal + axis] if height > 0.0 else fit[normal + axis]
    edge[STD] = np.nan


@kernel
def _fit(vectors, start, noise, weight, max_away, min_turn, scratch, edge):
    """Fit both faces to neighbours (3, K), parted by which they lie farther outside of, part again, fit again.

    Writes the edge, its deviation infinite where there is none. Returns the standard deviation of the residuals, in
    spacings, in which `noise` weighs as `weight` residuals.
    """
    faces, frames, sums = scratch[0], scratch[1], scratch[2]
    edge[:], faces[:] = start, 0.0
    _frames(edge, frames)
    sigma, least, shift = 0.0, 0.0, np.inf
    for turn in range(_ROUNDS):
        _part(vectors, edge, _BAND * sigma, scratch)
        # Planes first, then any quadric, which tells the noise; that tells how much curvature is needed.
        squares, free, variance = weight * noise * noise, weight, 0.0
        for side in range(2):
            model = _MODELS[0] if turn == 0 else _MODELS[-1] if turn == 1 else 0
            left, told, own = _fit_face(sums[side], max(sigma, _FLOOR), model, least, scratch, faces[side])
            squares, free, variance = squares + left, free + sums[side, 0] - told, variance + own
        if not (min(sums[0, 0], sums[1, 0]) >= _LEAST and free > 0.5):
            edge[STD] = np.inf
            break
        sigma = math.sqrt(squares / free) + _FLOOR
        least = sigma if turn == 1 else least
        shift = _move(edge, scratch, max_away, min_turn)
        if shift == np.inf:
            edge[STD] = np.inf
            break
        cosine = _dot(edge, FIRST, edge, SECOND)
        edge[STD] = sigma * math.sqrt(variance / (1.0 - cosine * cosine))
        if turn > 1 and shift < _SETTLED * sigma:
            break
    return sigma


@kernel
def _part(vectors, edge, band, scratch):
    """Part the neighbours by the faces (2, 6) as they are, and sum up the powers of those on either side.

    What lies within the band of the edge counts for neither: noise decides where it goes, and would lift both.
    """
    faces, frames, sums, power = scratch[0], scratch[1], scratch[2], scratch[3]
    sums[:] = 0.0
    for i in range(vectors.shape[1]):
        x, y, z = vectors[0, i] - edge[0], vectors[1, i] - edge[1], vectors[2, i] - edge[2]
        s = x * edge[LINE] + y * edge[LINE + 1] + z * edge[LINE + 2]
        t = x * frames[0, 0] + y * frames[0, 1] + z * frames[0, 2]
        u = x * frames[1, 0] + y * frames[1, 1] + z * frames[1, 2]
        h = x * edge[FIRST] + y * edge[FIRST + 1] + z * edge[FIRST + 2]
        g = x * edge[SECOND] + y * edge[SECOND + 1] + z * edge[SECOND + 2]
        side = 0 if h - _height(faces[0], t, s) >= g - _height(faces[1], u, s) else 1
        if side == 1:
            t, h = u, g
        if t < band:
            continue
        tt, ts, ss, own = t * t, t * s, s * s, sums[side]
        power[0], power[1], power[2], power[3], power[4], power[5] = 1.0, t, s, tt, ts, ss
        power[6], power[7], power[8], power[9] = tt * t, tt * s, t * ss, ss * s
        power[10], power[11], power[12], power[13], power[14] = tt * tt, tt * ts, tt * ss, ts * ss, ss * ss
        power[15], power[16], power[17], power[18] = h, h * t, h * s, h * tt
        power[19], power[20], power[21] = h * ts, h * ss, h * h
        for k in range(_SUMS):
            own[k] += power[k]


@kernel
def _height(face, t, s):
    return face[3] * 0.5 * s * s + face[4] * t * s + face[5] * 0.5 * t * t


@kernel
def _fit_face(sums, sigma, model, noise, scratch, face):
    """Fit a face of so many terms, or (0) of as many as the evidence is best for, given the noise.

    Evidence is the likelihood of the heights, whatever the curvatures (MacKay 1992, doi:10.1162/neco.1992.4.3.415).
    Returns the squares left, how many unknowns the neighbours told, and the variance of the height at the edge, over
    that of the residuals.
    """
    matrix, lower, inverse, right, along = scratch[4], scratch[5], scratch[6], scratch[7], scratch[8]
    stiff = (sigma / _CURVATURE) ** 2
    for i in range(_TERMS):
        right[i] = sums[_POWER[i, _TERMS]] * _FACTOR[i]
        for j in range(i + 1):
            matrix[i, j] = sums[_POWER[i, j]] * _FACTOR[i] * _FACTOR[j]
        if i > 2:
            matrix[i, i] += stiff
    factorize(matrix, lower)
    left, penalty, terms, best = sums[_SUMS - 1], 0.0, max(model, _MODELS[0]), -np.inf
    for i in range(_TERMS):
        along[i] = right[i]
        for k in range(i):
            along[i] -= lower[i, k] * along[k]
        along[i] /= lower[i, i]
        left -= along[i] * along[i]
        if i > 2:
            penalty += math.log(lower[i, i] / math.sqrt(stiff))
        if model == 0 and (i == 2 or i == 3 or i == 5):
            evidence = -left / (2.0 * noise * noise) - penalty
            if evidence > best:
                terms, best = i + 1, evidence
    invert_factorized(lower, terms, inverse)
    left, told = sums[_SUMS - 1], float(terms)
    face[:] = 0.0
    for i in range(terms):
        for j in range(terms):
            face[i] += inverse[i, j] * right[j]
        left -= along[i] * along[i]
        if i > 2:
            left -= stiff * face[i] * face[i]
            told -= stiff * inverse[i, i]
    return max(left, 0.0), told, inverse[0, 0]


@kernel
def _frames(edge, frames):
    """Write the unit vectors (2, 3) across the line into either face."""
    for side in range(2):
        n, m = FIRST + 3 * side, SECOND - 3 * side
        x = edge[n + 1] * edge[LINE + 2] - edge[n + 2] * edge[LINE + 1]
        y = edge[n + 2] * edge[LINE] - edge[n] * edge[LINE + 2]
        z = edge[n] * edge[LINE + 1] - edge[n + 1] * edge[LINE]
        # Both normals lie outside the wedge, so the other one points away from this face.
        sign = -1.0 if x * edge[m] + y * edge[m + 1] + z * edge[m + 2] > 0.0 else 1.0
        frames[side, 0], frames[side, 1], frames[side, 2] = sign * x, sign * y, sign * z


@kernel
def _move(edge, scratch, max_away, min_turn):
    """Put the edge where the faces meet abreast of the point, their tangent planes there; what is left is curvature.

    Returns how far it went, infinite where it is no edge any more.
    """
    faces, frames = scratch[0], scratch[1]
    for side in range(2):
        n = FIRST + 3 * side
        for axis in range(3):
            edge[n + axis] -= faces[side, 1] * frames[side, axis] + faces[side, 2] * edge[LINE + axis]
        length = math.sqrt(_dot(edge, n, edge, n))
        edge[n : n + 3] /= length
        faces[side, 0] /= length
    cosine = _dot(edge, FIRST, edge, SECOND)
    if not (abs(cosine) < 1.0 - 1e-9 and math.acos(cosine) > min_turn):
        return np.inf
    sine2 = 1.0 - cosine * cosine
    a, b = (faces[0, 0] - cosine * faces[1, 0]) / sine2, (faces[1, 0] - cosine * faces[0, 0]) / sine2
    faces[:, :3] = 0.0
    x = edge[FIRST + 1] * edge[SECOND + 2] - edge[FIRST + 2] * edge[SECOND + 1]
    y = edge[FIRST + 2] * edge[SECOND] - edge[FIRST] * edge[SECOND + 2]
    z = edge[FIRST] * edge[SECOND + 1] - edge[FIRST + 1] * edge[SECOND]
    sign = -1.0 if x * edge[LINE] + y * edge[LINE + 1] + z * edge[LINE + 2] < 0.0 else 1.0
    sign /= math.sqrt(sine2)
    edge[LINE], edge[LINE + 1], edge[LINE + 2] = sign * x, sign * y, sign * z
    for axis in range(3):
        edge[POSITION + axis] += a * edge[FIRST + axis] + b * edge[SECOND + axis]
    along = _dot(edge, POSITION, edge, LINE)
    for axis in range(3):
        edge[POSITION + axis] -= along * edge[LINE + axis]
    _frames(edge, frames)
    if not _dot(edge, POSITION, edge, POSITION) < max_away * max_away:
        return np.inf
    return math.sqrt(a * a + b * b + 2.0 * a * b * cosine)


@kernel
def _dot(a, i, b, j):
    return a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2]
