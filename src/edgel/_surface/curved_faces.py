"""Two curved faces that meet in an edge: where exactly, and how sure that is.

Each face is a quadric over its own tangent plane. Its curvatures have a prior, since few neighbours under noise tell
little of them; what that leaves open is in the deviation. Planes alone place a hole's rim on the chord of its arc.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.arrays import copy_to, divide_rows, multiply
from edgel._kernels.cholesky import explain, factorize, solve, variance_of
from edgel._kernels.parallel import kernel, routine, summing_routine
from edgel._neighbors.neighborhood import relative
from edgel._neighbors.spacing import disc_spacing
from edgel._surface import hinge

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
_LEAST, _VAGUE = 4, 5.0  # neighbours of a face; spacings: an edge less sure could lie anywhere among them: not known
_ROUNDS, _SETTLED = 5, 0.05  # standard deviations of the residuals
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

    Writes `edges` (M, 13), relative to the points, in the cloud's unit. Where curved faces make no edge within
    `max_away` spacings of the point that turns by `min_turn` they are those of the planes, and the deviation is NaN.
    """
    k = places.shape[1]
    vectors, start, found = np.empty((3, k)), np.empty(EDGE), np.empty(EDGE)
    scratch = make_scratch()
    for q in range(places.shape[0]):
        best, spacing = edges[targets[first + q]], disc_spacing(squared[q])
        if queries.shape[0] > 3:  # chosen in a stretched space, but fitted as they lie
            x, y, z = queries[3, first + q], queries[4, first + q], queries[5, first + q]
            spacing /= math.sqrt(1.0 + math.sqrt(x * x + y * y + z * z))
        if not spacing > 0.0:
            outside(fits[targets[first + q]], 1.0, best)
            continue
        relative(places[q], queries[:3], first + q, xyz, vectors)
        divide_rows(vectors, spacing)
        outside(fits[targets[first + q]], spacing, start)
        copy_to(start, best)
        noise, least, at, warm = 0.0, _VAGUE, COUNTS[0], False
        for count in COUNTS:
            near, weight = vectors[:, : min(count, k)], _WEIGHT if noise > 0.0 else 0.0
            sigma = _fit(near, best if warm else start, warm, noise, weight, max_away, min_turn, scratch, found)
            warm = found[STD] < least
            if warm:
                copy_to(found, best)
                least, at, noise = found[STD], count, noise if noise > 0.0 else sigma
        if at == COUNTS[0]:
            weight = _WEIGHT_SMALLER if noise > 0.0 else 0.0
            for count in SMALLER:
                near = vectors[:, : min(count, k)]
                _fit(near, start, False, noise, weight, max_away, min_turn, scratch, found)
                if found[STD] < least:
                    copy_to(found, best)
                    least = found[STD]
        multiply(best, POSITION, POSITION + 3, spacing)
        best[STD] *= spacing


@routine
def make_scratch():
    """Make the scratch buffers of a fit: faces, frames, sums, neighbours, and those of the normal equations."""
    square, matrices = (_TERMS, _TERMS), (np.empty((2, _TERMS)), np.empty((2, 3)), np.empty((2, _SUMS)))
    normal = (np.empty(square), np.empty(square), np.empty(square), np.empty(_TERMS), np.empty(_TERMS))
    return matrices + (np.empty((7, COUNTS[-1])),) + normal


@routine
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


@routine
def _fit(vectors, start, warm, noise, weight, max_away, min_turn, scratch, edge):
    """Fit both faces to neighbours (3, K), parted by which they lie farther outside of, part again, fit again.

    Writes the edge, its deviation infinite where there is none. Returns the standard deviation of the residuals, in
    spacings, in which `noise` weighs as `weight` residuals. A warm start goes on with the faces of the fit before.
    """
    faces, frames, sums = scratch[0], scratch[1], scratch[2]
    copy_to(start, edge)
    sigma, least = noise, noise
    if not warm:
        faces[:], sigma = 0.0, 0.0
        _frames(edge, frames)
    for turn in range(2 if warm else 0, _ROUNDS):
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


@routine
def _part(vectors, edge, band, scratch):
    """Part the neighbours by the faces (2, 6) as they are, and sum up the powers of those on either side.

    What lies within the band of the edge counts for neither: noise decides where it goes, and would lift both.
    """
    faces, frames, sums, sides = scratch[0], scratch[1], scratch[2], scratch[3]
    count = vectors.shape[1]
    own, other, along, off, other_off = sides[0], sides[1], sides[2], sides[3], sides[4]
    _project(vectors, edge, LINE, edge, along)
    for side, (t, h) in enumerate(((own, off), (other, other_off))):
        _project(vectors, frames[side], 0, edge, t)
        _project(vectors, edge, FIRST + 3 * side, edge, h)
    first, second = sides[5], sides[6]
    fa, fb, fc = faces[0, 3], faces[0, 4], faces[0, 5]
    ga, gb, gc = faces[1, 3], faces[1, 4], faces[1, 5]
    for i in range(count):
        s, t, u = along[i], own[i], other[i]
        h = off[i] - (0.5 * fa * s * s + fb * t * s + 0.5 * fc * t * t)
        g = other_off[i] - (0.5 * ga * s * s + gb * u * s + 0.5 * gc * u * u)
        nearer = h >= g
        first[i] = 1.0 if nearer and t >= band else 0.0
        second[i] = 1.0 if not nearer and u >= band else 0.0
    _sum_powers(own, along, off, first, count, sums[0])
    _sum_powers(other, along, other_off, second, count, sums[1])


