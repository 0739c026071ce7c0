"""Rows of eight, one lane a point, one after the other in flat arrays.

Shapes count rows: an array of 10 rows has 80 numbers, and may have more. Neighbours are (3, K rows): the x, then the y,
then the z of the first neighbour of all eight points, of the second, and so on.
"""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import part, routine
from edgel._kernels.simd import LANES, load, store, where


@routine
def aligned(size):
    """Make an array that begins with a cache line: every eight that lie in two take twice as long."""
    scratch = np.empty(size + LANES)
    skip = -(scratch.ctypes.data // scratch.itemsize) % LANES
    return scratch[skip : skip + size]


@part
def load_row(array, row):
    """Read a row."""
    return load(array, row * LANES)


@part
def load_three(array, row):
    """Read three rows, such as vectors, from row `row` on."""
    return load_row(array, row), load_row(array, row + 1), load_row(array, row + 2)


@part
def store_row(array, row, values):
    """Write a row."""
    store(array, row * LANES, values)


@part
def store_rows(array, row, values):
    """Write a tuple of rows, from row `row` on."""
    for i in range(len(values)):
        store_row(array, row + i, values[i])


@part
def keep_rows(flag, source, first, target, row, count):
    """Copy `count` rows, from row `first` to row `row`, in the lanes whose flag is set."""
    for i in range(count):
        store_row(target, row + i, where(flag, load_row(source, first + i), load_row(target, row + i)))
