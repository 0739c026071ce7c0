"""The neighbours of a point, relative to it, and the way into the space that its stretch makes, and back.

A stretch t takes a vector v to v + t (t . v) / |t|: see `edgel._neighbors.stretched`.
"""

from __future__ import annotations

import math

from edgel._kernels.parallel import routine


@routine
def relative(places, queries, query, xyz, vectors):
    """Write the neighbours relative to the query into `vectors` (3, k), stretched where it has a stretch."""
    for axis in range(3):
        own, coordinates, row = queries[axis, query], xyz[axis], vectors[axis]
        for i in range(len(places)):
            row[i] = coordinates[places[i]] - own
    if queries.shape[0] > 3:
        tx, ty, tz = queries[3, query], queries[4, query], queries[5, query]
        length = math.sqrt(tx * tx + ty * ty + tz * tz)
        if length > 0.0:
            xs, ys, zs = vectors[0], vectors[1], vectors[2]
            for i in range(len(places)):
                along = (xs[i] * tx + ys[i] * ty + zs[i] * tz) / length
                xs[i] += along * tx
                ys[i] += along * ty
                zs[i] += along * tz


@routine
def stretch(own, vector, at):
    """Take the vector that begins at `vector[at]` into the space that the stretch `own` (3,) makes."""
    length = math.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2)
    if length > 0.0:
        _add_along(own, 1.0 / length, vector, at)


@routine
def unstretch(own, vector, at):
    """Take a vector back from the space that the stretch `own` (3,) makes."""
    length = math.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2)
    if length > 0.0:
        _add_along(own, -1.0 / (length * (1.0 + length)), vector, at)


@routine
def stretch_direction(own, direction, at):
    """Take the direction of a line to that of the line there; returns how long it was before it was made a unit."""
    stretch(own, direction, at)
    return _normalize(direction, at)


@routine
def unstretch_direction(own, direction, at):
    """Take the direction of a line back."""
    unstretch(own, direction, at)
    _normalize(direction, at)


@routine
def stretch_normal(own, normal, at):
    """Take a normal of a plane to that of the plane there, a unit: it goes the way back."""
    unstretch_direction(own, normal, at)


@routine
def unstretch_normal(own, normal, at):
    """Take a normal back; returns how long it was before it was made a unit again."""
    return stretch_direction(own, normal, at)


@routine
def drop_foot(place, at, direction, begin):
    """Move a place on a line along it to where it is nearest to the origin: another point of it in another space."""
    along = 0.0
    for axis in range(3):
        along += place[at + axis] * direction[begin + axis]
    for axis in range(3):
        place[at + axis] -= along * direction[begin + axis]


@routine
def _add_along(own, factor, vector, at):
    along = factor * (vector[at] * own[0] + vector[at + 1] * own[1] + vector[at + 2] * own[2])
    for axis in range(3):
        vector[at + axis] += along * own[axis]


@routine
def _normalize(vector, at):
    length = math.sqrt(vector[at] ** 2 + vector[at + 1] ** 2 + vector[at + 2] ** 2)
    if length > 0.0:
        for axis in range(3):
            vector[at + axis] /= length
    return length
