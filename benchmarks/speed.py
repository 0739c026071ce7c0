"""Times of edgel and its rivals, interleaved in one run, medians of at least five rounds."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rivals import NORMALS, RIVALS

import edgel
from edgel import synth
from edgel.kdtree import build_index

ROUNDS = 5
SLOWEST = 20.0  # seconds: what took longer at one size is not tried at the next


def clouds(sizes: Sequence[int]) -> dict[int, np.ndarray]:
    """The tee, scanned with as many points."""
    return {size: synth.scan(synth.tee(), num_points=size).cloud.xyz for size in sizes}


def interleaved(work: dict[str, Callable[[], float]], rounds: int = ROUNDS) -> dict[str, list[float]]:
    """Seconds of each piece of work, one round after the other, so that a slow moment of the machine meets all alike."""
    seconds: dict[str, list[float]] = {name: [] for name in work}
    for name in work:
        work[name]()  # compiles, and warms caches and memory
    for _ in range(rounds):
        for name in work:
            seconds[name].append(work[name]())
    return seconds


def timed(function: Callable[[], Any]) -> Callable[[], float]:
    def once() -> float:
        start = time.perf_counter()
        function()
        return time.perf_counter() - start

    return once


def normals_of_all_points(sizes: Sequence[int], k: int = 16) -> list[dict[str, Any]]:
    """All-point normals, the building of whatever index included."""
    rows, too_slow = [], set()
    for size, points in clouds(sizes).items():
        work = {
            rival.name: (lambda rival=rival, points=points: rival.run(points, k)[1])
            for rival in NORMALS
            if rival.missing() is None and rival.name not in too_slow
        }
        rows += _rows("normals of all points", size, interleaved(work), too_slow)
    return rows


def edges(sizes: Sequence[int]) -> list[dict[str, Any]]:
    """Edge detection of the tee, each method with its defaults; methods for organized clouds can't take it."""
    rows, too_slow = [], set()
    for size, points in clouds(sizes).items():
        cloud = edgel.Cloud(points)
        spacing = float(np.sqrt(np.prod(np.ptp(points[:, :2], axis=0)) / size))
        work: dict[str, Callable[[], float]] = {"k-d tree of edgel": timed(lambda points=points: build_index(points))}
        for rival in RIVALS:
            if rival.missing() is None and not rival.organized_only and rival.name not in too_slow:
                work[rival.name] = lambda rival=rival, c=cloud, s=spacing: rival.run(c, s, rival.defaults).seconds
        rows += _rows("edges", size, interleaved(work), too_slow)
    return rows


def stages(rounds: int = ROUNDS) -> list[dict[str, Any]]:
    """Stages of both presets on the tee as the paper has it."""
    points = synth.scan(synth.tee()).cloud.xyz
    rows = []
    for preset in ("paper", "default"):
        edgel.detect(points, preset=preset)
        runs = [edgel.detect(points, preset=preset).seconds for _ in range(rounds)]
        rows += [
            {"preset": preset, "stage": stage, "seconds": float(np.median([run[stage] for run in runs]))}
            for stage in runs[0]
        ]
    return rows


def _rows(work: str, size: int, seconds: dict[str, list[float]], too_slow: set[str]) -> list[dict[str, Any]]:
    rows = []
    for name, each in seconds.items():
        median = float(np.median(each))
        rows.append({"work": work, "method": name, "points": size, "seconds": median, "rounds": each})
        print(f"  {work}, {size:,} points, {name}: {median:.3f} s", flush=True)
        if median > SLOWEST:
            too_slow.add(name)
    return rows
