"""Times of edgel and its rivals, interleaved in one run, medians of at least five rounds.

Run: python benchmarks/speed.py for the frames alone (part of make bench, which measures all).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import fittings
import numpy as np
import real_frames
from report_tables import frame_times
from rivals import NORMALS, RIVALS

import edgel
from edgel import paper, synth
from edgel._neighbors.kdtree import build_index

ROUNDS = 5
SLOWEST = 20.0  # seconds: what would take longer at the next size, growing with the points, is not tried there


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


def normals_of_all_points(sizes: Sequence[int], k: int = 16, slowest: float = SLOWEST) -> list[dict[str, Any]]:
    """All-point normals, the building of whatever index included."""

    def work(points: np.ndarray) -> dict[str, Callable[[], float]]:
        return {rival.name: lambda rival=rival: rival.run(points, k)[1] for rival in NORMALS if rival.missing() is None}

    return _over_sizes("normals of all points", sizes, work, slowest)


def edges(sizes: Sequence[int], slowest: float = SLOWEST) -> list[dict[str, Any]]:
    """Edge detection of the tee, each method with its defaults; methods for organized clouds can't take it."""

    def work(points: np.ndarray) -> dict[str, Callable[[], float]]:
        cloud = edgel.Cloud(points)
        spacing = float(np.sqrt(np.prod(np.ptp(points[:, :2], axis=0)) / len(points)))
        pieces: dict[str, Callable[[], float]] = {"k-d tree of edgel": timed(lambda: build_index(points))}
        for rival in RIVALS:
            if rival.missing() is None and not rival.organized_only:
                pieces[rival.name] = lambda rival=rival: rival.run(cloud, spacing, rival.defaults).seconds
        return pieces

    return _over_sizes("edges", sizes, work, slowest)


def frame_clouds() -> dict[str, tuple[edgel.Cloud, float]]:
    """Organized clouds in millimetres and their spacing: a real frame, a simulated one as large, the tee from above.

    And the tee as the other tables have it, a list of points.
    """
    real = real_frames.load(real_frames.FOLDER / "primesense.npz").cloud
    real = edgel.Cloud(1000 * real.xyz, shape=real.shape, viewpoint=np.zeros(3))
    assert real.shape is not None
    across = np.linalg.norm(np.diff(real.xyz.reshape(*real.shape, 3), axis=1), axis=2)
    tee = fittings.scan(synth.tee())
    part, above = synth.stepped_block(), synth.tee()
    seen = synth.sense(part, synth.SENSORS["kinect"], spacing=0.24)
    parallel = synth.view(above, spacing=1.22 * tee.spacing, direction=(0, 0, -1), roll=0.0)
    return {
        f"PrimeSense, {real.shape[1]} x {real.shape[0]}": (real, float(np.nanmedian(across))),
        f"simulated Kinect, {size_of(seen.cloud)}": (seen.cloud, seen.spacing),
        f"tee, parallel view, {size_of(parallel.cloud)}": (parallel.cloud, parallel.spacing),
        "tee, list of points": (tee.cloud, tee.spacing),
    }


def size_of(cloud: edgel.Cloud) -> str:
    assert cloud.shape is not None
    return f"{cloud.shape[1]} x {cloud.shape[0]}"


def frames(rounds: int = ROUNDS) -> list[dict[str, Any]]:
    """The default on organized clouds against PCL's organized edges, and on all against Open3D's normals of all points.

    PCL's has its documented thresholds and either of its common normals; of gradients they are the fastest. A parallel view it takes as one
    from afar; a list of points it cannot take.
    """
    pcl = next(rival for rival in RIVALS if rival.name == "PCL organized")
    ours = next(rival for rival in RIVALS if rival.name == "edgel default")
    open3d = next(rival for rival in NORMALS if rival.name == "Open3D")
    rows = []
    for name, (cloud, spacing) in frame_clouds().items():
        finite = cloud.xyz[np.isfinite(cloud.xyz).all(axis=1)]
        work: dict[str, Callable[[], float]] = {
            ours.name: lambda cloud=cloud, spacing=spacing: ours.run(cloud, spacing, ours.defaults).seconds
        }
        if cloud.is_organized and pcl.missing() is None:
            for method in ("gradient", "covariance"):
                options = {**pcl.defaults, "method": method}
                work[f"{pcl.name}, {method}"] = lambda cloud=cloud, spacing=spacing, options=options: (
                    pcl.run(cloud, spacing, options).seconds
                )
        if open3d.missing() is None:
            work["Open3D, normals"] = lambda finite=finite: open3d.run(finite, 16)[1]
        for method, each in interleaved(work, rounds).items():
            rows.append(
                {
                    "frame": name,
                    "method": method,
                    "points": len(finite),
                    "seconds": float(np.median(each)),
                    "rounds": each,
                }
            )
    return rows


def stages(rounds: int = ROUNDS) -> list[dict[str, Any]]:
    """Stages of the published method and of the default one on the tee as the paper has it."""
    points = fittings.scan(synth.tee()).cloud.xyz
    rows = []
    for method, detect in (("paper", paper.detect), ("default", edgel.detect)):
        detect(points)
        runs = [detect(points).seconds for _ in range(rounds)]
        rows += [
            {"method": method, "stage": stage, "seconds": float(np.median([run[stage] for run in runs]))}
            for stage in runs[0]
        ]
    return rows


def _over_sizes(
    title: str,
    sizes: Sequence[int],
    work: Callable[[np.ndarray], dict[str, Callable[[], float]]],
    slowest: float,
) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    expected: dict[str, float] = {}
    before = 0
    for size, points in clouds(sizes).items():
        growth = size / before if before else 0.0
        pieces = {name: piece for name, piece in work(points).items() if expected.get(name, 0.0) * growth <= slowest}
        for name, each in interleaved(pieces).items():
            expected[name] = float(np.median(each))
            rows.append({"work": title, "method": name, "points": size, "seconds": expected[name], "rounds": each})
            print(f"  {title}, {size:,} points, {name}: {expected[name]:.3f} s", flush=True)
        expected = {name: seconds if name in pieces else float("inf") for name, seconds in expected.items()}
        before = size
    return rows


if __name__ == "__main__":
    print(frame_times(frames()))
