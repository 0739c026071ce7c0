"""Threads and processes: what a forked child, a spawned one, and many threads at once get."""

import multiprocessing
import os
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import edgel

USE = """
import multiprocessing, sys, threading
import numpy as np
import edgel

x, y = np.meshgrid(np.arange(150.0), np.arange(150.0))
roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 75)]

def found(_):
    return edgel.estimate_normals(roof).normals

if __name__ == "__main__":
    mine = found(0)
    with multiprocessing.get_context(sys.argv[1]).Pool(2) as pool:
        theirs = pool.map(found, range(3))
    assert all(np.array_equal(mine, other) for other in theirs)
    print("same")
"""


@pytest.mark.parametrize("start", ["fork", "spawn", "forkserver"])
def test_children_of_a_process_that_has_used_edgel_answer_the_same(start, tmp_path):
    """The pool of threads does not live on in a forked child: it makes its own."""
    if start not in multiprocessing.get_all_start_methods():
        pytest.skip(f"this system cannot {start}")
    script = tmp_path / "use.py"
    script.write_text(textwrap.dedent(USE))
    environment = os.environ | {"EDGEL_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", str(script), start],
        capture_output=True,
        text=True,
        timeout=240,
        env=environment,
        check=False,
    )
    assert done.stdout == "same\n", done.stderr


def test_many_threads_at_once_answer_as_one():
    x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    roofs = [np.c_[x.ravel(), y.ravel(), -slope * abs(x.ravel() - 30)] for slope in (0.5, 1.0, 2.0)]
    alone = [edgel.detect(roof) for roof in roofs]
    with ThreadPoolExecutor(6) as pool:
        together = list(pool.map(edgel.detect, roofs * 6))
    for number, found in enumerate(together):
        for name in ("index", "kind", "strength", "normals"):
            np.testing.assert_array_equal(getattr(found, name), getattr(alone[number % 3], name))
