"""Memory that the default detector takes above its input, on a depth camera's frame and on the tee.

Run: python benchmarks/memory.py (part of make bench). Each cloud in a process of its own, so that peaks are its own; after a run on fewer points, which compiles.
Peaks are known on Linux only.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import fittings
import numpy as np
import real_frames
from growth import forget_peak, peak
from report_tables import memory

import edgel
from edgel import synth

CLOUDS: dict[str, Callable[[], edgel.Cloud]] = {
    "PrimeSense, 640 x 480": lambda: real_frames.load(real_frames.FOLDER / "primesense.npz").cloud,
    "tee, list of points": lambda: fittings.scan(synth.tee()).cloud,
}


def measure(name: str) -> dict[str, Any]:
    """Peak above the input in this process, bytes for each point that is finite."""
    cloud = CLOUDS[name]()
    points = int(np.isfinite(cloud.xyz).all(axis=1).sum())
    edgel.detect(fewer(cloud))  # compiles
    forget_peak()
    before = peak()
    edgel.detect(cloud)
    return {"cloud": name, "points": points, "bytes": (peak() - before) / points}


def fewer(cloud: edgel.Cloud, step: int = 4) -> edgel.Cloud:
    """Every fourth row and column, or as few of a list."""
    if cloud.shape is None:
        return cloud.take(np.arange(0, len(cloud), step**2))
    return edgel.Cloud(cloud.xyz.reshape(*cloud.shape, 3)[::step, ::step], viewpoint=cloud.viewpoint)


def run() -> list[dict[str, Any]]:
    """Measure each cloud in a process of its own."""
    rows = []
    for name in CLOUDS:
        done = subprocess.run([sys.executable, __file__, "--one", name], capture_output=True, text=True, check=True)
        rows.append(json.loads(done.stdout))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    print(json.dumps(measure(options.one)) if options.one else memory(run()))


if __name__ == "__main__":
    main()
