"""What the tests of the formats share: clouds of every kind, and how two are compared."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from edgel import Cloud

DTYPES = ["bool", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8"]


def rich_cloud(num=42, *, shape=None, holes=False, seed=0):
    """A cloud with an attribute of every type."""
    rng = np.random.default_rng(seed)
    xyz = rng.normal(size=(num, 3)) * 100
    if holes:
        xyz[::5] = np.nan
    attributes = {}
    for code in DTYPES:
        values = rng.integers(0, 100, num)
        attributes[f"a_{code}"] = values.astype(code) if code != "bool" else values > 50
    for name in ("red", "green", "blue"):
        attributes[name] = rng.integers(0, 256, num).astype(np.uint8)
    attributes["normal"] = rng.normal(size=(num, 3))
    return Cloud(xyz, attributes, shape)


@st.composite
def clouds(draw, dtypes=tuple(DTYPES), *, finite=False, max_points=20):
    """Clouds of any coordinates and attributes."""
    num = draw(st.integers(1, max_points))
    numbers = st.floats(-1e9, 1e9) if finite else st.floats(allow_nan=True, allow_infinity=True)
    xyz = draw(hnp.arrays(np.float64, (num, 3), elements=numbers))
    names = draw(
        st.lists(st.sampled_from(["label", "intensity", "a", "b1", "Näme", "two words"]), unique=True, max_size=4)
    )
    attributes = {name: draw(hnp.arrays(np.dtype(draw(st.sampled_from(dtypes))), num)) for name in names}
    return Cloud(xyz, attributes)


def assert_same(found, expected, *, dtypes=True, names=None):
    """Two clouds have the same coordinates and attributes, bit for bit (NaN equals NaN)."""
    np.testing.assert_array_equal(found.xyz, expected.xyz)
    names = names or {name: "_".join(name.split()) for name in expected.attributes}
    for name, values in expected.attributes.items():
        parts = {names[name]: values}
        if values.ndim == 2 and names[name] not in found.attributes:
            parts = {f"{names[name]}_{i}": values[:, i] for i in range(values.shape[1])}
        for part, column in parts.items():
            got = found.attributes[part]
            np.testing.assert_array_equal(got, column)
            if dtypes:
                assert got.dtype == column.dtype, (part, got.dtype, column.dtype)
