"""Small symmetric matrices: Cholesky's factor, and the inverse."""

from __future__ import annotations

import math

from edgel._kernels.parallel import kernel

_LEAST = 1e-12  # of a pivot: below, the matrix leaves the unknown open


@kernel
def factorize(matrix, lower):
    """Write the lower triangle of the factor of a symmetric positive matrix (K, K); what is above is left as it is."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= lower[i, k] * lower[j, k]
            lower[i, j] = math.sqrt(max(rest, _LEAST)) if i == j else rest / lower[j, j]


@kernel
def invert_factorized(lower, size, inverse):
    """Write the inverse of the leading (size, size) part of a matrix, from its factor."""
    for column in range(size):
        for i in range(column, size):
            rest = 1.0 if i == column else 0.0
            for k in range(column, i):
                rest -= lower[i, k] * inverse[k, column]
            inverse[i, column] = rest / lower[i, i]
        for i in range(size - 1, column - 1, -1):
            rest = inverse[i, column]
            for k in range(i + 1, size):
                rest -= lower[k, i] * inverse[k, column]
            inverse[i, column] = rest / lower[i, i]
        for i in range(column):
            inverse[i, column] = inverse[column, i]
