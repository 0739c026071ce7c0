"""How near each stage comes to the memory's bandwidth, on the tee: bytes that must move, operations, time, threads.

Run: python benchmarks/roofline.py [--points 647984] [--rounds 7]. Prints a table in Markdown. A stage whose two threads
gain less than 1.7 should have a large share of the bandwidth of a copy by as many threads.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from edgel import synth
from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import _SHARED_LEVELS, bounds, build_index
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.normals import by_offset, fit_planes
from edgel._neighbors.queries import every_place, every_point
from edgel._neighbors.spacing import occupied_spacing
from edgel._surface import classify, cloud_statistics, screen
from edgel.paper.method import canny_of_projection, choose_grid, choose_tolerance, local_plane_fits
from edgel.paper.projection import back_project, grey_image, points_near, project

K = 16
CANDIDATES = 94  # points whose distance a query measures, the blocks of eight within its reach
COUNTS = 4.5  # times that they are counted, to find the k nearest


@dataclass(frozen=True)
class Stage:
    """Work on N points: bytes that go between memory and processor at least, and operations, for each point."""

    name: str
    work: Callable[[], object]
    bytes: float
    operations: float = 0.0  # not counted


@kernel
def _copy(start, stop, source, target):
    for i in range(start, stop):
        target[i] = source[i]


@kernel
def _nothing(first, places, squared, queries, targets, xyz):
    pass


def stages(points: np.ndarray) -> list[Stage]:
    """The stages of the paper's method, of normals at all points, and the two long ones of the default detector."""
    lower, upper = bounds(points)
    grid = choose_grid(points, None, None)
    image = np.pad(grey_image(project(points, grid), grid, 100.0), grid.frame)
    found = canny_of_projection(image, 5, 1.4, 16.0, 40.0)
    window = choose_tolerance(None, grid)
    rows = back_project(points, grid, found.edges, found.magnitude, window).rows
    share, index = len(rows) / len(points), build_index(points)
    statistics = cloud_statistics(index)
    screening = screen(index, statistics)
    levels = max(-(-len(points) // 16) - 1, 1).bit_length()
    search = CANDIDATES * (8 + 6 * COUNTS)
    pixels = image.size / len(points)
    return [
        Stage("bounding box", lambda: bounds(points), 24, 6),
        Stage("spacing", lambda: occupied_spacing(points, lower, upper), 40, 8),
        Stage("projection", lambda: project(points, grid), 64, 10),
        Stage("Canny", lambda: canny_of_projection(image, 5, 1.4, 16.0, 40.0), 150 * pixels, 60 * pixels),
        Stage(
            "back-projection",
            lambda: back_project(points, grid, found.edges, found.magnitude, window),
            40,
            6 + 60 * share,
        ),
        Stage("points near edges", lambda: points_near(points, grid, rows, 2.99 * max(grid.pixel)), 26, 8),
        Stage(
            "edge normals",
            lambda: by_offset(local_plane_fits(points, grid, rows, K)),
            26 + share * 300,
            8 + 2 * share * (search + CANDIDATES * 21 + 600),
        ),
        # Levels below the shared ones stay in a core's cache; each reads the keys four times and moves the points.
        Stage("k-d tree", lambda: build_index(points), 56 + 96 * min(levels, _SHARED_LEVELS) + 96, 20 * levels),
        Stage("normals of all", lambda: fit_planes(index, every_point(index), K), 80, search + CANDIDATES * 21 + 600),
        Stage(
            "lists of neighbours",
            lambda: visit_neighbors(_nothing, every_place(index), index, K),
            32 + 32 * K,
            search + CANDIDATES * 3,
        ),
        # Of the default detector; how much is computed depends on the cloud.
        Stage("screening", lambda: screen(index, statistics), 24 + 2 * 48 + 8),
        Stage("classification", lambda: classify(index, screening), 8),
    ]


def seconds(work: Callable[[], object], threads: int) -> float:
    os.environ["EDGEL_NUM_THREADS"] = str(threads)
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def run(num_points: int, rounds: int) -> list[dict[str, Any]]:
    """Measure all stages with one and two threads, and beside each what a copy moves."""
    before = os.environ.get("EDGEL_NUM_THREADS")
    points = synth.scan(synth.tee(), num_points=num_points).cloud.xyz
    source = np.zeros(max(32_000_000, points.size))
    target = np.empty_like(source)
    copy = Stage("copy", lambda: run_slices(_copy, len(source), source, target, size=1 << 20), 0, 0)
    every = [copy, *stages(points)]
    times = {(stage.name, threads): [] for stage in every for threads in (1, 2)}
    for stage in every:
        seconds(stage.work, 2)  # compiles
    for _ in range(rounds):
        for stage in every:
            for threads in (1, 2):
                times[stage.name, threads].append(seconds(stage.work, threads))
    os.environ.pop("EDGEL_NUM_THREADS")
    if before is not None:
        os.environ["EDGEL_NUM_THREADS"] = before
    median = {key: float(np.median(each)) for key, each in times.items()}
    # A copy reads the source, and reads and writes the target: processors fetch a line before they change it.
    bandwidth = {threads: 24 * len(source) / median["copy", threads] for threads in (1, 2)}
    return [
        {
            "stage": stage.name,
            "points": len(points),
            "bytes": stage.bytes,
            "operations": stage.operations,
            "one": median[stage.name, 1],
            "two": median[stage.name, 2],
            "copy one": bandwidth[1],
            "copy two": bandwidth[2],
        }
        for stage in every[1:]
    ]


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        f"{rows[0]['points']:,} points; a copy moves {rows[0]['copy one'] / 1e9:.1f} GB/s with one thread, "
        f"{rows[0]['copy two'] / 1e9:.1f} GB/s with two.",
        "",
        "| stage | bytes a point | operations a point | 1 thread, ms | 2 threads, ms | gain | GB/s | of the copy | Gop/s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        moved, done = (row[what] * row["points"] / row["two"] for what in ("bytes", "operations"))
        lines.append(
            f"| {row['stage']} | {row['bytes']:.0f} | {_or_blank(row['operations'], 0)} | {1e3 * row['one']:.1f} | "
            f"{1e3 * row['two']:.1f} | {row['one'] / row['two']:.2f} | {moved / 1e9:.1f} | "
            f"{moved / row['copy two']:.0%} | {_or_blank(done / 1e9, 1)} |"
        )
    return "\n".join(lines)


def _or_blank(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if value else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=647_984)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    print(table(run(options.points, options.rounds)))


if __name__ == "__main__":
    main()
