"""The circle in which two surfaces of revolution meet, from the points of the surfaces.

A plane across the axis, a cylinder about it and a cone are straight in the profile of radius and height; all that is
unknown, the axis, the circle and both directions, is fitted at once to the distances of the points from them.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import routine
from edgel.curves import _fit
from edgel.curves._circle import RADIUS, local
from edgel.curves._profile import choose_sides, face_of, in_profile, mean_normals

UNKNOWNS = 10
"""Tilt of the axis (2), place of the centre across it (2), radius, height, turn of both faces (2), their bends (2); in
spacings, the tilts by the radius."""
TILT, CENTRE, SIZE, HEIGHT, TURN, BENT = 0, 2, 4, 5, 6, 8
_SQUARE = 0.03  # of a face's normal: so near the axis or across it, a plane or a cylinder is meant
_CORRELATED = 3.0  # edge points next to each other come from the same points of the cloud
_SURELY, _STRAIGHT = 2.5, 0.004  # deviations, and 1 / spacings: a face bends that bends by more
_CHANCE = 2.2  # deviations of an amplitude
_FIRM = 1e-4  # weight of one point for what no point decides


@routine
def fit_rim_faces(shape, beside, xyz, rows, position, normals, h, reach, low, high, fit, covariance):
    """Move a circle to where its faces meet; write what is known of them, and the covariance (10, 10) of all unknowns.

    Takes the same as `_lines.fit_line_faces`.
    """
    faces, inward, bend = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2)
    mean_normals(shape, rows, position, normals, faces)
    whole = high - low > 0.7 * 2.0 * math.pi * shape[RADIUS]
    middle = 0.5 * (low + high) / shape[RADIUS]
    half = 0.5 * (high - low) + 0.5 * h
    inside, profile = _inside(shape, beside, xyz, middle, half, whole)
    choose_sides(profile, h, 0.8 * h, faces, inward)
    system, right = np.zeros((UNKNOWNS, UNKNOWNS)), np.zeros(UNKNOWNS)
    number, spread = np.zeros(2), np.full(2, 0.3 * h)
    free = np.ones(UNKNOWNS, np.bool_)
    free[BENT:] = False
    sigma, both = 0.3 * h, False
    last = _fit.ROUNDS + 2
    for turn in range(last):
        tolerance = _fit.tolerance_of(turn, sigma, h)
        if turn == 4:
            free[BENT:] = True
        _collect(shape, inside, xyz, h, reach, tolerance, faces, inward, bend, spread, system, right, number)
        for k in range(2):
            if number[k] < _fit.LEAST:
                faces[k] = 0.0
        if number[0] < _fit.LEAST and number[1] < _fit.LEAST:
            fit[_fit.STATE] = _fit.NONE
            return
        sigma = max(spread[0] if number[0] >= _fit.LEAST else 0.0, spread[1] if number[1] >= _fit.LEAST else 0.0)
        both = number[0] >= _fit.LEAST and number[1] >= _fit.LEAST
        if not both:
            k = 0 if number[0] >= number[1] else 1
            spread[1 - k] = _collect_edge(shape, rows, position, h, inward[k], system, right)
            free[TURN + 1 - k] = free[BENT + 1 - k] = False
        _solve(system, right, free, h, shape[RADIUS], covariance, turn == 4)
        _move(shape, faces, inward, bend, right, free, h)
        if not shape[RADIUS] > h:
            fit[_fit.STATE] = _fit.NONE
            return
        if turn == 5:
            _square_up(faces, inward, covariance, free)
    fit[_fit.STATE] = _fit.MEASURED if both else _fit.EDGE_ALONE
    for k in range(2):
        fit[_fit.NORMALS + 2 * k], fit[_fit.NORMALS + 2 * k + 1] = faces[k, 0], faces[k, 1]
        fit[_fit.INWARD + 2 * k], fit[_fit.INWARD + 2 * k + 1] = inward[k, 0], inward[k, 1]
        fit[_fit.BEND + k], fit[_fit.COUNTS + k], fit[_fit.SIGMA + k] = bend[k], number[k], spread[k]
    fit[_fit.RIPPLE] = _ripple(shape, inside, xyz, h, reach, sigma, faces, inward, bend)
    place = covariance[SIZE, SIZE] + covariance[HEIGHT, HEIGHT] + covariance[2, 2] + covariance[3, 3]
    fit[_fit.POSITION_STD], fit[_fit.RADIUS_STD] = math.sqrt(place), math.sqrt(covariance[SIZE, SIZE])
    fit[_fit.ANGLE_STD] = math.sqrt(covariance[TURN, TURN] + covariance[TURN + 1, TURN + 1])
    fit[_fit.TURN_STD] = math.sqrt(covariance[0, 0] + covariance[1, 1])


@routine
def _ripple(shape, inside, xyz, h, reach, sigma, faces, inward, bend):
    """Return by how much more than chance a wall goes in and out three to six times on the way round."""
    wall = 0 if abs(faces[0, 0]) >= abs(faces[1, 0]) else 1
    tolerance = _fit.tolerance_of(_fit.ROUNDS, sigma, h) + 0.3 * h
    sums, count, square = np.zeros((4, 2)), 0, 0.0
    for i in inside:
        a, b, along = in_profile(shape, xyz[i, 0], xyz[i, 1], xyz[i, 2])
        k, off, _ = face_of(a, b, h, tolerance, reach, faces, inward, bend)
        if k != wall:
            continue
        turn = along / shape[RADIUS]
        count += 1
        square += off * off
        for m in range(4):
            sums[m, 0] += off * math.cos((m + 3) * turn)
            sums[m, 1] += off * math.sin((m + 3) * turn)
    if count == 0:
        return 0.0
    most = 0.0
    for m in range(4):
        most = max(most, 2.0 * math.sqrt(sums[m, 0] ** 2 + sums[m, 1] ** 2) / count)
    return max(most - _CHANCE * math.sqrt(2.0 * square) / count, 0.0)


@routine
def _inside(shape, beside, xyz, middle, half, whole):
    """Return the points beside an arc that are not past its ends, and their profile."""
    inside, profile = np.empty(len(beside), np.int64), np.empty((len(beside), 2))
    number = 0
    for i in beside:
        a, b, along = in_profile(shape, xyz[i, 0], xyz[i, 1], xyz[i, 2])
        turn = along / shape[RADIUS] - middle
        turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
        if whole or abs(turn) * shape[RADIUS] <= half:
            inside[number] = i
            profile[number, 0], profile[number, 1] = a, b
            number += 1
    return inside[:number], profile[:number]


@routine
def _derivatives(shape, a, b, c, mr, mz, h, terms):
    """Write how a distance with normal (mr, mz) in the profile changes with tilt, centre, radius and height."""
    rho = math.sqrt(a * a + b * b)
    u, v = (a / rho, b / rho) if rho > 0.0 else (1.0, 0.0)
    by_tilt = h / shape[RADIUS]
    terms[0], terms[1] = (mz * a - mr * u * c) * by_tilt, (mz * b - mr * v * c) * by_tilt
    terms[2], terms[3] = -mr * u * h, -mr * v * h
    terms[4], terms[5] = -mr * h, -mz * h


@routine
def _collect(shape, inside, xyz, h, reach, tolerance, faces, inward, bend, spread, system, right, number):
    """Add up the equations of all points of the faces, each face's by its spread, and write spreads and numbers."""
    system[:], right[:], number[:] = 0.0, 0.0, 0.0
    terms = np.zeros(UNKNOWNS)
    square, weights = np.zeros(2), np.zeros(2)
    inverse = np.empty(2)
    for k in range(2):
        inverse[k] = 1.0 / max(spread[k], _fit.FLOOR * h) ** 2
    for i in inside:
        a, b, c = local(shape, xyz[i, 0], xyz[i, 1], xyz[i, 2])
        p = math.sqrt(a * a + b * b) - shape[RADIUS]
        k, off, along = face_of(p, c, h, tolerance, reach, faces, inward, bend)
        if k < 0:
            continue
        terms[:] = 0.0
        _derivatives(shape, a, b, c, faces[k, 0], faces[k, 1], h, terms)
        terms[TURN + k], terms[BENT + k] = along, -along * along / h
        weight = _fit.weight_of(off, tolerance)
        square[k] += weight * off * off
        weights[k] += weight
        number[k] += 1
        weight *= inverse[k]
        for m in range(UNKNOWNS):
            if terms[m] != 0.0:
                right[m] -= weight * terms[m] * off
                for n in range(m + 1):
                    system[m, n] += weight * terms[m] * terms[n]
    for k in range(2):
        if number[k] >= _fit.LEAST:
            spread[k] = 1.1 * math.sqrt(square[k] / max(weights[k] - 4.0, 1.0))


