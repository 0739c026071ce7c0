"""Octave reads what we write (skipped where it is not installed)."""

import shutil
import subprocess

import numpy as np
import pytest

import edgel

OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
pytestmark = pytest.mark.skipif(OCTAVE is None, reason="Octave is not installed (apt-get install octave)")


@pytest.mark.parametrize(("name", "separator"), [("a.xyz", " "), ("a.csv", ","), ("a.txt", " ")])
def test_text_reads_the_same_to_the_last_bit(tmp_path, name, separator):
    points = np.random.default_rng(0).normal(size=(50, 3)) * [1, 1e6, 1e-9]
    edgel.write(tmp_path / name, edgel.Cloud(points, {"label": np.arange(50, dtype=np.uint16)}))
    script = (
        f"a = dlmread('{tmp_path / name}', '{separator}', 1, 0); fid = fopen('{tmp_path / 'out.bin'}', 'w');"
        "fwrite(fid, a', 'double'); fclose(fid);"
    )
    subprocess.run([str(OCTAVE), "--quiet", "--no-gui", "--eval", script], check=True, capture_output=True, timeout=60)
    found = np.fromfile(tmp_path / "out.bin").reshape(50, 4)
    np.testing.assert_array_equal(found[:, :3], points)
    np.testing.assert_array_equal(found[:, 3], np.arange(50))
