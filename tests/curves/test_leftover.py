"""Sure edge points that no curve runs past become paths."""

import numpy as np
import pytest

from edgel.curves._corners import Nodes, corners_of_shapes
from edgel.curves._leftover import leftover_paths

NOTHING = np.empty((0, 3))


def paths_of(position, passed=NOTHING, strength=0.9, kind=8):
    count = len(position)
    kinds = np.full(count, kind, np.uint8)
    return leftover_paths(np.asarray(position, float), np.full(count, strength), kinds, np.ones(count), passed)


def row(count, y=0.0):
    return np.column_stack([np.arange(float(count)), np.full(count, y), np.zeros(count)])


def test_a_row_of_points_is_one_path_in_order():
    shuffled = np.random.default_rng(1).permutation(12)
    (path,) = paths_of(row(12)[shuffled])
    along = shuffled[path]
    np.testing.assert_array_equal(along if along[0] == 0 else along[::-1], np.arange(12))


def test_paths_do_not_depend_on_the_order_of_the_points():
    rng = np.random.default_rng(2)
    position, order = rng.uniform(0, 12, (150, 3)) * [1, 1, 0.1], rng.permutation(150)
    paths, shuffled = paths_of(position), paths_of(position[order])
    assert len(paths) > 5
    assert [order[path].tolist() for path in shuffled] == [path.tolist() for path in paths]


def test_paths_share_no_point_make_no_long_step_and_do_not_turn_back():
    position = np.random.default_rng(3).uniform(0, 12, (200, 3)) * [1, 1, 0.1]
    paths = paths_of(position)
    every = np.concatenate(paths)
    assert len(np.unique(every)) == len(every)
    for path in paths:
        steps = np.diff(position[path], axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        assert lengths.max() < 1.6
        assert ((steps[1:] * steps[:-1]).sum(axis=1) > 0.29 * lengths[1:] * lengths[:-1]).all()


def test_a_ring_is_open_at_one_place():
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    (path,) = paths_of(np.column_stack([4 * np.cos(turn), 4 * np.sin(turn), 0 * turn]))
    assert sorted(path.tolist()) == list(range(24))


@pytest.mark.parametrize("one", [{"strength": 0.6}, {"passed": row(12, y=1.0)}])
def test_faint_points_and_those_beside_a_curve_are_left(one):
    assert paths_of(row(12), **one) == []


def test_two_points_are_no_path_and_unlike_kinds_are_not_linked():
    assert paths_of(row(2)) == []
    position, kind = row(12), np.where(np.arange(12) < 6, 1, 8).astype(np.uint8)
    halves = leftover_paths(position, np.ones(12), kind, np.ones(12), NOTHING)
    assert sorted(sorted(path.tolist()) for path in halves) == [list(range(6)), list(range(6, 12))]


def test_a_corner_has_two_curves_with_shapes():
    nodes = Nodes(np.zeros((3, 3)), np.zeros(3), np.array([True, True, False]), np.array([[0, 1], [0, 2], [1, 2]]))
    is_run = np.array([False, False, True])
    found = corners_of_shapes(nodes, np.empty((0, 2), np.int64), is_run)
    assert found.is_corner.tolist() == [True, False, False]
    assert corners_of_shapes(nodes, np.array([[1, 1]]), is_run).is_corner.tolist() == [True, True, False]
    np.testing.assert_array_equal(found.of_end, nodes.of_end)
