"""A hall, two roofs beside each other, and what tests of the edges found in it share."""

import numpy as np

TIMEOUT = 180.0  # seconds: the first detection compiles the kernels
PER_POINT = (
    "index",
    "kind",
    "strength",
    "position",
    "position_std",
    "scale",
    "direction",
    "normals",
    "angle",
    "convex",
)


def roof(slope=1.0, side=60):
    x, y = np.meshgrid(np.arange(float(side)), np.arange(float(side)))
    return np.c_[x.ravel(), y.ravel(), -slope * abs(x.ravel() - side // 2)]


def hall():
    """Two roofs of different pitch beside each other, jittered: creases of 90 and of 53 degrees, and boundaries."""
    rng = np.random.default_rng(1)
    xyz = np.concatenate([roof(1.0), roof(0.5) + [80.0, 0, 0]])
    return xyz + rng.normal(0, 0.05, xyz.shape)


def same(a, b):
    assert a.num_points == b.num_points
    for name in PER_POINT:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
