"""The viewer without a browser: what is asked for, what runs, what is shown, what is said."""

import io
import shlex
import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import edgel
from edgel import EdgeKind, plot
from edgel._cli import app
from edgel.cloud import in_box
from edgel._detect import DEFAULT_KINDS
from edgel.plot.palette import KIND_COLORS
from edgel._neighbors.thinning import detect_at_scale, median_spacing, thin
from edgel._viewer import source as source_module
from edgel._viewer.colors import cloud_colors, colorings, edge_colors
from edgel._viewer.commands import command_line, python_lines
from edgel._viewer.latest import Latest
from edgel._viewer.layout import FIELD_OF_VIEW, lay_out
from edgel._viewer.pick import Picked, describe, find, pick, row_of
from edgel._viewer.save import edges_file, picture_file
from edgel._viewer.select import select
from edgel._viewer.session import LEAST_STRENGTH, Session
from edgel._viewer.settings import Coloring, Run, Settings

TIMEOUT = 60.0
PER_POINT = ("index", "kind", "strength", "position", "direction", "normals", "angle", "convex")


def roof(slope=1.0, side=60):
    x, y = np.meshgrid(np.arange(float(side)), np.arange(float(side)))
    return np.c_[x.ravel(), y.ravel(), -slope * abs(x.ravel() - side // 2)]


def hall():
    """Two roofs of different pitch beside each other, jittered: creases of 90 and of 53 degrees, and boundaries."""
    rng = np.random.default_rng(1)
    xyz = np.concatenate([roof(1.0), roof(0.5) + [80.0, 0, 0]])
    return xyz + rng.normal(0, 0.05, xyz.shape)


def same(a, b):
    assert a.num_points == b.num_points
    for name in PER_POINT:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@pytest.fixture
def open_session():
    sessions = []

    def start(paths, **options):
        sessions.append(Session(paths, **options))
        sessions[-1].start()
        return sessions[-1]

    yield start
    for session in sessions:
        session.close()


@pytest.fixture
def hall_file(tmp_path):
    path = tmp_path / "a hall.ply"
    edgel.write(path, edgel.Cloud(hall()))
    return str(path)


# The worker


def test_of_many_wakes_only_the_last_counts():
    wanted, seen, may_go = [0], [], threading.Event()

    def work():
        seen.append(wanted[0])
        may_go.wait(TIMEOUT)

    worker = Latest(work, "test")
    for value in range(1, 21):
        wanted[0] = value
        worker.wake()
        time.sleep(0.001)
    may_go.set()
    assert worker.wait_idle(TIMEOUT)
    worker.close()
    assert seen[-1] == 20
    assert len(seen) == 2


def test_worker_survives_an_error(capsys):
    calls = []

    def work():
        calls.append(1)
        raise KeyError("once")

    worker = Latest(work, "test")
    for _ in range(2):
        worker.wake()
        assert worker.wait_idle(TIMEOUT)
    worker.close()
    assert len(calls) == 2
    assert "KeyError" in capsys.readouterr().err


def test_closed_worker_does_nothing():
    calls = []
    worker = Latest(lambda: calls.append(1), "test")
    worker.close()
    worker.wake()
    assert worker.wait_idle(TIMEOUT)
    assert calls == []


class SlowDetector:
    """Stands in for the detector: takes ten stages, and remembers which runs began and which came to their end."""

    def __init__(self, edges):
        self.edges, self.begun, self.done = edges, [], []

    def __call__(self, cloud, scale, *, preset, progress, **_):
        self.begun.append(scale)
        for stage in range(10):
            progress(str(stage))
            time.sleep(0.01)
        self.done.append(scale)
        return replace(self.edges, parameters={"scale": scale})


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
    session.settings = Settings(method="side by side")
    assert session.wait_idle(TIMEOUT)
    assert all(pane.is_current and pane.edges is not None for pane in session.panes())
    assert len(session.panes()) == 30


def test_old_edges_stay_until_the_new_ones_are_there(open_session, hall_file):
    may_go = threading.Event()
    edges = edgel.detect(hall())

    def detect(cloud, scale, *, progress, **_):
        if scale > 1:
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


# Files


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
    def detect(cloud, scale, **_):
        if scale == 1:
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
    dense = roof(0.0) / 10  # a hundred times as dense as the sheet beside it, of as many points
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


# Filters


@pytest.mark.parametrize("strength", [LEAST_STRENGTH, 0.35, 0.5, 0.7, 0.93, 1.0])
def test_filtering_by_strength_equals_detecting(strength):
    cloud = edgel.Cloud(hall())
    settings = Settings(strength=strength)
    found = detect_at_scale(cloud, min_strength=LEAST_STRENGTH)
    same(select(found, cloud.xyz, settings, np.zeros((2, 3))), detect_at_scale(cloud, min_strength=strength))


def test_filtering_by_kind_equals_detecting():
    cloud = edgel.Cloud(hall())
    settings = Settings(kinds=EdgeKind.CREASE)
    shown = select(detect_at_scale(cloud), cloud.xyz, settings, np.zeros((2, 3)))
    same(shown, detect_at_scale(cloud, kinds="crease"))
    assert 0 < len(shown) < len(detect_at_scale(cloud))


def test_no_kind_shows_nothing():
    cloud = edgel.Cloud(hall())
    settings = Settings(kinds=EdgeKind(0))
    assert len(select(edgel.detect(cloud), cloud.xyz, settings, np.zeros((2, 3)))) == 0


def test_blunt_creases_disappear_unless_they_are_something_else():
    edges = edgel.detect(hall())
    angle = np.radians(70)
    crease, other = (edges.kind & EdgeKind.CREASE) > 0, (edges.kind & ~np.uint8(EdgeKind.CREASE)) > 0
    blunt = crease & (edges.angle < angle)
    assert (blunt & ~other).any()
    kept = edges.drop_blunt(angle)
    np.testing.assert_array_equal(kept.index, edges.index[~blunt | other])
    np.testing.assert_array_equal(kept.kind[np.isin(kept.index, edges.index[blunt & other])] & EdgeKind.CREASE, 0)
    assert (edges.drop_blunt(0.0).kind == edges.kind).all()


def test_blunt_crease_that_ends_the_surface_keeps_that():
    edges = edgel.detect(hall())
    both = replace(edges, kind=np.full(len(edges), 9, np.uint8), angle=np.full(len(edges), 0.1))
    kept = both.drop_blunt(0.2)
    assert len(kept) == len(edges)
    assert (kept.kind == EdgeKind.BOUNDARY).all()
    assert len(replace(both, angle=np.full(len(edges), np.nan)).drop_blunt(0.2)) == len(edges)


def test_crop_shows_what_lies_inside(open_session, hall_file):
    session = open_session([hall_file])
    session.settings = Settings(crop=((0.0, 0.4), (0.25, 1.0), (0.0, 1.0)))
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    shown = pane.cloud.xyz[pane.edges.index]
    low, high = pane.source.low, pane.source.high
    assert shown[:, 0].max() <= low[0] + 0.4 * (high[0] - low[0])
    assert shown[:, 1].min() >= low[1] + 0.25 * (high[1] - low[1])
    assert np.isinf(pane.box[0, 0])
    everything = edgel.detect(pane.cloud)
    assert len(pane.edges) == in_box(pane.cloud.xyz, pane.box)[everything.index].sum()


def test_the_published_method_heeds_neither_strength_nor_angle(open_session, hall_file):
    session = open_session([hall_file])
    session.settings = Settings(method="paper", strength=0.99, angle=1.5, kinds=EdgeKind(0))
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    same(pane.edges, edgel.paper.detect(hall()))


# Scale


def test_thinning_keeps_one_point_a_voxel_whatever_the_order():
    rng = np.random.default_rng(0)
    xyz = np.concatenate([rng.random((3000, 3)), rng.integers(0, 5, (500, 3)) / 5.0])  # the latter with many ties
    rows = thin(xyz, 0.1)
    cells = np.floor((xyz - xyz.min(axis=0)) / 0.1)
    assert len(rows) == len(np.unique(cells, axis=0)) == len(np.unique(cells[rows], axis=0))
    order = rng.permutation(len(xyz))
    shuffled = xyz[order][thin(xyz[order], 0.1)]
    np.testing.assert_array_equal(np.unique(shuffled, axis=0), np.unique(xyz[rows], axis=0))


def test_thinning_far_apart_points_does_not_overflow():
    xyz = np.array([[0.0, 0, 0], [1e9, 1e9, 1e9], [-1e9, 5, 1e9], [0.1, 0, 0]])
    assert len(thin(xyz, 1.0)) == 3


def test_thinning_leaves_out_what_is_not_finite():
    xyz = np.vstack([[np.nan] * 3, roof()])
    assert thin(xyz, 1e-3)[0] == 1


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan])
def test_bad_sizes_are_refused(size):
    with pytest.raises(ValueError, match="size"):
        thin(roof(), size)
    with pytest.raises(ValueError, match="scale"):
        detect_at_scale(roof(), size)


