"""The session of the viewer: what is asked for, which detector runs, what is shown."""

import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
from hall import TIMEOUT, hall, roof, same

import edgel
from edgel import EdgeKind
from edgel._detect import DEFAULT_KINDS
from edgel._viewer.runs import METHODS, Run
from edgel._viewer.settings import Coloring, Settings


class SlowDetector:
    """Stands in for the detector: takes ten stages, and remembers which runs began and which came to their end."""

    def __init__(self, edges):
        self.edges, self.begun, self.done = edges, [], []

    def __call__(self, cloud, run, progress):
        self.begun.append(run.scale)
        for stage in range(10):
            progress(str(stage))
            time.sleep(0.01)
        self.done.append(run.scale)
        return replace(self.edges, parameters={"scale": run.scale})


def test_twenty_moves_of_the_scale_end_with_the_last(open_session, hall_file):
    detector = SlowDetector(edgel.detect(hall()))
    session = open_session([hall_file], detect=detector)
    assert session.wait_idle(TIMEOUT)
    for step in range(20):
        session.settings = Settings(scale=1.5 + 0.25 * step)
        time.sleep(0.005)
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.is_current
    assert pane.edges is not None
    assert pane.edges.parameters["scale"] == detector.done[-1] == 1.5 + 0.25 * 19
    assert len(detector.done) <= 4  # the first, the last, and hardly any between: runs nobody waits for are given up


def test_filters_do_not_disturb_a_run(open_session, hall_file):
    detector = SlowDetector(edgel.detect(hall()))
    session = open_session([hall_file], detect=detector)
    for step in range(20):
        session.settings = Settings(strength=0.5 + 0.01 * step)
        time.sleep(0.005)
    assert session.wait_idle(TIMEOUT)
    assert detector.begun == detector.done == [1.0]


def test_going_back_is_remembered(open_session, hall_file):
    detector = SlowDetector(edgel.detect(hall()))
    session = open_session([hall_file], detect=detector)
    for scale in (1.0, 2.0, 1.0, 2.0):
        session.settings = Settings(scale=scale)
        assert session.wait_idle(TIMEOUT)
    assert detector.done == [1.0, 2.0]


def test_more_files_than_answers_kept(open_session, hall_file):
    session = open_session([hall_file] * 15, detect=SlowDetector(edgel.detect(hall())))
    session.settings = Settings(methods=METHODS)
    assert session.wait_idle(TIMEOUT)
    assert all(pane.is_current and pane.edges is not None for pane in session.panes())
    assert len(session.panes()) == 30


def test_old_edges_stay_until_the_new_ones_are_there(open_session, hall_file):
    may_go = threading.Event()
    edges = edgel.detect(hall())

    def detect(cloud, run, progress):
        if run.scale > 1:
            may_go.wait(TIMEOUT)
        return edges

    session = open_session([hall_file], detect=detect)
    assert session.wait_idle(TIMEOUT)
    session.settings = Settings(scale=3.0)
    (pane,) = session.panes()
    assert not pane.is_current
    assert pane.edges is not None
    may_go.set()
    assert session.wait_idle(TIMEOUT)
    assert session.panes()[0].is_current


def test_a_cloud_without_surface_says_so(open_session, tmp_path):
    path = tmp_path / "line.npy"
    np.save(path, np.c_[np.arange(100.0), np.zeros(100), np.zeros(100)])
    session = open_session([str(path)])
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.answer is not None
    assert pane.edges is None
    assert "one line" in pane.answer.error


def test_error_of_the_detector_is_shown_and_survived(open_session, hall_file, capsys):
    def detect(cloud, run, progress):
        if run.scale == 1:
            raise ZeroDivisionError("a bug")
        return edgel.detect(cloud)

    session = open_session([hall_file], detect=detect)
    assert session.wait_idle(TIMEOUT)
    answer = session.panes()[0].answer
    assert answer is not None
    assert "a bug" in answer.error
    assert "ZeroDivisionError" in capsys.readouterr().err
    session.settings = Settings(scale=2.0)
    assert session.wait_idle(TIMEOUT)
    assert session.panes()[0].edges is not None


def test_edges_that_did_not_change_are_the_same_object(open_session, hall_file):
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    edges = session.panes()[0].edges
    assert session.panes(Settings(coloring=Coloring.HEIGHT, tangents=True))[0].edges is edges
    assert session.panes(Settings(strength=0.8))[0].edges is not edges


def test_nothing_is_drawn_anew_where_nothing_is_new(open_session, hall_file):
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    changes = []
    session.start(lambda: changes.append(session.doing))
    session.settings = Settings(strength=0.8)  # what moved it draws; there is no more to tell
    assert session.wait_idle(TIMEOUT)
    assert changes == []


def test_files_of_one_name_are_told_apart(open_session, hall_file, tmp_path):
    (tmp_path / "b").mkdir()
    other = tmp_path / "b" / "a hall.ply"
    edgel.write(other, edgel.Cloud(hall()))
    session = open_session([hall_file, str(other)])
    assert session.wait_idle(TIMEOUT)
    assert len({pane.name for pane in session.panes()}) == 2


def test_the_published_method_heeds_neither_strength_nor_angle(open_session, hall_file):
    session = open_session([hall_file])
    session.settings = Settings(methods=("paper",), strength=0.99, angle=1.5, kinds=EdgeKind(0))
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    same(pane.edges, edgel.paper.detect(hall()))


def test_edges_of_color_are_found_when_asked_for(open_session, tmp_path):
    xyz = roof(0.0)
    shade = np.where(xyz[:, 0] > 29.5, 200, 50).astype(np.uint8)
    edgel.write(tmp_path / "step.ply", edgel.Cloud(xyz, {"intensity": shade}))
    session = open_session([str(tmp_path / "step.ply")])
    assert session.wait_idle(TIMEOUT)
    assert session.panes()[0].run == Run(0, "edgel")
    session.settings = Settings(kinds=DEFAULT_KINDS | EdgeKind.COLOR)
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.run == Run(0, "edgel", more=EdgeKind.COLOR)
    assert pane.edges is not None
    same(pane.edges, edgel.detect(pane.cloud, kinds=DEFAULT_KINDS | EdgeKind.COLOR))
    assert pane.edges.count_kinds()["color"] > 20


def test_the_frame_is_found_when_asked_for(open_session, tmp_path):
    np.save(tmp_path / "organized.npy", roof(0.0).reshape(-1, len(np.unique(roof(0.0)[:, 1])), 3))
    session = open_session([str(tmp_path / "organized.npy")])
    session.settings = Settings(kinds=DEFAULT_KINDS | EdgeKind.FRAME)
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    same(pane.edges, edgel.detect(pane.cloud, kinds=DEFAULT_KINDS | EdgeKind.FRAME))
    assert pane.edges.count_kinds()["frame"] > 20


def test_model_and_command_do_not_load_viser():
    code = "import sys, edgel._cli, edgel._viewer.session, edgel._viewer.commands; print('viser' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
