"""Clicks in the viewer: which edge point was meant, and its numbers."""

import numpy as np
import pytest
from hall import TIMEOUT

from edgel import EdgeKind
from edgel._viewer.pick import (
    Picked,
    curve_of,
    curve_places,
    describe,
    describe_curve,
    describe_distance,
    find,
    pick,
    row_of,
    summary,
)
from edgel._viewer.settings import Settings


def test_clicks_choose_the_foremost():
    far, near = np.array([[0.0, 10.0, 0.0]]), np.array([[0.5, 3.0, 0.0], [0.01, 3.0, 0.0]])
    ray = np.zeros(3), np.array([0.0, 2.0, 0.0])
    assert pick([far, near], *ray, max_angle=0.01) == Picked(1, 1)
    assert pick([far, near[:1]], *ray, max_angle=0.01) == Picked(0, 0)
    assert pick([far[:0], near[:1]], *ray, max_angle=0.01) is None
    assert pick([far[:0], near[:1]], *ray, max_angle=0.01, radius=0.6) == Picked(1, 0)
    assert pick([-far], *ray, max_angle=0.01) is None
    assert pick([], *ray, max_angle=0.01) is None


def test_a_clicked_point_is_found_again(open_session, hall_file):
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    panes = session.panes()
    assert panes[0].edges is not None
    weak, strong = int(panes[0].edges.strength.argmin()), int(panes[0].edges.strength.argmax())
    rows = [row_of(panes, Picked(0, edge)) for edge in (weak, strong)]
    fewer = session.panes(Settings(strength=float(panes[0].edges.strength[strong])))
    assert find(fewer, rows[0]) is None
    found = find(fewer, rows[1])
    assert found is not None
    assert row_of(fewer, found) == rows[1]
    assert find([], rows[0]) is None


def test_numbers_of_an_edge_point(open_session, hall_file):
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    crease = int(np.flatnonzero(pane.edges.kind == EdgeKind.CREASE)[0])
    numbers = describe(pane, crease)
    assert numbers["kind"] == "crease"
    assert numbers["row"].startswith(f"{pane.edges.index[crease]:,}")
    assert numbers["angle"] == f"{np.degrees(pane.edges.angle[crease]):.1f}°"
    boundary = int(np.flatnonzero(pane.edges.kind == EdgeKind.BOUNDARY)[0])
    assert describe(pane, boundary)["other face's normal"] == "unknown"


def test_distance_between_two_edge_points(open_session, hall_file):
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    ends = pane.edges.position[[0, -1]]
    told = describe_distance(pane, 0, pane, len(pane.edges) - 1)
    assert float(told["distance"]) == pytest.approx(np.linalg.norm(ends[1] - ends[0]), rel=1e-5)
    np.testing.assert_allclose([float(word) for word in told["from the one before"].split()], ends[1] - ends[0])
    assert summary(pane, 0).startswith(describe(pane, 0)["kind"])


def test_a_click_on_a_curve_tells_its_measures(open_session, hall_file):
    session = open_session([hall_file])
    session.settings = Settings(curves=True)
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.curves is not None
    assert pane.edges is not None
    assert session.panes(Settings())[0].curves is None
    longest = int(pane.curves.length.argmax())
    told = describe_curve(pane.curves, longest)
    assert told["curve"] == f"line {longest + 1}"
    assert told["its length"].startswith(f"{pane.curves.length[longest]:.5g} ± ")
    assert pane.answer is not None
    assert pane.answer.edges is not None
    row = pane.answer.edges.index[pane.curves.rows_of(longest)[0]]
    edge = int(np.flatnonzero(pane.edges.index == row)[0])
    assert curve_of(pane, edge) == longest
    assert describe(pane, edge)["its length"] == told["its length"]


def test_places_along_curves_are_close(open_session, hall_file):
    session = open_session([hall_file])
    session.settings = Settings(curves=True)
    assert session.wait_idle(TIMEOUT)
    curves = session.panes()[0].curves
    assert curves is not None
    places, of = curve_places(curves, 0.5)
    for curve in range(len(curves)):
        steps = np.linalg.norm(np.diff(places[of == curve], axis=0), axis=1)
        assert (steps <= 0.5 + 1e-9).all()
        assert abs(len(steps) * 0.5 - curves.length[curve]) < 0.5 * len(curves.points_of(curve)) + 0.5 * len(steps)