def test_scale_one_is_detect():
    same(detect_at_scale(hall()), edgel.detect(hall()))


def test_scale_finds_only_what_is_larger():
    x, y = np.meshgrid(np.arange(150.0), np.arange(150.0))
    z = np.maximum(40.0 - abs(x - 75.0), 0.0) + np.maximum(3.0 - abs(x - 18.0), 0.0)  # a roof, and a rib 6 wide
    cloud = np.c_[x.ravel(), y.ravel(), z.ravel()]
    found = [edgel.detect(cloud, kinds="crease"), detect_at_scale(cloud, 8.0, kinds="crease")]
    at = [cloud[edges.index, 0] for edges in found]
    assert (abs(at[0] - 18) < 6).any()
    assert not (abs(at[1] - 18) < 6).any()
    assert (abs(at[1] - 75) <= 8).sum() > 5
    assert found[1].num_points == len(cloud)


def test_rows_at_a_scale_are_those_of_the_whole_cloud():
    xyz = np.vstack([[np.nan] * 3, hall()])
    edges = detect_at_scale(xyz, 3.0)
    assert edges.num_points == len(xyz)
    assert edges.num_dropped == 1
    assert (np.diff(edges.index) > 0).all()
    spacing = median_spacing(xyz)
    assert (np.linalg.norm(edges.position - xyz[edges.index], axis=1) < 10 * spacing).all()


