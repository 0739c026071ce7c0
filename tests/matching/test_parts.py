"""The parts of a match, each against its obvious version."""

import numpy as np
import pytest

from edgel.matching._grid import build_grid, find_cell
from edgel.matching._half_edges import rareness
from edgel.matching._open import rotation_of, vector_of


@pytest.mark.parametrize("reach", [0.05, 0.3])
def test_a_cell_lists_all_that_is_within_reach(reach):
    rng = np.random.default_rng(1)
    places, queries = rng.uniform(-1, 1, (400, 3)), rng.uniform(-1.2, 1.2, (300, 3))
    grid = build_grid(places, reach)
    for query in queries:
        slot = find_cell(grid, *query)
        listed = grid.members[grid.first[slot] : grid.last[slot]]
        near = np.flatnonzero(np.linalg.norm(places - query, axis=1) <= reach)
        assert set(near) <= set(listed)
        assert len(set(listed)) == len(listed)


def test_rare_directions_weigh_more():
    directions = np.concatenate([np.tile([0.0, 0, 1], (9, 1)), [[1.0, 0, 0]]])[:, None]
    weights = rareness(directions)
    assert np.isclose(weights.mean(), 1)
    assert np.isclose(weights[-1] / weights[0], 3)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 2.0, np.pi - 1e-4, np.pi])
def test_rotation_vectors_come_back(angle):
    axis = np.array([0.36, -0.48, 0.8])
    back = vector_of(rotation_of(angle * axis))
    assert np.allclose(rotation_of(back), rotation_of(angle * axis), atol=1e-9)
    assert np.isclose(np.linalg.norm(back), angle, atol=1e-6)
