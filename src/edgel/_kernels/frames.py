"""Vectors across a unit vector: one at a time, and eight in step."""

from __future__ import annotations

import math

from edgel._kernels.parallel import part, routine
from edgel._kernels.simd import magnitude, root, spread, where


@routine
def across(u, v, w):
    """Return a unit vector across another one (of a vector of no length, +X)."""
    if abs(u) <= abs(v) and abs(u) <= abs(w):
        x, y, z = 0.0, w, -v
    elif abs(v) <= abs(w):
        x, y, z = -w, 0.0, u
    else:
        x, y, z = v, -u, 0.0
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return 1.0, 0.0, 0.0
    return x / length, y / length, z / length


@routine
def tangents(nx, ny, nz):
    """Return two unit vectors across a unit normal and each other."""
    x, y, z = across(nx, ny, nz)
    return x, y, z, ny * z - nz * y, nz * x - nx * z, nx * y - ny * x


@part
def across_of_eight(u, v, w):
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
    """Two unit vectors across a unit normal and each other in each lane: `tangents` in step."""
    x, y, z = across_of_eight(nx, ny, nz)
    return x, y, z, ny * z - nz * y, nz * x - nx * z, nx * y - ny * x
