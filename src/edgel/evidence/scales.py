"""Plane fits at several scales around every point: the cheap evidence, which says where to look closer."""

from __future__ import annotations

import math

from edgel.normals import smallest_eigenpair
from edgel.parallel import kernel

SCALES = (8, 16, 32)  # neighbours of the plane fits, the point among them
NUM_FEATURES = 6 * len(SCALES) + 2


@kernel
def spacing_of(squared):
    """Root of the area a point stands for, from the disc that its 16 nearest fill."""
    k = min(len(squared), 16)
    return math.sqrt(math.pi * squared[k - 1] / k)


@kernel
def fit_scales(vectors, squared, scales, normals, features):
    """Fit planes to the first neighbours (k, 3) of a point, relative to it, at each scale.

    Writes normal and planarity of each scale to `normals` (S, 4) and to `features` (6 S + 2,): for each scale the
    surface variation, how line-like the neighbours lie, how far they are off the point along the normal and across it,
    how far the point lies off their plane's own spread, and how far they reach; then the nearest neighbours' distances.
    """
    spacing = spacing_of(squared)
    mx, my, mz = 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    done = 0
    for s in range(len(scales)):
        k = min(scales[s], vectors.shape[0])
        for i in range(done, k):
            dx, dy, dz = vectors[i, 0], vectors[i, 1], vectors[i, 2]
            mx, my, mz = mx + dx, my + dy, mz + dz
            xx, xy, xz = xx + dx * dx, xy + dx * dy, xz + dx * dz
            yy, yz, zz = yy + dy * dy, yz + dy * dz, zz + dz * dz
        done = k
        cx, cy, cz = mx / k, my / k, mz / k
        axx, axy, axz = xx / k - cx * cx, xy / k - cx * cy, xz / k - cx * cz
        ayy, ayz, azz = yy / k - cy * cy, yz / k - cy * cz, zz / k - cz * cz
        smallest, middle, nx, ny, nz = smallest_eigenpair(axx, axy, axz, ayy, ayz, azz)
        trace = axx + ayy + azz
        out = features[6 * s : 6 * s + 6]
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
        out[0] = math.log(variation + 1e-4)
        out[1] = middle / max(trace - smallest - middle, 1e-30)
        out[2] = off / size
        out[3] = aside / size
        out[4] = min(off / (math.sqrt(smallest) + 0.01 * size), 4.0)
        out[5] = math.sqrt(squared[k - 1]) / max(spacing, 1e-30)
    features[6 * len(scales)] = math.sqrt(squared[min(1, len(squared) - 1)]) / max(spacing, 1e-30)
    features[6 * len(scales) + 1] = math.sqrt(squared[min(5, len(squared) - 1)]) / max(spacing, 1e-30)
