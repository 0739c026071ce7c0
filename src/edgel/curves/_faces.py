"""The curve in which two faces meet, from the points of the faces: lines of planes, circles of surfaces of revolution.

In the profile of a shape (the plane across a line; radius against height of a circle) planes, cylinders and cones are
straight. All that is unknown, the direction or axis, the place, the radius, and how both faces turn and bend, is fitted
at once to the distances of the points from the faces: robust least squares, in which the faces' points are chosen anew
each round.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel.curves import _fit
from edgel.curves._circle import RADIUS, lean
from edgel.curves._equations import LEAST, TOLERANCES, collect, collect_edge, is_small, put_together, solve, spread_of
from edgel.curves._fit import BENT, CENTRE, HEIGHT, SIZE, TURN, UNKNOWNS
from edgel.curves._gather import gather_all
from edgel.curves._profile import choose_sides, face_of, in_profile, mean_normals

_ROUNDS, _BENDING, _SQUARING = 8, 4, 5
"""Rounds, and those from which faces may bend, and after which they are squared up."""
_MARGIN = 0.5  # spacings, over the reach: the edge may move
_ROOM = 4096  # points beside a shape that there is room for to begin with
_FEWER = 80  # points that the first rounds look at, about
_STRIPE = 0.5  # spacings
_BIN, _FIRST = 0.6, 2  # spacings of depth, and the first of them, counted from the edge, that may be beyond a face
_THIN, _BLUR, _SHALLOW = 0.35, 0.4, 1.3  # of the points at the edge; spacings
_SQUARE = 0.03  # of a face's normal: so near the axis or across it, a plane or a cylinder is meant
_CHANCE = 2.2  # deviations of an amplitude
_ROUNDEST = 0.0015  # spacings: chords of meshes, and faces that bend a little, leave as much of a radius unsure
_LIMIT = 0.3  # radians: no round turns anything by more


@kernel
def fit_faces(
    start, stop, which, reach, shapes, places, boxes, rows, first, position, normals, spacing, ranges, fits, covariances
):
    """Move shapes to where their faces meet; write what is known of them, and the covariance of all unknowns.

    Takes the tree of the cloud, the edge points of each shape (rows of `position` and `normals`), from where to where
    along it they lie, and how far from the edge, in spacings, faces are looked at.
    """
    faces, inward, bend = np.empty((2, 2)), np.empty((2, 2)), np.empty(2)
    spread, number, depth = np.empty(2), np.empty(2), np.empty(2)
    system, right, free = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS), np.empty(UNKNOWNS, np.bool_)
    lower, inner, parts = np.zeros((UNKNOWNS, UNKNOWNS)), np.zeros((UNKNOWNS, UNKNOWNS)), np.empty((2, 8, 9))
    terms, scratch, profile = np.empty(8), np.empty((_ROOM, 3)), np.empty((_ROOM, 2))
    for q in range(start, stop):
        k = which[q]
        shape, fit, covariance, h, own = shapes[q], fits[q], covariances[q], spacing[k], rows[first[k] : first[k + 1]]
        is_line = shape[RADIUS] == 0.0
        low, high, lever = _span(shape, ranges[k, 0], ranges[k, 1], h)
        scratch, number_near = gather_all(places, boxes, shape, low, high, (reach + _MARGIN) * h, scratch)
        if len(profile) < len(scratch):
            profile = np.empty((len(scratch), 2))
        near = scratch[:number_near]
        fewer = _put_some_first(shape, near, h, profile)
        mean_normals(shape, own, position, normals, faces)
        choose_sides(profile[:number_near], h, 0.8 * h, faces, inward)
        for m in range(UNKNOWNS):
            free[m] = m < BENT and not (is_line and m in (SIZE, HEIGHT))
        for k in range(2):
            bend[k], spread[k], depth[k] = 0.0, 0.3 * h, reach * h
        sigma, both, fit[_fit.STATE] = 0.3 * h, False, _fit.NONE
        for turn in range(_ROUNDS):
            tolerance = TOLERANCES[turn] * h if turn < len(TOLERANCES) else min(max(4.0 * sigma, 0.15 * h), 1.2 * h)
            if turn == _BENDING:
                free[BENT] = free[BENT + 1] = True
            some = near[:fewer] if turn < _BENDING else near
            if turn == len(TOLERANCES):
                for k in range(2):
                    depth[k] = _depth_of(k, shape, near, h, 0.55 * h, depth, faces, inward, bend, terms)
            collect(shape, some, h, lever, depth, tolerance, faces, inward, bend, spread, parts, terms, number)
            put_together(parts, system, right)
            sigma = spread_of(parts, number, turn, faces, spread)
            if sigma < 0.0:
                break
            both = number[0] >= LEAST and number[1] >= LEAST
            if both and abs(faces[0, 0] * faces[1, 1] - faces[0, 1] * faces[1, 0]) < 1e-3:
                weaker = 1 if number[0] >= number[1] else 0  # the same face twice
                faces[weaker, 0] = faces[weaker, 1] = 0.0
                both = False
            if not both:
                k = 0 if number[0] >= number[1] else 1
                free[TURN + 1 - k] = free[BENT + 1 - k] = False
                spread[1 - k] = collect_edge(shape, own, position, h, lever, inward[k], system, right, terms)
            solve(system, right, free, h, lever, lower, inner, covariance, turn == _BENDING)
            _move(shape, faces, inward, bend, right, free, h, lever)
            if not is_line:
                if not shape[RADIUS] > h:
                    break
                lever = shape[RADIUS]
                if turn == _SQUARING:
                    _square_up(faces, inward, covariance, free)
            if turn == _ROUNDS - 1 or (turn > _SQUARING and is_small(right)):
                fit[_fit.STATE] = _fit.MEASURED if both else _fit.EDGE_ALONE
                break
        if fit[_fit.STATE] != _fit.NONE:
            _write(shape, faces, inward, bend, number, spread, covariance, h, fit)
            fit[_fit.RIPPLE] = 0.0 if is_line else _ripple(shape, near, h, depth, sigma, faces, inward, bend)


@routine
def _span(shape, low, high, h):
    """Return from where to where along a shape its faces are looked at, and the lever of a tilt.

    The origin of a line moves to its middle.
    """
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if shape[RADIUS] > 0.0:
        round_ = math.pi * shape[RADIUS]
        margin = round_ if half > 0.7 * round_ else half + 0.5 * h
        return middle - margin, middle + margin, shape[RADIUS]
    for axis in range(3):
        shape[axis] += middle * shape[9 + axis]
    return -half - 0.5 * h, half + 0.5 * h, max(half, h)


@routine
def _put_some_first(shape, near, h, profile):
    """Put the points of every so many stripes across a shape first, return their number, and write all profiles.

    Which those are depends on their places beside the shape alone, and not on the tree.
    """
    every, first = max(len(near) // _FEWER, 1), 0
    for i in range(len(near)):
        x, y, z = near[i, 0], near[i, 1], near[i, 2]
        p, q, along = in_profile(shape, x, y, z)
        profile[i, 0], profile[i, 1] = p, q
        if math.floor(along / (_STRIPE * h)) % every == 0:
            for axis in range(3):
                near[i, axis] = near[first, axis]
            near[first, 0], near[first, 1], near[first, 2] = x, y, z
            profile[i, 0], profile[i, 1] = profile[first, 0], profile[first, 1]
            profile[first, 0], profile[first, 1] = p, q
            first += 1
    return first


@routine
def _depth_of(face, shape, near, h, tolerance, depth, faces, inward, bend, counts):
    """Return how deep a face goes: so far, less what noise blurs, as its points lie as densely as they do at the edge.

    Beyond its end there is another face, whose points would tilt this one.
    """
    bins = min(int(depth[face] / (_BIN * h)), len(counts))
    for b in range(bins):
        counts[b] = 0.0
    for i in range(len(near)):
        p, q, _ = in_profile(shape, near[i, 0], near[i, 1], near[i, 2])
        k, _, along = face_of(p, q, h, tolerance, depth, faces, inward, bend)
        if k == face and along < bins * _BIN * h:
            counts[int(along / (_BIN * h))] += 1.0
    for b in range(_FIRST, bins - 1):
        if max(counts[b], counts[b + 1]) < _THIN * counts[_FIRST - 1]:
            return max((b * _BIN - _BLUR) * h, _SHALLOW * h)
    return depth[face]


@routine
def _turned(x, y, by):
    """Return a vector of the profile turned by so much of another one across it, at unit length."""
    length = math.sqrt(1.0 + by * by)
    return (x - by * y) / length, (y + by * x) / length


@routine
def _move(shape, faces, inward, bend, step, free, h, lever):
    """Turn and shift the shape and its faces by a step of the unknowns."""
    tx = min(max(step[0] * h / lever, -_LIMIT), _LIMIT)
    ty = min(max(step[1] * h / lever, -_LIMIT), _LIMIT)
    for axis in range(3):
        shape[axis] += h * (
            step[CENTRE] * shape[3 + axis] + step[CENTRE + 1] * shape[6 + axis] + step[HEIGHT] * shape[9 + axis]
        )
    shape[RADIUS] += step[SIZE] * h
    lean(shape, tx, ty)
    for k in range(2):
        bend[k] = bend[k] + step[BENT + k] / h if free[BENT + k] else 0.0
        # Faces turn about the edge: towards where they go.
        side = 1.0 if inward[k, 1] * faces[k, 0] - inward[k, 0] * faces[k, 1] >= 0.0 else -1.0
        by = side * min(max(step[TURN + k], -_LIMIT), _LIMIT)
        faces[k, 0], faces[k, 1] = _turned(faces[k, 0], faces[k, 1], by)
        inward[k, 0], inward[k, 1] = -side * faces[k, 1], side * faces[k, 0]


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


@routine
def _ripple(shape, near, h, depth, sigma, faces, inward, bend):
    """Return by how much more than chance a wall goes in and out three to six times on the way round."""
    wall = 0 if abs(faces[0, 0]) >= abs(faces[1, 0]) else 1
    tolerance = min(max(4.0 * sigma, 0.15 * h), 1.2 * h) + 0.3 * h
    most, count, square = 0.0, 0, 0.0
    for m in range(3, 7):
        along, across, count, square = 0.0, 0.0, 0, 0.0
        for i in range(len(near)):
            p, q, turn = in_profile(shape, near[i, 0], near[i, 1], near[i, 2])
            k, off, _ = face_of(p, q, h, tolerance, depth, faces, inward, bend)
            if k != wall:
                continue
            count += 1
            square += off * off
            turn *= m / shape[RADIUS]
            along, across = along + off * math.cos(turn), across + off * math.sin(turn)
        if count == 0:
            return 0.0
        most = max(most, 2.0 * math.sqrt(along * along + across * across) / count)
    return max(most - _CHANCE * math.sqrt(2.0 * square) / count, 0.0)


@routine
def _write(shape, faces, inward, bend, number, spread, covariance, h, fit):
    for k in range(2):
        # Where there is one face alone, the other distance is that along it.
        none = faces[k, 0] == 0.0 and faces[k, 1] == 0.0
        a, b = (inward[1 - k, 0], inward[1 - k, 1]) if none else (faces[k, 0], faces[k, 1])
        square = a * a * covariance[CENTRE, CENTRE] + b * b * covariance[CENTRE + 1, CENTRE + 1]
        fit[_fit.OFFSETS + k] = math.sqrt(square + 2.0 * a * b * covariance[CENTRE, CENTRE + 1])
        for axis in range(2):
            fit[_fit.NORMALS + 2 * k + axis], fit[_fit.INWARD + 2 * k + axis] = faces[k, axis], inward[k, axis]
        fit[_fit.BEND + k], fit[_fit.COUNTS + k], fit[_fit.SIGMA + k] = bend[k], number[k], spread[k]
    place = 0.0
    for m in range(CENTRE, TURN):
        place += covariance[m, m]
    fit[_fit.POSITION_STD] = math.sqrt(place)
    square = covariance[SIZE, SIZE] + (_ROUNDEST * h) ** 2
    fit[_fit.RADIUS_STD] = math.sqrt(square) if shape[RADIUS] > 0.0 else math.nan
    fit[_fit.ANGLE_STD] = math.sqrt(covariance[TURN, TURN] + covariance[TURN + 1, TURN + 1])
    fit[_fit.TURN_STD] = math.sqrt(covariance[0, 0] + covariance[1, 1])
