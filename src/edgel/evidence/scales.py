"""Plane fits at several scales around every point: the cheap evidence, which says where to look closer."""

from __future__ import annotations

import math

import numpy as np

from edgel.normals import smallest_eigenpair
from edgel.parallel import kernel, summing_kernel

SCALES = (8, 16, 32)  # neighbours of the plane fits, the point among them
NUM_FEATURES = 6 * len(SCALES) + 2


@kernel
def spacing_of(squared):
    """Root of the area a point stands for, from the disc that its 16 nearest fill."""
    k = min(len(squared), 16)
    return math.sqrt(math.pi * squared[k - 1] / k)


@summing_kernel
def add_moments(vectors, start, stop, sums):
    """Add x, y, z, xx, xy, xz, yy, yz, zz of the neighbours start..stop-1 to `sums` (9,)."""
    xs, ys, zs = vectors[0], vectors[1], vectors[2]
    mx, my, mz = 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(start, stop):
        x, y, z = xs[i], ys[i], zs[i]
        mx, my, mz = mx + x, my + y, mz + z
        xx, xy, xz, yy, yz, zz = xx + x * x, xy + x * y, xz + x * z, yy + y * y, yz + y * z, zz + z * z
    sums[0] += mx
    sums[1] += my
    sums[2] += mz
    sums[3] += xx
    sums[4] += xy
    sums[5] += xz
    sums[6] += yy
    sums[7] += yz
    sums[8] += zz


@kernel
def fit_scales(vectors, squared, scales, normals, features):
    """Fit planes to the first neighbours (3, k) of a point, relative to it, at each scale.

    Writes normal and planarity of each scale to `normals` (S, 4) and to `features` (6 S + 2,): for each scale the
    surface variation, how line-like the neighbours lie, how far they are off the point along the normal and across it,
    how far the point lies off their plane's own spread, and how far they reach; then the nearest neighbours' distances.
    """
    spacing = spacing_of(squared)
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
        out[0] = math.log(variation + 1e-6)
        out[1] = middle / max(trace - smallest - middle, 1e-30)
        out[2] = off / size
        out[3] = aside / size
        out[4] = min(off / (math.sqrt(smallest) + 0.01 * size), 4.0)
        out[5] = math.sqrt(squared[k - 1]) / max(spacing, 1e-30)
    features[6 * len(scales)] = math.sqrt(squared[min(1, len(squared) - 1)]) / max(spacing, 1e-30)
    features[6 * len(scales) + 1] = math.sqrt(squared[min(5, len(squared) - 1)]) / max(spacing, 1e-30)
