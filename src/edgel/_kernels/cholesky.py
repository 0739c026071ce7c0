"""Small symmetric matrices: Cholesky's factor, and its inverse."""

from __future__ import annotations

import math

from edgel._kernels.parallel import routine

_LEAST = 1e-12  # of a pivot: below, the matrix leaves the unknown open


@routine
def factorize(matrix, lower, inverse):
    """Write the factor L of a symmetric positive matrix (K, K), and the inverse of L, both lower triangles.

    The leading part of either belongs to the leading part of the matrix, whose inverse has ``sum_k inverse[k, i] *
    inverse[k, j]`` at i, j.
    """
    for i in range(len(matrix)):
        for j in range(i):
            rest = matrix[i, j]
            for k in range(j):
                rest -= lower[i, k] * lower[j, k]
            lower[i, j] = rest * inverse[j, j]
        rest = matrix[i, i]
        for k in range(i):
            rest -= lower[i, k] * lower[i, k]
        lower[i, i] = math.sqrt(max(rest, _LEAST))
        own = 1.0 / lower[i, i]
        for j in range(i):
            rest = 0.0
            for k in range(j, i):
                rest -= lower[i, k] * inverse[k, j]
            inverse[i, j] = rest * own
        inverse[i, i] = own


@routine
def explain(inverse, right, along):
    """Write what the unknowns explain, one after the other: a sum of squares falls by the square of each.

    From the inverse of the factor and the right side (K,) of the equations.
    """
    for i in range(len(right)):
        along[i] = 0.0
        for k in range(i + 1):
            along[i] += inverse[i, k] * right[k]


@routine
def solve(inverse, along, solution):
    """Write the first unknowns (M,), the others left out, and return by how much they let a sum of squares fall."""
    fall, size = 0.0, len(solution)
    for i in range(size):
        solution[i] = 0.0
        for k in range(i, size):
            solution[i] += inverse[k, i] * along[k]
        fall += along[i] * along[i]
    return fall


@routine
def variance_of(inverse, size, i):
    """Return the variance of an unknown, over that of the residuals: the i-th of the inverse's diagonal."""
    total = 0.0
    for k in range(i, size):
        total += inverse[k, i] * inverse[k, i]
    return total
