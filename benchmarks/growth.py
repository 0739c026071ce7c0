"""Time and memory for each point as clouds grow: the paper's method, a projection, and the surface.

Run: python benchmarks/growth.py [--sizes 1 2 4 8 16 32] [--projection-to 100] (millions of points). Each size runs in a
process of its own, so that peaks of memory are its own. Prints a table in Markdown, writes docs/benchmarks/growth.png; make bench
measures the same, with fewer rounds.
Peaks are known on Linux only.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import edgel
from edgel import paper

DOCS = Path(__file__).parent.parent / "docs" / "benchmarks"
METHODS: dict[str, Callable[[np.ndarray], object]] = {
    "paper": paper.detect,
    "projection": partial(edgel.detect, method="orthographic"),
    "surface": partial(edgel.detect, method="surface"),
}


def plateau(count: int) -> np.ndarray:
    """Points jittered about a grid over waves and a square plateau, in rows as a scanner gives them; spacing 1.

    All but the waves grows with the cloud, so that the paper's windows, a share of the image, hold the same share of it.
    """
    side = int(np.sqrt(count))
    rng = np.random.default_rng(0)
    points = np.empty((side * side, 3))
    points[:, 0] = np.tile(np.arange(side), side)
    points[:, 1] = np.repeat(np.arange(side), side)
    points[:, :2] += rng.uniform(-0.3, 0.3, (side * side, 2))
    inside = (np.abs(points[:, :2] - side / 2) < side / 4).all(axis=1)
    points[:, 2] = 0.2 * side * inside + 5 * np.sin(points[:, 0] / 40)
    return points


def peak() -> int:
    """Most memory this process has held, bytes."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 0
    line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


def forget_peak() -> None:
    """Let the peak begin anew at what is held now."""
    path = Path("/proc/self/clear_refs")
    if path.exists():
        path.write_text("5")


def measure(method: str, count: int, rounds: int) -> dict[str, Any]:
    """Median seconds and the peak above the input, in this process."""
    METHODS[method](plateau(20_000))  # compiles
    points = plateau(count)
    forget_peak()
    before, seconds = peak(), []
    for _ in range(rounds):
        start = time.perf_counter()
        METHODS[method](points)
        seconds.append(time.perf_counter() - start)
    return {
        "method": method,
        "points": len(points),
        "seconds": float(np.median(seconds)),
        "bytes": (peak() - before) / len(points),
    }


def run(sizes: Sequence[float], projection_to: float, rounds: int) -> list[dict[str, Any]]:
    """Measure each method at each size (millions of points), in a process of its own."""
    rows = []
    for method in METHODS:
        further = [projection_to] if method == "paper" and projection_to > max(sizes) else []
        for size in [*sizes, *further]:
            call = [sys.executable, __file__, "--rounds", str(rounds), "--one", method, str(round(size * 1e6))]
            done = subprocess.run(call, capture_output=True, text=True)
            if done.returncode:
                why = (done.stderr.strip() or "killed").splitlines()[-1]
                print(f"  {method}, {size:g} million points: failed: {why}", flush=True)
                break
            rows.append(json.loads(done.stdout))
            row = rows[-1]
            print(
                f"  {method}, {row['points']:,} points: {row['seconds']:.2f} s, {row['bytes']:.0f} bytes each",
                flush=True,
            )
    return rows


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        "| method | points | seconds | ns a point | times the first | peak above the input, bytes a point |",
        "|---|---|---|---|---|---|",
    ]
    first = {row["method"]: row["seconds"] / row["points"] for row in reversed(rows)}
    for row in rows:
        each = row["seconds"] / row["points"]
        lines.append(
            f"| {row['method']} | {row['points']:,} | {row['seconds']:.3f} | {1e9 * each:.0f} | "
            f"{each / first[row['method']]:.2f} | {row['bytes']:.0f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=float, nargs="+", default=[1, 2, 4, 8, 16, 32])
    parser.add_argument("--projection-to", type=float, default=100.0, help="one size more for the paper")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(options.one[0], int(options.one[1]), options.rounds)))
        return
    rows = run(options.sizes, options.projection_to, options.rounds)
    print(table(rows))
    FigureCanvasAgg(plot(rows)).print_png(str(DOCS / "growth.png"))
    print(f"{DOCS / 'growth.png'}: the plot")


def plot(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw nanoseconds a point over the number of points."""
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.add_subplot()
    for method in METHODS:
        mine = [row for row in rows if row["method"] == method]
        axes.plot(
            [row["points"] for row in mine], [1e9 * row["seconds"] / row["points"] for row in mine], "o-", label=method
        )
    axes.set(xscale="log", yscale="log", xlabel="points", ylabel="ns for each point", title="two threads")
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


if __name__ == "__main__":
    main()
