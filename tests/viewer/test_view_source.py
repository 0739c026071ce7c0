"""Files in the viewer: why one cannot be read, and which of its points are drawn."""

import numpy as np
from hall import TIMEOUT, hall, roof, same

import edgel
from edgel._viewer import source as source_module
from edgel._viewer.settings import Settings
from edgel.cloud import in_box


def test_unreadable_files_say_why_and_the_others_are_shown(open_session, hall_file, tmp_path):
    (tmp_path / "empty.ply").touch()
    (tmp_path / "words.ply").write_text("no cloud at all\n")
    np.save(tmp_path / "two.npy", np.zeros((2, 3)))
    names = ["no.ply", "empty.ply", "words.ply", "two.npy", "thing.xyzzy"]
    session = open_session([*(str(tmp_path / name) for name in names), hall_file])
    assert session.wait_idle(TIMEOUT)
    errors = [source.error for source in session.sources]
    for error, words in zip(errors, ["no such file", "empty", "not a PLY", "at least 3", "no such file"], strict=False):
        assert words in error
        assert "Traceback" not in error
    assert errors[-1] == ""
    assert [pane.source.name for pane in session.panes()] == ["a hall.ply"]


def test_errors_of_any_kind_become_words(open_session, hall_file):
    def read(path, **_):
        raise MemoryError

    assert "memory" in _only_error(open_session([hall_file], read=read))

    def read_badly(path, **_):
        raise RuntimeError("a bug")

    assert "a bug" in _only_error(open_session([hall_file], read=read_badly))


def _only_error(session):
    assert session.wait_idle(TIMEOUT)
    return session.sources[0].error


def test_large_clouds_are_drawn_thinned_and_searched_whole(open_session, hall_file, monkeypatch):
    monkeypatch.setattr(source_module, "MAX_SHOWN", 1000)
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert not pane.source.drawn(Settings(every_point=True)).whole
    assert len(pane.source.shown) == 1000
    assert pane.source.normals is not None
    assert pane.source.normals.shape == (1000, 3)
    assert pane.edges is not None
    same(pane.edges, edgel.detect(hall()))


def test_many_points_are_drawn_in_part_that_lies_evenly(open_session, tmp_path, monkeypatch):
    monkeypatch.setattr(source_module, "FEW", 500)
    dense = roof(0.0) / 10  # a hundred times as dense as the plane beside it, of as many points
    edgel.write(tmp_path / "two.ply", edgel.Cloud(np.concatenate([dense, roof(0.0) + [100.0, 0, 0]])))
    session = open_session([str(tmp_path / "two.ply")])
    assert session.wait_idle(TIMEOUT)
    (source,) = session.sources
    drawn = source.drawn(Settings())
    assert not drawn.whole
    assert 250 < len(drawn.at) <= 500
    assert source.cloud is not None
    x = source.cloud.xyz[source.shown[drawn.at], 0]
    assert (x > 50).sum() > 10 * (x < 50).sum() > 0
    every = source.drawn(Settings(every_point=True))
    assert every.whole
    assert len(every.at) == 7200
    assert drawn.spacing > 1.5 > every.spacing


def test_a_small_part_is_drawn_with_every_point(open_session, hall_file, monkeypatch):
    monkeypatch.setattr(source_module, "FEW", 1000)
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    cropped = Settings(crop=((0.0, 0.1), (0.0, 1.0), (0.0, 1.0)))
    drawn = pane.source.drawn(cropped)
    assert drawn.whole
    (pane,) = session.panes(cropped)
    np.testing.assert_array_equal(pane.source.shown[drawn.at], np.flatnonzero(in_box(pane.cloud.xyz, pane.box)))