@routine
def _collect_edge(shape, rows, position, h, across, system, right):
    """Add the equations of the edge points, along the only face, and return their spread."""
    terms = np.zeros(UNKNOWNS)
    square = weights = 0.0
    offs = np.empty(len(rows))
    for q in range(len(rows)):
        i = rows[q]
        p, c, _ = in_profile(shape, position[i, 0], position[i, 1], position[i, 2])
        offs[q] = across[0] * p + across[1] * c
        weight = 1.0 / (1.0 + (offs[q] / (0.5 * h)) ** 2)
        square, weights = square + weight * offs[q] ** 2, weights + weight
    spread = max(math.sqrt(square / max(weights - 3.0, 1.0)), 0.05 * h)
    for q in range(len(rows)):
        i = rows[q]
        a, b, c = local(shape, position[i, 0], position[i, 1], position[i, 2])
        _derivatives(shape, a, b, c, across[0], across[1], h, terms)
        weight = 1.0 / (1.0 + (offs[q] / (0.5 * h)) ** 2) / (_CORRELATED * spread * spread)
        for m in range(TURN):
            right[m] -= weight * terms[m] * offs[q]
            for n in range(m + 1):
                system[m, n] += weight * terms[m] * terms[n]
    return spread


@routine
def _solve(system, right, free, h, radius, covariance, judge):
    """Solve for the free unknowns, into `right`, and write their covariance in the cloud's unit (tilts in radians)."""
    for m in range(UNKNOWNS):
        for n in range(m):
            system[n, m] = system[m, n]
    which, inverse, step = _solve_free(system, right, free)
    if judge:
        again = False
        for m in range(len(which)):
            if which[m] >= BENT and abs(step[m]) < max(_SURELY * math.sqrt(inverse[m, m]), _STRAIGHT):
                free[which[m]] = False
                again = True
        if again:
            which, inverse, step = _solve_free(system, right, free)
    size = len(which)
    right[:] = 0.0
    covariance[:] = 0.0
    scale = np.full(UNKNOWNS, h)
    scale[0] = scale[1] = h / radius
    scale[TURN] = scale[TURN + 1] = 1.0
    scale[BENT] = scale[BENT + 1] = 1.0 / h
    for m in range(size):
        right[which[m]] = step[m]
        for n in range(size):
            covariance[which[m], which[n]] = inverse[m, n] * scale[which[m]] * scale[which[n]]


