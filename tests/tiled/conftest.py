import numpy as np
import pytest

import edgel


@pytest.fixture(scope="session")
def strip():
    """A street of houses over uneven ground, dense and sparse, with stray points and some at one place."""
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(np.arange(420.0), np.arange(34.0)), axis=-1).reshape(-1, 2)
    x, y = plan = (grid + rng.uniform(-0.45, 0.45, grid.shape)).T
    roof = (np.abs(x % 40 - 20) < 11) & (np.abs(y - 17) < 9)
    z = np.sin(x / 40) + np.where(roof, 9 + 0.6 * (9 - np.abs(y - 17)), 0) + 0.03 * rng.standard_normal(len(x))
    xyz = np.column_stack([*plan, z])
    sparse = (x > 250) & (rng.random(len(x)) < 0.5)
    xyz = xyz[~sparse]
    stray = xyz[rng.integers(0, len(xyz), 20)] + [0.2, 0.1, 7.0]
    return np.concatenate([xyz, stray, xyz[100:160]]) + [512_300.0, 5_401_200.0, 80.0]


@pytest.fixture(scope="session")
def whole(strip):
    """The answer of the whole cloud."""
    return edgel.detect(strip, method="surface")


@pytest.fixture
def files(strip, tmp_path):
    """The strip in three files, mixed as flight lines are."""
    parts = np.array_split(np.arange(len(strip)), 3)
    names = [str(tmp_path / f"line{number}.npy") for number in range(3)]
    for name, rows in zip(names, parts, strict=True):
        np.save(name, strip[rows])
    return names
