"""The programs of examples/ run as people start them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from edgel.plot.palette import KIND_COLORS

LIVE = Path(__file__).parent.parent / "examples" / "live.py"


def live(*words, code=0):
    run = subprocess.run(
        [sys.executable, str(LIVE), *map(str, words)], capture_output=True, text=True, env=os.environ, timeout=300
    )
    assert run.returncode == code, run.stderr
    return run


@pytest.fixture
def recording(tmp_path):
    """Four frames in which a box moves to the right before a wall."""
    for number in range(4):
        depth = np.full((60, 80), 2000, np.uint16)
        depth[20:40, 20 + 5 * number : 40 + 5 * number] = 1500
        depth[:3] = 0
        Image.fromarray(depth).save(tmp_path / f"{number:03d}.png")
    (tmp_path / "camera.json").write_text(json.dumps({"fx": 80, "fy": 80, "ppx": 39.5, "ppy": 29.5}))
    return tmp_path


def test_live_plays_a_folder(recording):
    picture = recording.parent / "last.png"
    words = (recording, "--intrinsics", recording / "camera.json", "--kinds", "occluding", "--frames", 3)
    shown = live(*words, "--picture", picture).stdout
    lines = [line for line in shown.splitlines() if line]  # "\r" ends a line here
    assert [line.split(":")[0] for line in lines] == ["frame 1", "frame 2", "frame 3"]
    assert "frames/s" in lines[-1]
    assert "occluding" in lines[-1]
    assert "boundary" not in lines[-1]
    pixels = np.asarray(Image.open(picture))
    assert pixels.shape == (60, 80, 3)
    colored = (pixels == [*KIND_COLORS.values()][1]).all(axis=2)
    rows, cols = np.nonzero(colored)
    assert len(rows) > 60
    assert (abs(rows - 29.5) <= 10.5).all()
    assert (abs(cols - 39.5) <= 10.5).all()  # of the third frame


def test_live_takes_four_numbers(recording):
    shown = live(recording, "--intrinsics", 80, 80, 39.5, 29.5).stdout
    assert "frame 4: " in shown


def test_live_simulates_a_sensor():
    shown = live("--frames", 3).stdout
    assert "frame 3: " in shown
    assert "crease" in shown


def test_live_says_what_it_needs(tmp_path):
    assert "--intrinsics FILE" in live(tmp_path, code=2).stderr
    assert "no frame with depth" in live(tmp_path, "--intrinsics", 1, 1, 1, 1, code=1).stderr
