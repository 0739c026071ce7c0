"""What face fits share: where they write, weights, and small systems of equations."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.cholesky import factorize
from edgel._kernels.parallel import routine

# Columns of a fit, one row a curve.
NORMALS, INWARD, BEND, OFFSETS, COUNTS, SIGMA = 0, 4, 8, 10, 12, 14
"""Of both faces in the profile: unit normals (a, b), directions into them (a, b), curvature across the edge, standard
deviation of the distance of the edge from each, how many points, and their spread about them."""
TILTS = 16
"""Slope of each face's distance along a line, and of circles 0."""
POSITION_STD, RADIUS_STD, ANGLE_STD, TURN_STD = 18, 19, 20, 21
"""Standard deviations: of the place across the curve, the radius, the angle between the faces, and of the direction."""
STATE = 22
"""See below."""
RIPPLE = 23
"""Of circles: how far the face that is most like a cylinder goes in and out on the way round, as flat walls do."""
FIT = 24

NONE, EDGE_ALONE, MEASURED = 0, 1, 2
"""States: no fit, a fit to edge points and one face, a fit to two faces."""

TOLERANCES = (1.1, 0.8, 0.55)
"""Spacings: how far points of a face may lie from it, round after round; then four deviations."""
ROUNDS = 7
LEAST = 8
"""Points of a face: with fewer it is none."""
FLOOR = 0.03
"""Spacings: faces are no smoother than that."""


@routine
def tolerance_of(turn, sigma, h):
    """Return how far from a face its points may lie, in a round."""
    if turn < len(TOLERANCES):
        return TOLERANCES[turn] * h
    return min(max(4.0 * sigma, 0.15 * h), 1.2 * h)


@routine
def weight_of(off, tolerance):
    """Return Tukey's weight of a distance."""
    q = 1.0 - (off / tolerance) ** 2
    return q * q


@routine
def inverse_of(matrix, size):
    """Return the inverse of the leading part of a symmetric positive matrix."""
    lower, inner = np.zeros((size, size)), np.zeros((size, size))
    factorize(np.ascontiguousarray(matrix[:size, :size]), lower, inner)
    result = np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            for k in range(max(i, j), size):
                result[i, j] += inner[k, i] * inner[k, j]
    return result


@routine
def meet(a, b, c, d, p, q):
    """Return where the lines of normals (a, b) and (c, d) at distances p and q meet; NaN where they do not."""
    det = a * d - b * c
    if abs(det) < 1e-3:
        return math.nan, math.nan
    return (p * d - q * b) / det, (q * a - p * c) / det
