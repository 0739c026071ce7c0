"""Eigenpairs of symmetric matrices, 3 x 3 one at a time and eight in step, and of any size, against LAPACK."""

import numpy as np
import pytest
from alone import alone
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from edgel._kernels import simd
from edgel._kernels.eigen import smallest_eigenpair, smallest_eigenpairs, turn_to_axes

SEEDS = st.integers(0, 2**32 - 1)


@given(st.lists(st.floats(-1, 1), min_size=9, max_size=9), st.sampled_from([1e-6, 1.0, 1e6]))
def test_eigenpair_is_that_of_lapack(entries, scale):
    a = np.array(entries).reshape(3, 3) * scale
    m = a @ a.T
    smallest, middle, *vector = alone(smallest_eigenpair)(m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2])
    values, vectors = np.linalg.eigh(m)
    size = values[2] + 1e-300
    assert abs(smallest - values[0]) < 1e-12 * size
    assert abs(middle - values[1]) < 1e-6 * size  # only tells whether the neighbours span a plane
    assert np.linalg.norm(vector) == pytest.approx(1)
    if values[1] - values[0] > 1e-5 * size:
        assert np.linalg.norm(np.cross(vector, vectors[:, 0])) < 1e-6


@njit
def _eigenpairs(matrices, out):
    xx, xy, xz = simd.load(matrices, 0), simd.load(matrices, 8), simd.load(matrices, 16)
    yy, yz, zz = simd.load(matrices, 24), simd.load(matrices, 32), simd.load(matrices, 40)
    results = smallest_eigenpairs(xx, xy, xz, yy, yz, zz)
    for i in range(5):
        simd.store(out, 8 * i, results[i])


@given(SEEDS, st.sampled_from([1e-6, 1.0, 1e6]), st.floats(0, 1), st.sampled_from([0.0, 1e-10, 1e-8, 1e-6, 1e-4, 1.0]))
def test_eigenpairs_are_those_of_lapack(seed, scale, least, middle):
    rng = np.random.default_rng(seed)
    turns = np.linalg.qr(rng.normal(size=(8, 3, 3)))[0]
    values = np.array([least * middle, middle, 1.0]) * rng.uniform(0.5, 1, (8, 3))
    m = scale * (turns * values[:, None]) @ turns.transpose(0, 2, 1)
    out = np.empty(40)
    _eigenpairs(np.concatenate([m[:, i, j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]), out)
    smallest, second, *vector = out.reshape(5, 8)
    vector = np.array(vector).T
    expected, vectors = np.linalg.eigh(m)
    size = expected[:, 2]
    gap = expected[:, 1] - expected[:, 0]
    # Two smallest eigenvalues very near each other are not always told apart, nor need be: either normal will do.
    apart, near = gap > 0.01 * size, 1e-3 if middle == 1 else 1e-5
    assert (np.abs(smallest - expected[:, 0]) < np.where(apart, 1e-14, near) * size).all()
    assert (np.abs(second - expected[:, 1]) < near * size).all()
    np.testing.assert_allclose(np.linalg.norm(vector, axis=1), 1, rtol=1e-12)
    turn = np.linalg.norm(np.cross(vector, vectors[:, :, 0]), axis=1)
    assert (turn * gap < 1e-12 * size)[apart].all()
    across = np.abs((vector * vectors[:, :, 2]).sum(axis=1))
    assert (across * (size - expected[:, 1]) < 5e-3 * size).all()  # on a line, any direction across it will do


@given(SEEDS, st.sampled_from([1, 2, 3, 6]), st.sampled_from([1e-6, 1.0, 1e6]))
def test_axes_are_those_of_lapack_for_any_rank(seed, rank, scale):
    half = np.random.default_rng(seed).standard_normal((6, rank))
    matrix = scale * half @ half.T
    turned, vectors = matrix.copy(), np.empty((6, 6))
    alone(turn_to_axes)(turned, vectors)
    size = np.abs(matrix).max()
    assert np.allclose(np.sort(np.diag(turned)), np.linalg.eigvalsh(matrix), atol=1e-12 * size)
    assert np.allclose(vectors.T @ vectors, np.eye(6), atol=1e-12)
    assert np.allclose(vectors @ np.diag(np.diag(turned)) @ vectors.T, matrix, atol=1e-11 * size)
