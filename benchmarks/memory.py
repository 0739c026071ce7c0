"""Memory that the default detector takes above its input, on a depth camera's frame and on the tee.

Run: python benchmarks/memory.py (part of make bench). Each cloud in a process of its own, so that peaks are its own; after a run on fewer points, which compiles.
Peaks are known on Linux only.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
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


def measure(path: str) -> float:
    """Peak above the input in this process, bytes for each point that is finite."""
    with np.load(path) as stored:
        cloud = edgel.Cloud(stored["xyz"], viewpoint=stored.get("viewpoint"))
    edgel.detect(fewer(cloud))  # compiles
    forget_peak()
    before = peak()
    edgel.detect(cloud)
    return (peak() - before) / np.isfinite(cloud.xyz).all(axis=1).sum()


def fewer(cloud: edgel.Cloud, step: int = 4) -> edgel.Cloud:
    """Every fourth row and column, or as few of a list."""
    if cloud.shape is None:
        return cloud.take(np.arange(0, len(cloud), step**2))
    return edgel.Cloud(cloud.xyz.reshape(*cloud.shape, 3)[::step, ::step], viewpoint=cloud.viewpoint)


def run() -> list[dict[str, Any]]:
    """Measure each cloud in a process of its own, which reads it from a file and gives back to the system what it frees."""
    rows = []
    environment = os.environ | {"MALLOC_MMAP_THRESHOLD_": "65536", "MALLOC_TRIM_THRESHOLD_": "65536"}
    for name, make in CLOUDS.items():
        cloud = make()
        xyz = cloud.xyz.reshape(*cloud.shape, 3) if cloud.shape is not None else cloud.xyz
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "cloud.npz")
            np.savez(path, xyz=xyz, **({} if cloud.viewpoint is None else {"viewpoint": cloud.viewpoint}))
            call = [sys.executable, __file__, "--one", str(path)]
            done = subprocess.run(call, capture_output=True, text=True, check=True, env=environment)
        points = int(np.isfinite(cloud.xyz).all(axis=1).sum())
        rows.append({"cloud": name, "points": points, "bytes": float(done.stdout)})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    print(measure(options.one) if options.one else memory(run()))


if __name__ == "__main__":
    main()
