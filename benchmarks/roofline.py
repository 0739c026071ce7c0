"""How near each stage comes to the memory's bandwidth, on the tee: bytes that must move, operations, time, threads.

Run: python benchmarks/roofline.py [--points 647984] [--rounds 7]. Prints a table in Markdown. A stage whose two threads
gain less than 1.7 should have a large share of the bandwidth of a copy by as many threads.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from edgel import paper, synth
from edgel.kdtree import _SHARED_LEVELS, bounds, build_index
from edgel.neighbors import visit_neighbors
from edgel.normals import by_offset, fit_planes
from edgel.parallel import kernel, run_slices
from edgel.project import back_project, grey_image, occupied_spacing, points_near, project

K = 16
CANDIDATES = 94  # points whose distance a query measures, the blocks of eight within its reach
COUNTS = 4.5  # times that they are counted, to find the k nearest


@dataclass(frozen=True)
class Stage:
    """Work on N points: bytes that go between memory and processor at least, and operations, for each point."""

    name: str
    work: Callable[[], object]
    bytes: float
    operations: float


@kernel
def _copy(start, stop, source, target):
    for i in range(start, stop):
        target[i] = source[i]


@kernel
def _look(first, places, squared, queries, order, xyz):
    pass


def stages(points: np.ndarray) -> list[Stage]:
    """The stages of the paper's method and of normals at all points."""
    lower, upper = bounds(points)
    grid = paper.choose_grid(points, None, None)
    image = np.pad(grey_image(project(points, grid), grid, 100.0), grid.frame)
    found = paper.canny_of_projection(image, 5, 1.4, 16.0, 40.0)
    window = paper.choose_tolerance(None, grid)
    rows = back_project(points, grid, found.edges, found.magnitude, window).rows
    share, index = len(rows) / len(points), build_index(points)
    levels = max(-(-len(points) // 16) - 1, 1).bit_length()
    search = CANDIDATES * (8 + 6 * COUNTS)
    pixels = image.size / len(points)
    return [
        Stage("bounding box", lambda: bounds(points), 24, 6),
        Stage("spacing", lambda: occupied_spacing(points, lower, upper), 40, 8),
        Stage("projection", lambda: project(points, grid), 64, 10),
        Stage("Canny", lambda: paper.canny_of_projection(image, 5, 1.4, 16.0, 40.0), 150 * pixels, 60 * pixels),
        Stage(
            "back-projection",
            lambda: back_project(points, grid, found.edges, found.magnitude, window),
            40,
            6 + 60 * share,
        ),
        Stage("points near edges", lambda: points_near(points, grid, rows, 2.99 * max(grid.pixel)), 26, 8),
        Stage(
            "edge normals",
            lambda: by_offset(paper.local_plane_fits(points, grid, rows, K)),
            26 + share * 300,
            8 + 2 * share * (search + CANDIDATES * 21 + 600),
        ),
        # Levels below the shared ones stay in a core's cache; each reads the keys four times and moves the points.
        Stage("k-d tree", lambda: build_index(points), 56 + 96 * min(levels, _SHARED_LEVELS) + 96, 20 * levels),
        Stage("normals of all", lambda: fit_planes(index, index, K), 80, search + CANDIDATES * 21 + 600),
        Stage(
            "lists of neighbours", lambda: visit_neighbors(_look, index, index, K), 32 + 32 * K, search + CANDIDATES * 3
        ),
    ]


def seconds(work: Callable[[], object], threads: int) -> float:
    os.environ["EDGEL_NUM_THREADS"] = str(threads)
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=647_984)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    points = synth.scan(synth.tee(), num_points=options.points).cloud.xyz
    source = np.zeros(max(32_000_000, points.size))
    target = np.empty_like(source)
    copy = Stage("copy", lambda: run_slices(_copy, len(source), source, target, size=1 << 20), 0, 0)
    every = [copy, *stages(points)]
    times = {(stage.name, threads): [] for stage in every for threads in (1, 2)}
    for stage in every:
        seconds(stage.work, 2)  # compiles
    for _ in range(options.rounds):
        for stage in every:
            for threads in (1, 2):
                times[stage.name, threads].append(seconds(stage.work, threads))
    median = {key: float(np.median(each)) for key, each in times.items()}
    # A copy reads the source, and reads and writes the target: processors fetch a line before they change it.
    bandwidth = {threads: 24 * len(source) / median["copy", threads] for threads in (1, 2)}
    print(
        f"{len(points):,} points; copy: {bandwidth[1] / 1e9:.1f} GB/s one thread, {bandwidth[2] / 1e9:.1f} GB/s two\n"
    )
    print("| stage | B/point | operations/point | 1 thread, ms | 2 threads, ms | gain | GB/s | of the copy | Gop/s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for stage in every[1:]:
        one, two = median[stage.name, 1], median[stage.name, 2]
        moved = stage.bytes * len(points) / two
        print(
            f"| {stage.name} | {stage.bytes:.0f} | {stage.operations:.0f} | {1e3 * one:.1f} | {1e3 * two:.1f} | "
            f"{one / two:.2f} | {moved / 1e9:.1f} | {moved / bandwidth[2]:.0%} | "
            f"{stage.operations * len(points) / two / 1e9:.1f} |"
        )


if __name__ == "__main__":
    main()