@routine
def _solve_free(system, right, free):
    """Return which unknowns are free, the inverse of their equations, and their solution."""
    which = np.flatnonzero(free)
    size = len(which)
    inner, side = np.empty((size, size)), np.empty(size)
    for m in range(size):
        side[m] = right[which[m]]
        for n in range(size):
            inner[m, n] = system[which[m], which[n]]
        # What no point decides stays: a step of a spacing, or a tilt or turn of a third, weighs as one deviation.
        inner[m, m] += _FIRM * system[SIZE, SIZE] + 1.0 / (1.0 if which[m] < TURN else 0.1)
    inverse = _fit.inverse_of(inner, size)
    return which, inverse, inverse @ side


@routine
def _move(shape, faces, inward, bend, step, free, h):
    """Turn and shift the shape and its faces by a step of the unknowns."""
    radius = shape[RADIUS]
    limit = 0.3
    tx, ty = step[0] * h / radius, step[1] * h / radius
    tx, ty = min(max(tx, -limit), limit), min(max(ty, -limit), limit)
    u, v, w = shape[3:6].copy(), shape[6:9].copy(), shape[9:12].copy()
    axis = w + tx * u + ty * v
    axis /= math.sqrt(axis @ axis)
    first = u - (u @ axis) * axis
    first /= math.sqrt(first @ first)
    second = np.cross(axis, first)
    shape[:3] += step[2] * h * u + step[3] * h * v + step[5] * h * w
    shape[3:6], shape[6:9], shape[9:12] = first, second, axis
    shape[RADIUS] += step[4] * h
    for k in range(2):
        if free[TURN + k]:
            turn = min(max(step[TURN + k], -limit), limit)
            a, b = faces[k, 0] + turn * inward[k, 0], faces[k, 1] + turn * inward[k, 1]
            length = math.sqrt(a * a + b * b)
            if length == 0.0:
                continue
            faces[k, 0], faces[k, 1] = a / length, b / length
            sign = 1.0 if inward[k, 1] * faces[k, 0] - inward[k, 0] * faces[k, 1] >= 0.0 else -1.0
            inward[k, 0], inward[k, 1] = -sign * faces[k, 1], sign * faces[k, 0]
        bend[k] = bend[k] + step[BENT + k] / h if free[BENT + k] else 0.0


@routine
def _square_up(faces, inward, covariance, free):
    """Where a face is a plane across the axis, or a cylinder, but for its uncertainty, it is that."""
    for k in range(2):
        if not free[TURN + k] or free[BENT + k] or (faces[k, 0] == 0.0 and faces[k, 1] == 0.0):
            continue
        unsure = min(max(3.0 * math.sqrt(covariance[TURN + k, TURN + k]), _SQUARE), 0.12)
        for axis in range(2):
            if abs(faces[k, axis]) < unsure:
                other = 1 - axis
                faces[k, axis], faces[k, other] = 0.0, 1.0 if faces[k, other] > 0.0 else -1.0
                inward[k, other], inward[k, axis] = 0.0, 1.0 if inward[k, axis] > 0.0 else -1.0
                free[TURN + k] = False
