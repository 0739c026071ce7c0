"""Crease test 1: of the planes fitted at the neighbours, two of different direction pass near the point.

Small fits on either face, away from the edge itself, tell the faces apart even where they are short.
"""

from __future__ import annotations

import math

from edgel.parallel import kernel

NEIGHBORS = 32  # among which the two faces are looked for
_REACH = 0.35  # how far from both planes the point may lie, in spacings
_PLANAR = 0.3  # least planarity of the second plane


@kernel
def planes_near(places, squared, vectors, count, spacing, planes, cos_min):
    """Return the angle between the two planes in radians, 0 where the point is on no crease.

    Takes the sorted places of the neighbours (count,), the squared distances to them, and they themselves relative to
    the point, (count, 3); its spacing; normal and planarity of the plane fitted at each sorted point, (N, 4); and the
    cosine of the least angle.
    """
    a, score_a = 0, -1.0
    for i in range(count):
        score = planes[places[i], 3] * math.exp(-squared[i] / (9.0 * spacing * spacing))
        if score > score_a:
            a, score_a = i, score
    pa = places[a]
    b, score_b, cos_ab = -1, 0.0, 1.0
    for i in range(count):
        p = places[i]
        cosine = abs(planes[p, 0] * planes[pa, 0] + planes[p, 1] * planes[pa, 1] + planes[p, 2] * planes[pa, 2])
        score = planes[p, 3] * (1.0 - cosine) * math.exp(-squared[i] / (16.0 * spacing * spacing))
        if score > score_b:
            b, score_b, cos_ab = i, score, cosine
    if b < 0 or cos_ab >= cos_min or planes[places[b], 3] < _PLANAR:
        return 0.0
    if max(_off(vectors, a, planes, pa), _off(vectors, b, planes, places[b])) >= _REACH * spacing:
        return 0.0
    return math.acos(min(cos_ab, 1.0))


@kernel
def _off(vectors, i, planes, place):
    """Distance of the point to the plane fitted at its neighbour i."""
    return abs(vectors[i, 0] * planes[place, 0] + vectors[i, 1] * planes[place, 1] + vectors[i, 2] * planes[place, 2])
