"""Labels of drawings, and lines turned to right angles."""

from dataclasses import replace

import numpy as np
import pytest

import edgel
from edgel.curves import right_angles
from edgel.curves._labels import SIZE, place_labels


def test_labels_do_not_cover_each_other():
    rng = np.random.default_rng(4)
    paths = [middle + rng.normal(0, 8, (2, 2)) for middle in rng.uniform(25, 75, (200, 2))]
    labels = [f"{rng.integers(1, 99999)}" for _ in paths]
    importance = rng.random(200)
    places = place_labels(paths, labels, importance, 100.0, 100.0)
    assert 40 < len(places) < 200
    assert int(importance.argmax()) in places
    boxes = np.array([(x, y - SIZE, x + 0.6 * SIZE * len(labels[k]), y) for k, (x, y) in places.items()])
    assert (boxes >= 0).all()
    assert (boxes <= 100).all()
    for k in range(len(boxes)):
        others = np.delete(boxes, k, axis=0)
        apart = (boxes[k, :2] >= others[:, 2:]).any(axis=1) | (boxes[k, 2:] <= others[:, :2]).any(axis=1)
        assert apart.all()


def test_what_has_no_label_gets_none():
    path = np.array([[10.0, 10], [40, 10]])
    assert list(place_labels([path, path + 20], ["", "20"], np.array([2.0, 1.0]), 100, 100)) == [1]


@pytest.fixture(scope="module")
def sheet():
    """A rectangle of points whose sides are askew by 2 degrees, turned by 30, and its outline."""
    x, y = np.meshgrid(np.arange(60.0), np.arange(40.0))
    jitter = np.random.default_rng(1).uniform(-0.3, 0.3, (2, x.size))
    askew = x.ravel() + np.tan(np.radians(2)) * y.ravel() + jitter[0], y.ravel() + jitter[1]
    turn = np.radians(30)
    plan = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ np.array(askew)
    xyz = np.column_stack([*plan, 0 * plan[0]])
    return edgel.curves.trace(xyz, edgel.detect(xyz, method="surface", min_strength=edgel.curves.FAINT))


def test_sides_are_turned_to_right_angles(sheet):
    assert sheet.count_kinds() == {"line": 4}
    square = right_angles(sheet, np.radians(5))
    angle = np.degrees(np.arctan2(square.direction[:, 1], square.direction[:, 0])) % 90
    np.testing.assert_allclose(angle, angle[0], atol=1e-3)
    assert np.ptp(np.degrees(np.arctan2(sheet.direction[:, 1], sheet.direction[:, 0])) % 90) > 1
    # Lines still meet at their nodes, and hardly moved.
    for curve in range(4):
        for end, place in ((0, square.start[curve]), (1, square.start[curve + 1] - 1)):
            np.testing.assert_allclose(square.vertices[place], square.node_position[square.nodes[curve, end]])
    assert np.linalg.norm(square.vertices - sheet.vertices, axis=1).max() < 1.5
    np.testing.assert_allclose(square.length, sheet.length, rtol=0.03)


def test_lines_that_are_off_by_more_stay(sheet):
    same = right_angles(sheet, np.radians(0.1))
    np.testing.assert_allclose(same.vertices, sheet.vertices, atol=0.05)
    with pytest.raises(ValueError, match="45 degrees"):
        right_angles(sheet, 2.0)
    none = replace(sheet, kind=np.full(4, edgel.curves.CurveKind.POLYLINE, np.uint8))
    np.testing.assert_array_equal(right_angles(none, 0.1).vertices, sheet.vertices)


def test_a_line_that_meets_nothing_is_turned_as_those_beside_it(sheet):
    nodes, vertices = sheet.nodes.copy(), sheet.vertices.copy()
    nodes[0] = -1
    ends = [sheet.start[0], sheet.start[1] - 1]
    middle, turn = vertices[ends].mean(axis=0), np.radians(6)
    matrix = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    vertices[ends] = middle + (vertices[ends] - middle) @ matrix.T
    square = right_angles(replace(sheet, nodes=nodes, vertices=vertices), np.radians(9))
    angle = np.degrees(np.arctan2(square.direction[:, 1], square.direction[:, 0])) % 90
    np.testing.assert_allclose(angle, angle[1], atol=1)  # of 6: it counts among them, too
    np.testing.assert_allclose(square.vertices[ends].mean(axis=0), middle)  # about its middle


def test_lines_far_away_turn_nothing(sheet):
    """The same outline again, turned by 7 degrees and 25 spacings beside it, has a main direction of its own."""
    turn = np.radians(7)
    matrix = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    shift = np.array([120.0, 0, 0])
    names = ("vertices", "node_position")
    turned = {name: getattr(sheet, name) @ matrix.T + shift for name in names} | {
        "direction": sheet.direction @ matrix.T
    }
    alone, other = (right_angles(each, np.radians(10)) for each in (sheet, replace(sheet, **turned)))
    both = right_angles(_side_by_side(sheet, replace(sheet, **turned)), np.radians(10))
    np.testing.assert_allclose(both.vertices, np.concatenate([alone.vertices, other.vertices]), atol=1e-9)


def _side_by_side(one: edgel.curves.Curves, other: edgel.curves.Curves) -> edgel.curves.Curves:
    number = len(one.node_position)
    joined = {
        name: np.concatenate([getattr(one, name), getattr(other, name)])
        for name in ("kind", "vertices", "length", "direction", "node_position", "spacing")
    }
    joined["start"] = np.concatenate([one.start, one.start[-1] + other.start[1:]])
    joined["nodes"] = np.concatenate([one.nodes, np.where(other.nodes >= 0, other.nodes + number, -1)])
    return replace(one, **joined)
