"""The command line and the Python lines of the viewer find what is seen."""

import shlex

import numpy as np
import pytest
from hall import TIMEOUT, same

import edgel
from edgel import EdgeKind
from edgel._cli import app
from edgel._viewer.commands import command_line, python_lines
from edgel._viewer.settings import Settings

every_setting = pytest.mark.parametrize(
    "settings",
    [
        Settings(),
        Settings(strength=0.8),
        Settings(kinds=EdgeKind.CREASE | EdgeKind.BOUNDARY),
        Settings(angle=np.radians(70), scale=2.0),
        Settings(crop=((0.1, 0.7), (0.0, 1.0), (0.0, 1.0)), strength=0.6),
        Settings(methods=("paper",)),
        Settings(methods=("paper",), scale=2.0, crop=((0.0, 1.0), (0.3, 0.9), (0.0, 1.0))),
    ],
    ids=["default", "strength", "kinds", "angle and scale", "crop", "paper", "paper cropped at a scale"],
)


@every_setting
def test_python_lines_find_what_is_seen(open_session, hall_file, settings, tmp_path, monkeypatch):
    session = open_session([hall_file])
    session.settings = settings
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    assert len(pane.edges) > 0
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(python_lines(pane, settings), names)
    same(names["edges"], pane.edges)
    assert list(tmp_path.glob("*edges.ply"))


@every_setting
def test_command_line_finds_what_is_seen(open_session, hall_file, settings, tmp_path, monkeypatch):
    session = open_session([hall_file])
    session.settings = settings
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    monkeypatch.chdir(tmp_path)
    words = shlex.split(command_line(pane, settings))
    assert words[0] == "edgel"
    with pytest.raises(SystemExit) as ended:
        app(words[1:])
    assert ended.value.code == 0
    written = edgel.read(words[-1])
    np.testing.assert_array_equal(written.xyz, pane.cloud.xyz[pane.edges.index])


def test_without_a_kind_there_is_nothing_to_repeat(open_session, hall_file):
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    assert "chosen" in command_line(session.panes()[0], Settings(kinds=EdgeKind(0)))
    assert "chosen" in python_lines(session.panes()[0], Settings(kinds=EdgeKind(0)))
