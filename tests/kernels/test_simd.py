"""Eight numbers in step do what NumPy does."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numba import njit
from numba.core.errors import TypingError

from edgel._kernels import simd

EIGHT = arrays(np.float64, 8, elements=st.floats(-1e6, 1e6))
SEEDS = st.integers(0, 2**32 - 1)


@njit
def _operate(a, b, out):
    x, y = simd.load(a, 0), simd.load(b, 0)
    results = (
        x + y,
        x - y,
        x * y,
        x / (y * y + 1.0),
        simd.smaller(x, y),
        simd.larger(x, y),
        simd.magnitude(x),
        simd.root(simd.magnitude(x)),
        simd.multiply_add(x, y, simd.spread(1.0)),
        simd.where((x < y) & (x <= 5.0) | (x > y) & (y >= 0.0) | (x == y), x, y),
        simd.as_floats(simd.counted(simd.counts_of(2) + simd.counts_of(3), x < y)),
    )
    for i in range(len(results)):
        simd.store(out, 8 * i, results[i])
    return simd.smallest_of(x), simd.largest_of(x), simd.bits(x < y)


@given(EIGHT, EIGHT)
def test_lanes_do_what_numpy_does(a, b):
    out = np.empty(88)
    least, most, flags = _operate(a, b, out)
    expected = [
        a + b,
        a - b,
        a * b,
        a / (b * b + 1),
        np.minimum(a, b),
        np.maximum(a, b),
        np.abs(a),
        np.sqrt(np.abs(a)),
        a * b + 1,
        np.where((a < b) & (a <= 5) | (a > b) & (b >= 0) | (a == b), a, b),
        5.0 + (a < b),
    ]
    np.testing.assert_allclose(out.reshape(-1, 8), expected, rtol=1e-13, atol=1e-3)
    assert (least, most) == (a.min(), a.max())
    assert flags == sum(1 << i for i in range(8) if a[i] < b[i])


def test_lanes_refuse_what_is_not_contiguous():
    with pytest.raises(TypingError, match="contiguous"):
        _operate(np.zeros(16)[::2], np.zeros(8), np.empty(88))


def test_a_checked_build_refuses_to_read_or_write_beyond_an_array(tmp_path):
    """``NUMBA_BOUNDSCHECK=1`` reaches the lanes too, so that `make checked` can find what writes outside."""
    code = """
import numpy as np
from numba import njit
from edgel._kernels import simd

@njit
def read(a, i):
    return simd.largest_of(simd.load(a, i))

@njit
def write(a, i):
    simd.store(a, i, simd.spread(1.0))

for use in (read, write):
    use(np.zeros(16), 8)
    for size, i in ((8, 1), (15, 8), (16, -1), (0, 0)):
        try:
            use(np.zeros(size), i)
        except IndexError:
            continue
        print("not refused", use, size, i)
"""
    environment = os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