@routine
def _project(vectors, axes, at, edge, out):
    """Coordinates along a unit vector, from the edge's position on."""
    x, y, z = axes[at], axes[at + 1], axes[at + 2]
    level = edge[POSITION] * x + edge[POSITION + 1] * y + edge[POSITION + 2] * z
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    for i in range(vectors.shape[1]):
        out[i] = xs[i] * x + ys[i] * y + zs[i] * z - level


@summing_routine
def _sum_powers(ts, along, heights, weights, count, sums):
    """Sum the powers of t and s up to the fourth, and those up to the second times h, and h squared."""
    n, t1, s1, t2, ts1, s2, t3, t2s, ts2, s3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    t4, t3s, t2s2, ts3, s4 = 0.0, 0.0, 0.0, 0.0, 0.0
    h1, ht, hs, ht2, hts, hs2, h2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        w, t, s, h = weights[i], ts[i], along[i], heights[i]
        wt, ws, wh = w * t, w * s, w * h
        tt, st, ss = wt * t, wt * s, ws * s
        n, t1, s1, t2, ts1, s2 = n + w, t1 + wt, s1 + ws, t2 + tt, ts1 + st, s2 + ss
        t3, t2s, ts2, s3 = t3 + tt * t, t2s + tt * s, ts2 + t * ss, s3 + ss * s
        t4, t3s, t2s2 = t4 + tt * t * t, t3s + tt * t * s, t2s2 + tt * s * s
        ts3, s4 = ts3 + st * s * s, s4 + ss * s * s
        h1, ht, hs, ht2, hts = h1 + wh, ht + wh * t, hs + wh * s, ht2 + wh * t * t, hts + wh * t * s
        hs2, h2 = hs2 + wh * s * s, h2 + wh * h
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = n, t1, s1, t2, ts1, s2
    sums[6], sums[7], sums[8], sums[9] = t3, t2s, ts2, s3
    sums[10], sums[11], sums[12], sums[13], sums[14] = t4, t3s, t2s2, ts3, s4
    sums[15], sums[16], sums[17], sums[18], sums[19], sums[20], sums[21] = h1, ht, hs, ht2, hts, hs2, h2


@routine
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
    factorize(matrix, lower, inverse)
    terms = model
    explain(inverse, right, along)
    if model == 0:
        left, penalty, best = sums[_SUMS - 1], 0.0, -np.inf
        for i in range(_TERMS):
            left -= along[i] * along[i]
            if i > 2:
                penalty += math.log(lower[i, i] / math.sqrt(stiff))
            if i == 2 or i == 3 or i == 5:
                evidence = -left / (2.0 * noise * noise) - penalty
                if evidence > best:
                    terms, best = i + 1, evidence
    face[:] = 0.0
    left, told = sums[_SUMS - 1] - solve(inverse, along, face[:terms]), float(terms)
    for i in range(3, terms):
        left -= stiff * face[i] * face[i]
        told -= stiff * variance_of(inverse, terms, i)
    return max(left, 0.0), told, variance_of(inverse, terms, 0)


@routine
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


@routine
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
        for axis in range(3):
            edge[n + axis] /= length
        faces[side, 0] /= length
    cosine = _dot(edge, FIRST, edge, SECOND)
    if not (abs(cosine) < 1.0 - 1e-9 and math.acos(cosine) > min_turn):
        return np.inf
    sine2 = 1.0 - cosine * cosine
    a, b = (faces[0, 0] - cosine * faces[1, 0]) / sine2, (faces[1, 0] - cosine * faces[0, 0]) / sine2
    faces[:, :3] = 0.0
    sine = math.sqrt(sine2)
    edge[LINE] = (edge[FIRST + 1] * edge[SECOND + 2] - edge[FIRST + 2] * edge[SECOND + 1]) / sine
    edge[LINE + 1] = (edge[FIRST + 2] * edge[SECOND] - edge[FIRST] * edge[SECOND + 2]) / sine
    edge[LINE + 2] = (edge[FIRST] * edge[SECOND + 1] - edge[FIRST + 1] * edge[SECOND]) / sine
    for axis in range(3):
        edge[POSITION + axis] += a * edge[FIRST + axis] + b * edge[SECOND + axis]
    along = _dot(edge, POSITION, edge, LINE)
    for axis in range(3):
        edge[POSITION + axis] -= along * edge[LINE + axis]
    _frames(edge, frames)
    if not _dot(edge, POSITION, edge, POSITION) < max_away * max_away:
        return np.inf
    return math.sqrt(a * a + b * b + 2.0 * a * b * cosine)


@routine
def _dot(a, i, b, j):
    return a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2]
