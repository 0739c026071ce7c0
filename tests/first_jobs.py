"""The kernels of the first jobs: what `edgel warmup` compiles, and what other processes compile beside the first run.

``python tests/first_jobs.py`` writes src/edgel/_kernels/first_jobs.txt anew: do that where kernels have changed.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

import edgel
from edgel._kernels import ahead
from edgel._kernels.cache import KernelCache

FILE = Path(ahead.__file__).with_name(ahead.FILE)


def surface() -> edgel.Cloud:
    """Make a box without a lid, so that it has rims."""
    rng = np.random.default_rng(1)
    xyz = rng.uniform(0, 1, (3000, 3))
    face = rng.integers(0, 5, len(xyz))
    xyz[np.arange(len(xyz)), face // 2] = face % 2  # the fifth face is z = 0
    return edgel.Cloud(xyz + rng.normal(0, 0.002, xyz.shape))


def frame() -> edgel.Cloud:
    """Make a frame of a depth camera, in whole millimetres: a box before a wall, and no return above."""
    row, col = np.mgrid[:120, :160]
    own = np.random.default_rng(1).normal(0, 3.0, row.shape)
    shared = sum(np.roll(own, (i, j), (0, 1)) for i in range(5) for j in range(5)) / 5  # as depth cameras match windows
    depth = np.where((abs(row - 70) < 25) & (abs(col - 80) < 40), 700 + 4 * abs(col - 80), 1000) + 0.3 * row + shared
    depth[:10] = 0
    return edgel.from_depth(np.round(depth).astype(np.uint16), edgel.Intrinsics(130, 130, 80, 60))


JOBS = {"surface": surface, "frame": frame}


def needed(job: str) -> dict[str, str]:
    """Return the kernels that a job needs, in this order, and the types of their arguments."""
    found: dict[str, str] = {}
    loaded: list[tuple[str, str]] = []
    read = KernelCache.load_overload

    def load_overload(self: KernelCache, sig: Any, target_context: Any) -> Any:
        function = self._function
        loaded.append((f"{function.__module__}:{function.__qualname__}", ahead.words_of(sig)))
        return read(self, sig, target_context)

    KernelCache.load_overload = load_overload
    edgel.detect(JOBS[job]())
    for name, words in loaded:
        assert found.setdefault(name, words) == words, f"{name} is compiled for {words} and for {found[name]}"
    return found


def lines(job: str) -> list[str]:
    """Write down the kernels of a job, found out by a process that has used none before."""
    done = subprocess.run([sys.executable, __file__, job], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


if __name__ == "__main__":
    if sys.argv[1:]:
        for name, words in needed(sys.argv[1]).items():
            print(sys.argv[1], name, words)
    else:
        FILE.write_text("\n".join(line for job in JOBS for line in lines(job)) + "\n")
