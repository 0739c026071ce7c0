"""Plane fits to the k nearest neighbours of eight points in step."""

from __future__ import annotations

import numpy as np

from edgel.blocks import CHUNK, larger_room, look_round, make_room
from edgel.lanes import (
    LANES,
    larger,
    load,
    magnitude,
    multiply_add,
    root,
    spread,
    store,
    where,
)
from edgel.parallel import kernel, part
from edgel.search import nearest_of_eight

# Below this share of the largest variance the middle one is rounding: the neighbours lie on a line, or on one spot.
_FLAT = 1e-12
_EQUAL = 1e-7  # of the trace: eigenvalues nearer each other than that are not told apart


@kernel
def fit_slice(start, stop, queries, tree, k, normals, offset, residual, variation, limits):
    """Fit planes at the queries start..stop-1, and write them to their rows.

    `limits` (M,) takes the squared distance within which the k nearest lie; it may be empty.
    """
    room, planes, reach, rows = make_room(), np.empty(6 * LANES), np.inf, queries.rows
    for first in range(start, stop, CHUNK):
        last = min(first + CHUNK, stop)
        near, near_reach = look_round(tree, queries, first, last, reach, k, room)
        begin = first
        while begin < last:
            size, count, reach = nearest_of_eight(tree, queries, first, last, begin, near, near_reach, reach, k, room)
            if size == 0:
                room = larger_room(room)
            _fit_eight(tree, room, count, k, planes)
            for lane in range(size):
                row = rows[begin + lane]
                for axis in range(3):
                    normals[row, axis] = planes[axis * LANES + lane]
                offset[row] = planes[3 * LANES + lane]
                residual[row] = planes[4 * LANES + lane]
                variation[row] = planes[5 * LANES + lane]
                if len(limits):
                    limits[row] = room.limits[lane]
            begin += size


@part
def _fit_eight(tree, room, count, k, planes):
    """Fit planes to the neighbours found of eight queries: normal, offset, residual and variation, a row each."""
    px, py, pz, squared, found = tree.x, tree.y, tree.z, room.squared, room.found
    x, y, z = load(room.queries, 0), load(room.queries, LANES), load(room.queries, 2 * LANES)
    limit, zero = load(room.limits, 0), spread(0.0)
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
    xx, xy, xz, yy, yz, zz = xx - cx * mx, xy - cx * my, xz - cx * mz, yy - cy * my, yz - cy * mz, zz - cz * mz
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


@part
def _longer(a, b, c, u, v, w):
    """The longer of two vectors in each lane."""
    second = u * u + v * v + w * w > a * a + b * b + c * c
    return where(second, u, a), where(second, v, b), where(second, w, c)


@part
def _across(u, v, w):
    """A unit vector across another one in each lane; of a vector of no length, +Z."""
    flat_x = (magnitude(u) <= magnitude(v)) & (magnitude(u) <= magnitude(w))
    flat_y = magnitude(v) <= magnitude(w)
    zero, tiny = spread(0.0), spread(1e-300)
    x = where(flat_x, zero, where(flat_y, zero - w, v))
    y = where(flat_x, w, where(flat_y, zero, zero - u))
    z = where(flat_x, zero - v, where(flat_y, u, zero))
    length = root(x * x + y * y + z * z)
    none = length <= tiny
    return where(none, zero, x / length), where(none, zero, y / length), where(none, spread(1.0), z / length)


@part
def tangents_of_eight(nx, ny, nz):
    """Two unit vectors across a unit normal and each other in each lane: `edgel.normals.tangents` in step."""
    x, y, z = _across(nx, ny, nz)
    return x, y, z, ny * z - nz * y, nz * x - nx * z, nx * y - ny * x


@part
def smallest_eigenpairs(xx, xy, xz, yy, yz, zz):
    """Smallest and middle eigenvalue of eight positive semidefinite matrices, and unit eigenvectors of the former.

    `edgel.normals.smallest_eigenpair` in step. There is no arccos in step, so Laguerre's method climbs to the smallest
    root of the characteristic polynomial instead, from 0; then Rayleigh quotients undo its rounding.
    """
    zero, tiny = spread(0.0), spread(1e-300)
    scale = larger(xx + yy + zz, tiny)
    inverse = 1.0 / scale
    xx, xy, xz, yy, yz, zz = xx * inverse, xy * inverse, xz * inverse, yy * inverse, yz * inverse, zz * inverse
    trace = xx + yy + zz
    minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz
    det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    smallest = zero
    for _ in range(4):
        value = ((smallest - trace) * smallest + minors) * smallest - det
        slope = (3.0 * smallest - 2.0 * trace) * smallest + minors
        bend = 6.0 * smallest - 2.0 * trace
        under = larger(4.0 * slope * slope - 6.0 * value * bend, zero)
        below = slope + root(under)
        # Where two roots are equal but for rounding, both are near enough already, and the quotient would be noise.
        smallest = smallest - where(below > _EQUAL, 3.0 * value / larger(below, tiny), zero)
    # A vector across the longest row of the matrix less its smallest eigenvalue: at rank 1, across the largest.
    a, b, c = xx - smallest, yy - smallest, zz - smallest
    u, v, w = _longer(a, xy, xz, xy, b, yz)
    u, v, w = _longer(u, v, w, xz, yz, c)
    x, y, z = _across(u, v, w)
    for _ in range(4):
        a, b, c = xx - smallest, yy - smallest, zz - smallest
        # Every column of the adjugate of A - lambda I points along the eigenvector; the longest is the safest.
        kxy, kxz, kyz = xz * yz - xy * c, xy * yz - xz * b, xy * xz - yz * a
        u, v, w = _longer(b * c - yz * yz, kxy, kxz, kxy, a * c - xz * xz, kyz)
        u, v, w = _longer(u, v, w, kxz, kyz, a * b - xy * xy)
        length = root(u * u + v * v + w * w)
        good = length > 1e-14  # else the two smallest are equal: any direction across the largest will do
        length = 1.0 / larger(length, tiny)
        x, y, z = where(good, u * length, x), where(good, v * length, y), where(good, w * length, z)
        smallest = x * (xx * x + xy * y + xz * z) + y * (xy * x + yy * y + yz * z) + z * (xz * x + yz * y + zz * z)
    # The other two sum to the rest of the trace; their product is what is left of the minors.
    rest = trace - smallest
    product = minors - smallest * rest
    gap = root(larger(rest * rest - 4.0 * product, zero))
    return smallest * scale, 0.5 * (rest - gap) * scale, x, y, z
