"""The line in which two faces meet, from the points of the faces."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import routine
from edgel.curves import _fit
from edgel.curves._circle import local, set_frame
from edgel.curves._profile import choose_sides, face_of, mean_normals

_SHORT = 6  # edge points: with fewer the direction along a free end is not fitted to them
_CORRELATED = 3.0  # edge points next to each other come from the same points of the cloud


@routine
def fit_line_faces(shape, beside, xyz, rows, position, normals, h, reach, low, high, fit):
    """Move a line to where its faces meet, and write what is known of them.

    Takes the points beside it (rows of `xyz`), its edge points (rows of `position` and `normals`), and from where to
    where along it they lie.
    """
    faces, inward, bend = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2)
    mean_normals(shape, rows, position, normals, faces)
    count = len(beside)
    x, y, s = np.empty(count), np.empty(count), np.empty(count)
    for q in range(count):
        i = beside[q]
        x[q], y[q], s[q] = local(shape, xyz[i, 0], xyz[i, 1], xyz[i, 2])
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), h)
    inside = np.flatnonzero((s >= low - 0.5 * h) & (s <= high + 0.5 * h))
    profile = np.empty((len(inside), 2))
    for q in range(len(inside)):
        profile[q, 0], profile[q, 1] = x[inside[q]], y[inside[q]]
    choose_sides(profile, h, 0.8 * h, faces, inward)
    x0 = x1 = y0 = y1 = 0.0
    sigma, both = 0.3 * h, False
    dx = dy = ex = ey = 0.0
    system, right = np.zeros((2, 4, 4)), np.zeros((2, 4))
    spread, number, tilt = np.zeros(2), np.zeros(2), np.zeros(2)
    covariance = np.zeros((2, 4, 4))
    for turn in range(_fit.ROUNDS):
        tolerance = _fit.tolerance_of(turn, sigma, h)
        system[:], right[:], number[:] = 0.0, 0.0, 0.0
        square, weights = np.zeros(2), np.zeros(2)
        terms = np.empty(4)
        for q in inside:
            t = (s[q] - middle) / half
            a, b = x[q] - x0 - x1 * t, y[q] - y0 - y1 * t
            k, off, along = face_of(a, b, h, tolerance, reach, faces, inward, bend)
            if k < 0:
                continue
            weight = _fit.weight_of(off, tolerance)
            terms[0], terms[1], terms[2] = 1.0, t, along / h
            terms[3] = terms[2] * terms[2]
            straight = off + bend[k] * along * along
            for i in range(4):
                right[k, i] += weight * terms[i] * straight
                for j in range(i + 1):
                    system[k, i, j] += weight * terms[i] * terms[j]
            square[k] += weight * off * off
            weights[k] += weight
            number[k] += 1
        offset, slope = np.zeros(2), np.zeros(2)
        for k in range(2):
            if number[k] < _fit.LEAST:
                faces[k] = 0.0
                continue
            spread[k] = math.sqrt(square[k] / max(weights[k] - 4.0, 1.0) * (1.25 if turn >= 3 else 1.0))
            unknowns = _solve_face(system[k], right[k], h, turn, max(spread[k], _fit.FLOOR * h), covariance[k])
            offset[k], slope[k] = unknowns[0], unknowns[1]
            bend[k] = unknowns[3] / (h * h)
            g = unknowns[2] / h
            a, b = faces[k, 0] - g * inward[k, 0], faces[k, 1] - g * inward[k, 1]
            length = math.sqrt(a * a + b * b)
            faces[k, 0], faces[k, 1] = a / length, b / length
            sign = 1.0 if inward[k, 1] * faces[k, 0] - inward[k, 0] * faces[k, 1] >= 0.0 else -1.0
            inward[k, 0], inward[k, 1] = -sign * faces[k, 1], sign * faces[k, 0]
        if number[0] < _fit.LEAST and number[1] < _fit.LEAST:
            fit[_fit.STATE] = _fit.NONE
            return
        sigma = max(spread[0] if number[0] >= _fit.LEAST else 0.0, spread[1] if number[1] >= _fit.LEAST else 0.0)
        both = number[0] >= _fit.LEAST and number[1] >= _fit.LEAST
        if both:
            dx, dy = _fit.meet(faces[0, 0], faces[0, 1], faces[1, 0], faces[1, 1], offset[0], offset[1])
            ex, ey = _fit.meet(faces[0, 0], faces[0, 1], faces[1, 0], faces[1, 1], slope[0], slope[1])
            if not math.isfinite(dx):
                both = False
        if not both:
            k = 0 if number[0] >= number[1] else 1
            other = 1 - k
            faces[other] = 0.0
            end, run, spread[other] = _free_end(
                shape, rows, position, inward[k], x0, x1, y0, y1, middle, half, h, covariance[other]
            )
            dx, dy = offset[k] * faces[k, 0] + end * inward[k, 0], offset[k] * faces[k, 1] + end * inward[k, 1]
            ex, ey = slope[k] * faces[k, 0] + run * inward[k, 0], slope[k] * faces[k, 1] + run * inward[k, 1]
        x0, y0, x1, y1 = x0 + dx, y0 + dy, x1 + ex, y1 + ey
        tilt[0], tilt[1] = faces[0, 0] * x1 + faces[0, 1] * y1, faces[1, 0] * x1 + faces[1, 1] * y1
    fit[_fit.STATE] = _fit.MEASURED if both else _fit.EDGE_ALONE
    _write(shape, fit, faces, inward, bend, spread, number, covariance, middle, half, x0, x1, y0, y1)
    fit[_fit.ANGLE_STD] = math.sqrt(max(covariance[0, 2, 2] + covariance[1, 2, 2], 0.0)) / h


@routine
def _solve_face(system, right, h, turn, spread, covariance):
    """Return offset, slope, turn and bend of a face, and write their covariance; flat unless it surely bends."""
    for i in range(4):
        for j in range(i):
            system[j, i] = system[i, j]
        system[i, i] += 1e-9 * system[0, 0]
    system[1, 1] += 1e-3 * system[0, 0]
    covariance[:] = 0.0
    if turn >= 3:
        inverse = _fit.inverse_of(system, 4)
        unknowns = inverse @ right
        if abs(unknowns[3]) > max(3.0 * spread * math.sqrt(inverse[3, 3]), 0.004 * h):
            covariance[:] = inverse * spread * spread
            return unknowns
    inverse = _fit.inverse_of(system, 3)
    unknowns = np.zeros(4)
    unknowns[:3] = inverse @ right[:3]
    covariance[:3, :3] = inverse * spread * spread
    return unknowns


@routine
def _free_end(shape, rows, position, inward, x0, x1, y0, y1, middle, half, h, covariance):
    """Return where the edge points of a line lie along its only face, how that runs, and their spread."""
    s0 = s1 = s2 = r0 = r1 = square = 0.0
    for i in rows:
        x, y, s = local(shape, position[i, 0], position[i, 1], position[i, 2])
        t = (s - middle) / half
        off = (x - x0 - x1 * t) * inward[0] + (y - y0 - y1 * t) * inward[1]
        weight = 1.0 / (1.0 + (off / (0.5 * h)) ** 2)
        s0, s1, s2 = s0 + weight, s1 + weight * t, s2 + weight * t * t
        r0, r1, square = r0 + weight * off, r1 + weight * t * off, square + weight * off * off
    s2 += 1e-3 * s0
    det = s0 * s2 - s1 * s1
    if len(rows) < _SHORT or det <= 1e-6 * s0 * s0:
        end, run = r0 / s0, 0.0
        covariance[0, 0] = _CORRELATED / s0
    else:
        end, run = (r0 * s2 - r1 * s1) / det, (r1 * s0 - r0 * s1) / det
        covariance[0, 0], covariance[1, 1], covariance[0, 1] = s2 / det, s0 / det, -s1 / det
    spread = max(math.sqrt(max(square - end * r0 - run * r1, 0.0) / max(s0 - 2.0, 1.0)), 0.05 * h)
    covariance *= _CORRELATED * spread * spread
    return end, run, spread


@routine
def _write(shape, fit, faces, inward, bend, spread, number, covariance, middle, half, x0, x1, y0, y1):
    """Write the line into the shape, and the faces in the new profile."""
    dx, dy = x1 / half, y1 / half
    length = math.sqrt(1.0 + dx * dx + dy * dy)
    u, v, w = shape[3:6].copy(), shape[6:9].copy(), shape[9:12].copy()
    origin = shape[:3] + x0 * u + y0 * v + middle * w
    along = (dx * u + dy * v + w) / length
    set_frame(shape, origin[0], origin[1], origin[2], along[0], along[1], along[2])
    for k in range(2):
        fit[_fit.COUNTS + k], fit[_fit.SIGMA + k], fit[_fit.BEND + k] = number[k], spread[k], bend[k]
        fit[_fit.OFFSETS + k] = math.sqrt(max(covariance[k, 0, 0], 0.0))
        if faces[k, 0] == 0.0 and faces[k, 1] == 0.0:
            fit[_fit.NORMALS + 2 * k : _fit.NORMALS + 2 * k + 2] = 0.0
            continue
        normal = faces[k, 0] * u + faces[k, 1] * v
        normal -= (normal @ along) * along
        normal /= math.sqrt(normal @ normal)
        into = inward[k, 0] * u + inward[k, 1] * v
        a, b = normal @ shape[3:6], normal @ shape[6:9]
        fit[_fit.NORMALS + 2 * k], fit[_fit.NORMALS + 2 * k + 1] = a, b
        sign = 1.0 if -b * (into @ shape[3:6]) + a * (into @ shape[6:9]) >= 0.0 else -1.0
        fit[_fit.INWARD + 2 * k], fit[_fit.INWARD + 2 * k + 1] = -sign * b, sign * a
    det = faces[0, 0] * faces[1, 1] - faces[0, 1] * faces[1, 0] if fit[_fit.STATE] == _fit.MEASURED else 1.0
    place = (covariance[0, 0, 0] + covariance[1, 0, 0]) / (det * det)
    turn = (covariance[0, 1, 1] + covariance[1, 1, 1]) / (det * det)
    fit[_fit.POSITION_STD], fit[_fit.TURN_STD] = math.sqrt(max(place, 0.0)), math.sqrt(max(turn, 0.0)) / half
    fit[_fit.RADIUS_STD] = math.nan
