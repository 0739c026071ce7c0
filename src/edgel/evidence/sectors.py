"""Empty sectors around a point: where a surface ends, its neighbours lie on one side."""

from __future__ import annotations

import math

import numpy as np

from edgel.normals import tangents
from edgel.parallel import kernel

COUNTS = (16, 32, 96)
NUM_FEATURES = 2 * len(COUNTS)
BINS = 64
"""Sectors the angles are sorted into: empty ones narrower than this share of the circle are of no interest."""


@kernel
def sector_gaps(vectors, squared, normals, counts, first, last, features):
    """Write the widest empty sector of the tangent plane and the second widest, for each number of neighbours.

    Takes the neighbours (3, k) relative to the point, nearest first. The tangent plane of the smallest number is that
    of the middle scale (S, 4), of the others that of the largest. `first` and `last` (BINS,) are room.
    """
    for s in range(len(counts)):
        normal = normals[min(s + 1, len(normals) - 1)]
        nx, ny, nz = normal[0], normal[1], normal[2]
        ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
        first[:] = np.inf
        last[:] = -np.inf
        for i in range(min(counts[s], vectors.shape[1])):
            if squared[i] > 0.0:
                x = vectors[0, i] * ux + vectors[1, i] * uy + vectors[2, i] * uz
                y = vectors[0, i] * vx + vectors[1, i] * vy + vectors[2, i] * vz
                angle = math.atan2(y, x)
                place = min(int((angle + math.pi) * (BINS / (2.0 * math.pi))), BINS - 1)
                first[place] = min(first[place], angle)
                last[place] = max(last[place], angle)
        widest, second, begin, end = 0.0, 0.0, np.inf, -np.inf
        for place in range(BINS):
            if last[place] == -np.inf:
                continue
            if begin == np.inf:
                begin = first[place]
            else:
                widest, second = _with_gap(first[place] - end, widest, second)
            end = last[place]
        if begin < np.inf:
            widest, second = _with_gap(2.0 * math.pi - (end - begin), widest, second)
        else:
            widest = 2.0 * math.pi
        features[2 * s] = widest
        features[2 * s + 1] = second


@kernel
def _with_gap(gap, widest, second):
    """Return the two widest of three gaps."""
    if gap > widest:
        return gap, widest
    return widest, max(gap, second)
