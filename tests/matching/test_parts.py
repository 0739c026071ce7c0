"""The parts of a match, each against its obvious version."""

import numpy as np
import pytest

from edgel.matching._answer import agreement, margin_of
from edgel.matching._grid import build_grid, find_cell
from edgel.matching._half_edges import rareness
from edgel.matching._open import rotation_of, vector_of
from edgel.matching._search import Found
from edgel.matching._sight import build_sight, empty_rays, look
from edgel.matching._verify import EDGE, MISSING


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


def test_a_ray_beside_an_outline_looked_through_nothing():
    """Where a near surface ends before a far one, a place just inside its end is on it; one well beside it is not."""
    u, v = (values.ravel() for values in np.meshgrid(np.arange(-40.0, 41), np.arange(-40.0, 41)))
    rays = np.c_[0.01 * u, 0.01 * v, np.ones(len(u))]
    ranges = np.where(u <= 0, 100.0, 200.0)
    sight = build_sight(ranges[:, None] * rays, np.zeros(3))
    beside, well = 0.004, 0.08
    for y in np.linspace(-0.3, 0.3, 25):
        assert look(sight, 100 * beside, 100 * y, 100.0, 1.0) == 0
        assert look(sight, 100 * well, 100 * y, 100.0, 1.0) == -1


def frame(height=60, width=80, *, spherical=False):
    """What a camera sees of a ball, and of which pixels it sees nothing; moved somewhere."""
    row, column = (values.ravel() for values in np.mgrid[:height, :width])
    u, v = (column - 35.0) / 90, (row - 31.0) / 80
    rays = np.column_stack([u, v, np.ones(len(u))])
    if spherical:
        rays = np.column_stack([np.sin(9 * u) * np.cos(v), np.sin(v), np.cos(9 * u) * np.cos(v)])
    seen = np.flatnonzero(np.hypot(u, v) < 0.28)
    xyz = np.full((len(u), 3), np.nan)
    xyz[seen] = rays[seen] * (5 - np.hypot(u, v)[seen])[:, None]
    turn, eye = rotation_of(np.array([0.4, -1.0, 0.7])), np.array([3.0, -2.0, 9.0])
    return xyz @ turn.T + eye, rays @ turn.T, seen, eye, (height, width)


def test_the_rays_on_which_a_camera_got_nothing():
    xyz, rays, seen, eye, shape = frame()
    found = empty_rays(xyz, shape, seen, eye)
    assert found is not None
    true = np.delete(rays, seen, axis=0)
    cosine = (found * true).sum(axis=1) / np.linalg.norm(found, axis=1) / np.linalg.norm(true, axis=1)
    assert cosine.min() > 1 - 1e-9


def test_lists_and_sweeps_do_not_say_where_they_looked():
    xyz, _, seen, eye, _ = frame()
    assert empty_rays(xyz, None, seen, eye) is None
    assert empty_rays(xyz, (60, 80), seen[:50], eye) is None
    xyz, _, seen, eye, shape = frame(spherical=True)
    assert empty_rays(xyz, shape, seen, eye) is None
    xyz, _, seen, eye, shape = frame()
    line = seen[seen // 80 == 31]  # of one row alone
    assert empty_rays(xyz, shape, np.tile(line, 5), eye) is None


def test_where_a_camera_looked_and_got_nothing_is_told_from_where_it_did_not_look():
    xyz, rays, seen, eye, shape = frame()
    sight = build_sight(xyz[seen], eye, empty_rays(xyz, shape, seen, eye))

    def said(place, sight=sight):
        return look(sight, place[0], place[1], place[2], 0.1)

    corner, beyond = eye + 4 * rays[0], eye + 4 * (2 * rays[0] - rays[shape[1] // 2 + shape[1] * shape[0] // 2])
    assert said(corner) == 3
    assert said(beyond) == 2
    assert said(corner, build_sight(xyz[seen], eye)) == 2
    assert all(said(xyz[p]) == 0 for p in seen)


def found_with(edge, missing, score):
    columns = np.zeros((1, 2, 6))
    columns[0, 0, [EDGE, MISSING]] = edge, missing
    return Found(np.eye(4)[None], np.array([score]), columns)


def test_creases_that_contradict_take_the_margin_away():
    sure, doubtful, wrong = (found_with(0.4, missing, 0.6) for missing in (0.0, 0.2, 0.4))
    assert agreement(sure) == 1
    assert 0 < margin_of(doubtful, 0.2) < margin_of(sure, 0.2)
    assert margin_of(wrong, 0.2) == 0


def test_the_margin_grows_with_what_the_next_pose_lacks():
    assert margin_of(found_with(0.4, 0.0, 0.6), 0.6) == 0
    assert margin_of(found_with(0.4, 0.0, 0.6), 0.3) == 1
    assert margin_of(found_with(0.4, 0.0, 0.1), 0.0) < 0.5  # far ahead of the others is not much where all are poor


def test_edges_say_nothing_where_there_are_none():
    assert agreement(found_with(0.0, 0.0, 0.5)) == 1
