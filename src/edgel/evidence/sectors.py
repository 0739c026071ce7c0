"""Empty sectors around a point: where a surface ends, its neighbours lie on one side."""

from __future__ import annotations

import math

import numpy as np

from edgel.evidence.sheets import tangent
from edgel.parallel import kernel

COUNTS = (16, 32, 96)
NUM_FEATURES = 2 * len(COUNTS)


@kernel
def sector_gaps(vectors, squared, normals, counts, angles, features):
    """Write the widest empty sector of the tangent plane and the second widest, for each number of neighbours.

    The tangent plane of the smallest number is that of the middle scale (S, 4), of the others that of the largest.
    """
    for s in range(len(counts)):
        normal = normals[min(s + 1, len(normals) - 1)]
        nx, ny, nz = normal[0], normal[1], normal[2]
        ux, uy, uz = tangent(nx, ny, nz)
        vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
        seen = 0
        for i in range(min(counts[s], vectors.shape[0])):
            if squared[i] > 0.0:
                x = vectors[i, 0] * ux + vectors[i, 1] * uy + vectors[i, 2] * uz
                y = vectors[i, 0] * vx + vectors[i, 1] * vy + vectors[i, 2] * vz
                angles[seen] = math.atan2(y, x)
                seen += 1
        widest, second = 2.0 * math.pi, 0.0
        if seen > 0:
            ordered = np.sort(angles[:seen])
            widest = 2.0 * math.pi - (ordered[seen - 1] - ordered[0])
            for i in range(1, seen):
                gap = ordered[i] - ordered[i - 1]
                if gap > widest:
                    widest, second = gap, widest
                elif gap > second:
                    second = gap
        features[2 * s] = widest
        features[2 * s + 1] = second
