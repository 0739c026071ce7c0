"""Plane fits at several scales around a point: the cheap evidence, which says where to look closer."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.arrays import copy_to
from edgel._kernels.eigen import smallest_eigenpair
from edgel._kernels.moments import add_moments
from edgel._kernels.parallel import kernel, routine
from edgel._neighbors.neighborhood import relative
from edgel._neighbors.spacing import disc_spacing

SCALES = (8, 16, 32)  # neighbours of the plane fits, the point among them

VARIATION, ROUNDNESS, OFF_PLANE, OFF_CENTRE, OFF_SPREAD, REACH = range(6)
OF_SCALE = {
    "variation": "log of the surface variation",
    "roundness": "middle over largest eigenvalue: 0 on a line",
    "off_plane": "distance of the point from the plane, over the neighbours' standard deviation",
    "off_centre": "distance of the point from the centroid along the plane, over the same",
    "off_spread": "distance of the point from the plane over what the others leave, at most 4",
    "reach": "distance of the farthest neighbour, in spacings",
}
OF_POINT = {
    "first": "distance of the nearest neighbour, in spacings",
    "fifth": "distance of the fifth nearest neighbour, in spacings",
}
NUM_FEATURES = len(SCALES) * len(OF_SCALE) + len(OF_POINT)
_PER_SCALE = len(OF_SCALE)


@routine
def fit_scales(vectors, squared, scales, normals, features):
    """Fit planes to the first neighbours (3, k) of a point, relative to it, at each scale.

    Writes normal and planarity of each scale to `normals` (S, 4), and to `features` `OF_SCALE` of each scale, then
    `OF_POINT`.
    """
    spacing = disc_spacing(squared)
    sums = np.zeros(9)
    done = 0
    for s in range(len(scales)):
        k = min(scales[s], vectors.shape[1])
        add_moments(vectors, done, k, sums)
        done = k
        cx, cy, cz = sums[0] / k, sums[1] / k, sums[2] / k
        axx, axy, axz = sums[3] / k - cx * cx, sums[4] / k - cx * cy, sums[5] / k - cx * cz
        ayy, ayz, azz = sums[6] / k - cy * cy, sums[7] / k - cy * cz, sums[8] / k - cz * cz
        smallest, middle, nx, ny, nz = smallest_eigenpair(axx, axy, axz, ayy, ayz, azz)
        trace = axx + ayy + azz
        out = features[_PER_SCALE * s : _PER_SCALE * (s + 1)]
        if not trace > 0.0:
            normals[s, :] = 0.0
            out[:] = 0.0
            continue
        smallest, middle = max(smallest, 0.0), max(middle, 0.0)
        normals[s, 0], normals[s, 1], normals[s, 2] = nx, ny, nz
        variation = smallest / trace
        normals[s, 3] = math.exp(-variation / 0.01)
        off = abs(cx * nx + cy * ny + cz * nz)
        size = math.sqrt(trace)
        aside = math.sqrt(max(cx * cx + cy * cy + cz * cz - off * off, 0.0))
        out[VARIATION] = math.log(variation + 1e-6)
        out[ROUNDNESS] = middle / max(trace - smallest - middle, 1e-30)
        out[OFF_PLANE] = off / size
        out[OFF_CENTRE] = aside / size
        out[OFF_SPREAD] = min(off / (math.sqrt(smallest) + 0.01 * size), 4.0)
        out[REACH] = math.sqrt(squared[k - 1]) / max(spacing, 1e-30)
    features[_PER_SCALE * len(scales)] = math.sqrt(squared[min(1, len(squared) - 1)]) / max(spacing, 1e-30)
    features[_PER_SCALE * len(scales) + 1] = math.sqrt(squared[min(5, len(squared) - 1)]) / max(spacing, 1e-30)


@kernel
def describe(first, places, squared, queries, targets, xyz, scales, features, spacing):
    """Write what `fit_scales` says of some points, and how far apart they lie."""
    vectors, fitted, found = np.empty((3, places.shape[1])), np.zeros((len(scales), 4)), np.zeros(features.shape[1])
    for q in range(places.shape[0]):
        relative(places[q], queries, first + q, xyz, vectors)
        fit_scales(vectors, squared[q], scales, fitted, found)
        copy_to(found, features[targets[first + q]])
        spacing[targets[first + q]] = disc_spacing(squared[q])