def test_median_spacing_does_not_count_repeats():
    assert median_spacing(np.repeat(roof(0.0), 2, axis=0)) == 0.0
    assert median_spacing(np.vstack([roof(0.0), roof(0.0)[:50]])) == 1.0


# What repeats it


every_setting = pytest.mark.parametrize(
    "settings",
    [
        Settings(),
        Settings(strength=0.8),
        Settings(kinds=EdgeKind.CREASE | EdgeKind.BOUNDARY),
        Settings(angle=np.radians(70), scale=2.0),
        Settings(crop=((0.1, 0.7), (0.0, 1.0), (0.0, 1.0)), strength=0.6),
        Settings(method="paper"),
        Settings(method="paper", scale=2.0, crop=((0.0, 1.0), (0.3, 0.9), (0.0, 1.0))),
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


# Saved, drawn, clicked


@pytest.mark.parametrize("extension", [".ply", ".pcd", ".npz", ".xyz"])
def test_saved_edges_are_those_of_detect(open_session, hall_file, extension, tmp_path):
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    name, content = edges_file(session.panes()[0], extension)
    assert name == f"a hall_edges{extension}"
    (tmp_path / name).write_bytes(content)
    written, cloud = edgel.read(tmp_path / name), edgel.read(hall_file)
    edges = edgel.detect(cloud)
    np.testing.assert_array_equal(written.xyz, cloud.xyz[edges.index])


def test_picture_shows_what_is_seen(open_session, hall_file):
    session = open_session([hall_file])
    settings = Settings(crop=((0.0, 0.5), (0.0, 1.0), (0.0, 1.0)), coloring=Coloring.HEIGHT, by_strength=True)
    session.settings = settings
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    name, content = picture_file(pane, np.array([0.0, 0.0, -1.0]), settings)
    assert name == "a hall_edges.png"
    shown = np.asarray(Image.open(io.BytesIO(content)))
    cloud = pane.cloud.take(in_box(pane.cloud.xyz, pane.box))
    rows = np.flatnonzero((cloud.xyz[:, None] == pane.cloud.xyz[pane.edges.index]).all(axis=2).any(axis=1))
    edges = replace(pane.edges, index=rows, num_points=len(cloud))
    look = {"color_by": "height", "edge_color": "strength", "size": (1600, 1200)}
    np.testing.assert_array_equal(shown, plot.picture(cloud, edges, direction=[0, 0, -1], **look))


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


def test_clouds_stand_side_by_side(open_session, hall_file, tmp_path):
    small = tmp_path / "small.npy"
    np.save(small, roof() * 0.001 + [637012.0, 849028.0, 400.0])
    session = open_session([hall_file, str(small)])
    assert session.wait_idle(TIMEOUT)
    panes = session.panes()
    layout = lay_out([pane.source for pane in panes])
    assert not layout.same_scale
    boxes = []
    for pane, place in zip(panes, layout.places, strict=True):
        shown = place.to_scene(pane.cloud.xyz)
        assert shown.dtype == np.float32
        assert np.abs(shown).max() < 5
        boxes.append(shown @ layout.right)
        direction = np.array([0.3, 0.4, 0.5])
        np.testing.assert_allclose(place.rotation @ place.to_cloud(direction), direction)
    assert boxes[0].max() < boxes[1].min()
    for aspect in (0.5, 2.0):
        view = layout.view(aspect)
        for pane, place in zip(panes, layout.places, strict=True):
            seen = place.to_scene(pane.cloud.xyz) - view.position
            depth = seen @ layout.away
            assert (np.abs(seen @ layout.right) < np.tan(FIELD_OF_VIEW / 2) * aspect * depth).all()
            assert (np.abs(seen @ np.cross(layout.right, layout.away)) < np.tan(FIELD_OF_VIEW / 2) * depth).all()


def test_the_first_view_is_filled(open_session, tmp_path):
    depth = np.linspace(1.0, 3.0, 40)[:, None, None]
    across = np.linspace(-0.5, 0.5, 40)
    columns = np.broadcast_arrays(depth * across[:, None], depth * across, depth)
    pyramid = np.stack(columns, axis=-1).reshape(-1, 3)
    np.save(tmp_path / "pyramid.npy", pyramid)  # narrow where it is near: its box reaches far beside it there
    session = open_session([str(tmp_path / "pyramid.npy")])
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    layout = lay_out([pane.source])
    view = layout.view(1.0)
    seen = layout.places[0].to_scene(pane.cloud.xyz) - view.position
    reach = np.abs(np.stack([seen @ layout.right, seen @ np.cross(layout.right, layout.away)])) / (seen @ layout.away)
    assert 0.9 < reach.max() / np.tan(FIELD_OF_VIEW / 2) < 1


def test_colors_are_offered_where_the_file_has_them(open_session, tmp_path):
    xyz = hall()
    red = np.linspace(0, 255, len(xyz)).astype(np.uint8)
    color = {"red": red, "green": red[::-1], "blue": red // 2}
    edgel.write(tmp_path / "rgb.ply", edgel.Cloud(xyz, {**color, "intensity": red}))
    edgel.write(tmp_path / "plain.ply", edgel.Cloud(xyz))
    session = open_session([str(tmp_path / "rgb.ply"), str(tmp_path / "plain.ply")])
    assert session.wait_idle(TIMEOUT)
    rgb, plain = session.sources
    assert set(colorings(rgb)) == set(Coloring)
    assert set(colorings(plain)) == {Coloring.GREY, Coloring.HEIGHT, Coloring.NORMALS}
    own = cloud_colors(rgb, rgb.few, Coloring.OWN, np.eye(3))
    np.testing.assert_allclose(own, np.column_stack(list(color.values())), atol=1)
    for coloring in Coloring:
        drawn = cloud_colors(rgb, rgb.few, coloring, np.eye(3))
        assert drawn.shape == xyz.shape
        assert drawn.dtype == np.uint8
        assert drawn.std() > 5


def test_edges_of_color_are_found_when_asked_for(open_session, tmp_path):
    xyz = roof(0.0)
    shade = np.where(xyz[:, 0] > 29.5, 200, 50).astype(np.uint8)
    edgel.write(tmp_path / "step.ply", edgel.Cloud(xyz, {"intensity": shade}))
    session = open_session([str(tmp_path / "step.ply")])
    assert session.wait_idle(TIMEOUT)
    assert session.panes()[0].run == Run(0, "default")
    session.settings = Settings(kinds=DEFAULT_KINDS | EdgeKind.COLOR)
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.run == Run(0, "default", color=True)
    assert pane.edges is not None
    same(pane.edges, edgel.detect(pane.cloud, kinds=DEFAULT_KINDS | EdgeKind.COLOR))
    assert pane.edges.count_kinds()["color"] > 20


def test_heights_wear_the_colors_of_pictures(open_session, tmp_path):
    x, y = np.meshgrid(np.arange(200.0), np.arange(100.0))
    steps = np.c_[x.ravel(), y.ravel(), 10 * np.floor(x.ravel() / 50)]  # four level terraces
    edgel.write(tmp_path / "steps.ply", edgel.Cloud(steps))
    session = open_session([str(tmp_path / "steps.ply")])
    assert session.wait_idle(TIMEOUT)
    (source,) = session.sources
    on_page = cloud_colors(source, source.few, Coloring.HEIGHT, np.eye(3)).astype(int)
    drawn = plot.picture(source.cloud, direction=[0, 0, -1], color_by="height", size=(800, 600)).astype(int)
    for terrace in range(4):
        middle = np.flatnonzero((steps[:, 0] == 50 * terrace + 25) & (steps[:, 1] == 50))[0]
        assert (abs(drawn - on_page[middle]).max(axis=2) <= 6).sum() > 5000


def test_unlikely_edges_are_pale():
    edges = edgel.detect(hall())
    creases = edges.take(edges.kind == EdgeKind.CREASE).take(np.arange(3))
    colors = edge_colors(replace(creases, strength=np.array([0.2, 0.35, 0.5])), by_strength=False, least=0.2)
    away = abs(colors.astype(int) - KIND_COLORS[EdgeKind.CREASE]).sum(axis=1)
    assert away[0] > away[1] > away[2] == 0
    assert (colors[:2].min(axis=1) < 200).all()  # and yet of their kind


def test_edge_colors_tell_kinds_and_strength():
    edges = edgel.detect(hall())
    crease = edges.kind == EdgeKind.CREASE
    assert (edge_colors(edges, by_strength=False, least=0.5)[crease] == KIND_COLORS[EdgeKind.CREASE]).all()
    by_strength = edge_colors(edges, by_strength=True, least=0.5).astype(int).sum(axis=1)
    assert by_strength[edges.strength.argmin()] > by_strength[edges.strength.argmax()]


# The command


def test_model_and_command_do_not_load_viser():
    code = "import sys, edgel.cli, edgel.view.session, edgel.view.commands; print('viser' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
