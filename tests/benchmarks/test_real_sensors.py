"""Real frames of the repository and how they are scored: the truth scores best, both detectors see the same."""

import numpy as np
import pytest
import real_frames
import real_sensors

FRAMES = {frame.name: frame for frame in real_frames.frames()}
SWEEPS = [frame for frame in FRAMES.values() if frame.board is not None]


def on_board(frame):
    """Points on the board, metres inside its outline, (rings, shots)."""
    xyz = frame.cloud.xyz.reshape(*frame.cloud.shape, 3)
    depth, off = real_frames.inside_board(xyz, frame.board)
    return np.nan_to_num(np.abs(off), nan=np.inf) < real_frames.OFF_PLANE, depth


def test_the_frames_of_the_repository():
    assert {name: frame.cloud.shape for name, frame in FRAMES.items()} == {
        "ensenso": (512, 640),
        "ouster64_pose2": (64, 1024),
        "phoxi": (772, 1032),
        "primesense": (480, 640),
        **{f"vlp16_pose{number}": (16, 1808) for number in ("02", "09", "17")},
    }
    for frame in FRAMES.values():
        assert frame.cloud.viewpoint is not None
        assert 0.6 < np.isfinite(frame.cloud.xyz[:, 0]).mean() < 0.9
    assert len(SWEEPS) == 4
    for frame in SWEEPS:
        assert frame.board is not None
        sides = np.linalg.norm(np.diff(frame.board, axis=0, append=frame.board[:1]), axis=1)
        np.testing.assert_allclose(np.sort(sides), [0.61, 0.61, 0.85, 0.85], atol=0.02)


@pytest.mark.parametrize("frame", SWEEPS, ids=lambda frame: frame.name)
def test_the_truth_scores_best_and_nothing_and_everything_do_not(frame):
    on, depth = on_board(frame)
    rim = on & (np.abs(depth) < real_frames.OUTSIDE)
    truth = real_frames.board_figures(frame, rim.ravel().astype(np.uint8))
    assert truth["rim"] > 0.9  # of a slanted rim some shots lie farther inside
    assert truth["false"] == 0
    nothing = real_frames.board_figures(frame, np.zeros(len(frame.cloud), np.uint8))
    assert nothing == {"rim": 0, "false": 0}
    everything = real_frames.board_figures(frame, np.ones(len(frame.cloud), np.uint8))
    assert everything == {"rim": 1, "false": 1000}


def test_a_depth_of_nothing_is_no_point():
    cloud = real_frames.back_projected(np.array([[0.0, 2.0], [4.0, 0.0]], np.float32), (2.0, 4.0, 1.0, 0.0))
    assert cloud.shape == (2, 2)
    np.testing.assert_array_equal(cloud.xyz[[1, 2]], [[0, 0, 2], [-2, 1, 4]])
    assert np.isnan(cloud.xyz[[0, 3]]).all()


def test_detectors_take_turns_and_answer_once_a_frame():
    asked = []

    def detector(name, seconds):
        def detect(points):
            asked.append(name)
            return np.full(points.shape[:2], len(name), np.uint8), seconds

        return detect

    turns = real_sensors.Turns({real_sensors.EDGEL: detector("a", 2.0), "PCL": detector("bc", 1.0)}, rounds=2)
    one, other = np.zeros((2, 3, 3)), np.ones((2, 3, 3))
    assert (turns.of(real_sensors.EDGEL)(one) == 1).all()
    assert asked == ["a", "bc"] * 3  # the first of all warms up
    assert (turns.of("PCL")(one.copy()) == 2).all()
    assert (turns.of("PCL")(other) == 2).all()
    assert asked == ["a", "bc"] * 5
    assert turns.seconds == {real_sensors.EDGEL: [2.0, 2.0], "PCL": [1.0, 1.0]}


@pytest.fixture
def real(tmp_path):
    """A folder as the sets are kept in: a program that scores, and one set of five frames."""
    (tmp_path / "stereo" / "dev").mkdir(parents=True)
    for number in range(5):
        depth = np.tile(np.linspace(1, 2 + number, 40), (30, 1))
        np.savez(tmp_path / "stereo" / "dev" / f"frame{number}.npz", depth=depth)
        (tmp_path / "stereo" / "dev" / f"frame{number}_creases.json").write_text("[]")
    (tmp_path / "score.py").write_text(
        "import glob\n"
        "import numpy as np\n"
        "def stereo(folder, detect):\n"
        "    files = sorted(glob.glob(folder + '/*.npz'))\n"
        "    z = [np.load(f)['depth'] for f in files]\n"
        "    found = [detect(np.dstack([np.indices(d.shape)[::-1].T.swapaxes(0, 1) / 40, d])) for d in z]\n"
        "    return dict(share=np.mean([(k > 0).mean() for k in found]), frames=len(files))\n"
    )
    return tmp_path


def test_sets_are_scored_where_they_are(real, capsys, monkeypatch):
    monkeypatch.setattr(real_sensors, "detectors", lambda organized: {real_sensors.EDGEL: real_sensors.detect_edgel})
    (row,) = real_sensors.run(real, only=["stereo"], quick=True)
    assert row["set"] == "stereo"
    assert row["figures"]["frames"] == real_sensors.QUICK_FRAMES
    assert row["ms"] > 0
    assert real_sensors.run(real, only=["mosd"]) == []
    assert "skipped: mosd" in capsys.readouterr().out
    assert real_sensors.run(real / "nowhere", only=["mosd"]) == []
    assert capsys.readouterr().out.strip().splitlines()[-1].startswith("skipped: mosd, ycbv")


def test_tables_say_how_many_times_as_long():
    rows = [
        real_sensors.row("mosd", real_sensors.EDGEL, {"jump": 0.5, "frames": 2}, [0.2, 0.4]),
        real_sensors.row("mosd", real_sensors.PCL, {"jump": 1.0, "frames": 2}, [0.1, 0.2]),
    ]
    assert real_sensors.tables(rows).splitlines()[2:] == [
        "| edgel default | 0.500 | 2 | 300.0 | 2.00 |",
        "| PCL organized, gradient | 1.000 | 2 | 150.0 | 1.00 |",
    ]
