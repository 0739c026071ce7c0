"""What kernels do with whole arrays, as plain loops: what NumPy says in a line, Numba compiles for seconds."""

from __future__ import annotations

from edgel._kernels.parallel import routine


@routine
def copy_to(source, target):
    """Write an array (K,) into the first places of another."""
    for i in range(len(source)):
        target[i] = source[i]


@routine
def copy_rows(source, target):
    """Write an array (M, K) into the first rows and columns of another."""
    for i in range(source.shape[0]):
        copy_to(source[i], target[i])


@routine
def multiply(values, begin, end, factor):
    """Multiply values[begin:end] by a factor."""
    for i in range(begin, end):
        values[i] *= factor


@routine
def divide_rows(rows, by):
    """Divide an array (M, K) by a number."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            rows[i, j] /= by
