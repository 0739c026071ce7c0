"""The first minute and the ten-thousandth cloud: from an empty cache of kernels to the first edges, and small clouds.

Run: python benchmarks/first_run.py [ROUNDS [CLOUDS]] (part of make bench). Medians of five, CPU seconds of all processes
and wall seconds. Kernels are compiled from their sources, or brought along where ``python packaging/kernel_forms.py`` has
been run: the first line says which.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import edgel
from edgel._kernels import forms

ROUNDS = 5
CLOUDS = 10_000  # small ones, asked for at once
BROKEN = 1000  # of so many one is too small to be a cloud
CHECKED = 100  # of so many one is asked for again, alone
LIST = "import sys, numpy, edgel; edgel.detect(numpy.load(sys.argv[1]))"
FRAME = """
import sys, numpy, edgel
camera = edgel.Intrinsics(525, 525, 320, 240)
edgel.detect(edgel.from_depth(numpy.load(sys.argv[1]), camera))
"""
WANTED = {
    "first edges of a part of 36,000 points": "wall 8 s",
    "first edges of a depth frame, 640 x 480": "wall 8 s",
    "import edgel": "wall 0.3 s",
    "detect, 1,024 points": "CPU 0.002 s",
}


def part(num_points: int, seed: int = 1) -> np.ndarray:
    """A box without a lid, sampled at random."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, 1, (num_points, 3))
    face = rng.integers(0, 5, num_points)
    xyz[np.arange(num_points), face // 2] = face % 2
    return xyz


def frame() -> np.ndarray:
    """What a depth camera sees of a box before a wall, (480, 640) uint16, in millimetres."""
    row, col = np.mgrid[:480, :640]
    inside = (abs(row - 280) < 100) & (abs(col - 320) < 160)
    own = np.random.default_rng(2).normal(0, 2.0, row.shape)
    noise = sum(np.roll(own, (i, j), (0, 1)) for i in range(5) for j in range(5)) / 5  # as cameras match windows
    depth = np.where(inside, 700 + abs(col - 320), 1000 + row / 12) + noise
    depth[:40] = 0
    return np.round(depth).astype(np.uint16)


def program(code: str, *arguments: str) -> tuple[float, float]:
    """CPU and wall seconds of a Python program whose cache of kernels is empty, and of the processes that it starts."""
    with tempfile.TemporaryDirectory() as cache:
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(
            [sys.executable, "-c", code, *arguments], check=True, env=os.environ | {"NUMBA_CACHE_DIR": cache}
        )
        wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall


def here(work: Callable[[], Any], repeats: int) -> tuple[float, float]:
    """CPU and wall seconds of a piece of work in this process, on average over some repeats."""
    cpu, start = time.process_time(), time.perf_counter()
    for _ in range(repeats):
        work()
    return (time.process_time() - cpu) / repeats, (time.perf_counter() - start) / repeats


def many(count: int) -> tuple[float, float]:
    """CPU and wall seconds for each of many small clouds asked for at once; ends where an answer is another than alone."""
    clouds = [part(2 if seed % BROKEN == BROKEN - 1 else 1024, seed) for seed in range(count)]
    found: list[edgel.Detections] = []
    cpu, wall = here(lambda: found.append(edgel.detect_many(clouds)), 1)
    broken = [number for number, cloud in enumerate(clouds) if len(cloud) == 2]
    if list(found[0].failures) != broken:
        raise SystemExit(f"detect_many: {list(found[0].failures)} failed instead of {broken}")
    for number in range(0, count, CHECKED):
        together, alone = vars(found[0].edges[number]), vars(edgel.detect(clouds[number]))
        fields = [name for name, value in alone.items() if isinstance(value, np.ndarray)]
        if any(not np.array_equal(together[name], alone[name], equal_nan=True) for name in fields):
            raise SystemExit(f"detect_many: cloud {number} has another answer than alone")
    return cpu / count, wall / count


def run(rounds: int = ROUNDS, clouds: int = CLOUDS) -> list[dict[str, Any]]:
    """Measure all of it, one round after the other."""
    small = part(1024)
    with tempfile.TemporaryDirectory() as folder:
        jobs = {"a part of 36,000 points": (LIST, part(36_000)), "a depth frame, 640 x 480": (FRAME, frame())}
        work: dict[str, Callable[[], tuple[float, float]]] = {}
        for number, (name, (code, array)) in enumerate(jobs.items()):
            path = Path(folder) / f"{number}.npy"
            np.save(path, array)
            work[f"first edges of {name}"] = partial(program, code, str(path))
        work["import edgel"] = partial(program, "import edgel")
        work["detect, 1,024 points"] = partial(here, lambda: edgel.detect(small), 20)
        edgel.detect(small)
        measured = {name: [once() for _ in range(rounds)] for name, once in work.items()}
    measured[f"detect_many, each of {clouds:,} such clouds"] = [many(clouds)]
    return [
        {
            "work": name,
            "cpu": statistics.median(cpu for cpu, _ in each),
            "wall": statistics.median(wall for _, wall in each),
            "wanted": WANTED.get(name, ""),
            "rounds": each,
        }
        for name, each in measured.items()
    ]


def table(rows: list[dict[str, Any]]) -> str:
    """The measurements as a table."""
    lines = ["| | CPU, s | wall, s | wanted |", "|---|---|---|---|"]
    return "\n".join(
        lines + [f"| {row['work']} | {row['cpu']:.4g} | {row['wall']:.4g} | {row['wanted']} |" for row in rows]
    )


if __name__ == "__main__":
    print(f"Kernels {'brought along' if forms.FILE.exists() else 'compiled from their sources'}.\n")
    print(table(run(*map(int, sys.argv[1:]))))
