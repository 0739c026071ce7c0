"""Plane fits to the k nearest neighbours: of eight points in step, and of any neighbours that are listed."""

from __future__ import annotations

import numpy as np

from edgel._kernels.eigen import smallest_eigenpair, smallest_eigenpairs
from edgel._kernels.moments import add_moments, scatter
from edgel._kernels.parallel import kernel, part
from edgel._kernels.simd import LANES, larger, load, multiply_add, spread, store, where
from edgel._neighbors.candidates import CHUNK, gather_blocks, larger_scratch, make_scratch
from edgel._neighbors.neighborhood import relative
from edgel._neighbors.search import nearest_of_eight

# Below this share of the largest variance the middle one is rounding: the neighbours lie on a line, or on one spot.
_FLAT = 1e-12


@kernel
def fit_slice(start, stop, queries, tree, k, normals, offset, residual, variation, limits):
    """Fit planes at the queries start..stop-1, and write them where the results of each go.

    `limits` (M,) takes the squared distance within which the k nearest lie; it may be empty.
    """
    scratch, planes, reach, targets = make_scratch(), np.empty(6 * LANES), np.inf, queries.targets
    for first in range(start, stop, CHUNK):
        last = min(first + CHUNK, stop)
        near, near_reach = gather_blocks(tree, queries, first, last, reach, k, scratch)
        begin = first
        while begin < last:
            size, count, reach = nearest_of_eight(
                tree, queries, first, last, begin, near, near_reach, reach, k, scratch
            )
            if size == 0:
                scratch = larger_scratch(scratch)
            _fit_eight(tree, scratch, count, k, planes)
            for lane in range(size):
                row = targets[begin + lane]
                for axis in range(3):
                    normals[row, axis] = planes[axis * LANES + lane]
                offset[row] = planes[3 * LANES + lane]
                residual[row] = planes[4 * LANES + lane]
                variation[row] = planes[5 * LANES + lane]
                if len(limits):
                    limits[row] = scratch.limits[lane]
            begin += size


@part
def _fit_eight(tree, scratch, count, k, planes):
    """Fit planes to the neighbours found of eight queries: normal, offset, residual and variation, a row each."""
    px, py, pz, squared, found = tree.x, tree.y, tree.z, scratch.squared, scratch.found
    x, y, z = load(scratch.queries, 0), load(scratch.queries, LANES), load(scratch.queries, 2 * LANES)
    limit, zero = load(scratch.limits, 0), spread(0.0)
    # Sums are taken about the query, so that they keep their digits far from the origin, and in the order of the tree,
    # so that they do not depend on which other points were looked at.
    mx, my, mz, xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for i in range(count):
        first = LANES * found[i]
        for j in range(min(LANES, len(px) - first)):
            inside = load(squared, (i * LANES + j) * LANES) <= limit
            dx = where(inside, px[first + j] - x, zero)
            dy = where(inside, py[first + j] - y, zero)
            dz = where(inside, pz[first + j] - z, zero)
            mx, my, mz = mx + dx, my + dy, mz + dz
            xx, xy, xz = multiply_add(dx, dx, xx), multiply_add(dx, dy, xy), multiply_add(dx, dz, xz)
            yy, yz, zz = multiply_add(dy, dy, yy), multiply_add(dy, dz, yz), multiply_add(dz, dz, zz)
    share = 1.0 / k
    cx, cy, cz = mx * share, my * share, mz * share
    xx, xy, xz, yy, yz, zz = scatter(cx, cy, cz, mx, my, mz, xx, xy, xz, yy, yz, zz)
    smallest, middle, nx, ny, nz = smallest_eigenpairs(xx, xy, xz, yy, yz, zz)
    # Upwards; a vertical face is seen from no side from above: then +Y, then +X decides.
    down = (nz < zero) | ((nz == zero) & ((ny < zero) | ((ny == zero) & (nx < zero))))
    sign = where(down, spread(-1.0), spread(1.0))
    trace = xx + yy + zz
    sign = where(middle <= _FLAT * trace, spread(np.nan), sign)
    nx, ny, nz = nx * sign, ny * sign, nz * sign
    smallest = larger(smallest, zero)
    store(planes, 0, nx)
    store(planes, LANES, ny)
    store(planes, 2 * LANES, nz)
    store(planes, 3 * LANES, nx * (x + cx) + ny * (y + cy) + nz * (z + cz))
    store(planes, 4 * LANES, smallest * sign * sign)
    store(planes, 5 * LANES, smallest / trace * sign * sign)


@kernel
def fit_listed(first, places, squared, queries, targets, xyz, normals, offset, residual, variation):
    """Fit planes to listed neighbours, as they lie whatever the stretch that chose them."""
    k = places.shape[1]
    vectors, sums = np.empty((3, k)), np.empty(9)
    for q in range(places.shape[0]):
        relative(places[q], queries[:3], first + q, xyz, vectors)
        sums[:] = 0.0
        add_moments(vectors, 0, k, sums)
        mx, my, mz, cx, cy, cz = sums[0], sums[1], sums[2], sums[0] / k, sums[1] / k, sums[2] / k
        xx, xy, xz, yy, yz, zz = scatter(cx, cy, cz, mx, my, mz, sums[3], sums[4], sums[5], sums[6], sums[7], sums[8])
        smallest, middle, nx, ny, nz = smallest_eigenpair(xx, xy, xz, yy, yz, zz)
        row, trace, smallest = targets[first + q], xx + yy + zz, max(smallest, 0.0)
        sign = -1.0 if nz < 0.0 or (nz == 0.0 and (ny < 0.0 or (ny == 0.0 and nx < 0.0))) else 1.0
        sign = np.nan if middle <= _FLAT * trace else sign
        normals[row, 0], normals[row, 1], normals[row, 2] = sign * nx, sign * ny, sign * nz
        x, y, z = queries[0, first + q] + cx, queries[1, first + q] + cy, queries[2, first + q] + cz
        offset[row] = sign * (nx * x + ny * y + nz * z)
        residual[row], variation[row] = smallest * abs(sign), smallest / trace * abs(sign)
