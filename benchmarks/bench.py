"""How right and how fast: edgel and its rivals on scenes whose edges are known, in one run.

Run: python benchmarks/bench.py [--quick] [--data ../shared/data] (or make bench, make bench-quick). Writes
benchmarks/results/DATE-COMMIT.json and, unless --quick, docs/benchmarks.md with its plots.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import platform
import subprocess
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import accuracy
import curves
import curves_real
import first_run
import geometry
import growth
import memory
import normals
import outside
import promises
import published
import real_sensors
import report
import roofline
import scenes
import speed
from answers import answer
from rivals import RIVALS, Rival

HERE = Path(__file__).parent
VERSIONS = ("edgel", "numpy", "numba", "scipy", "open3d", "small_gicp", "jakteristics", "pgeof")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few scenes, frames and small clouds, some minutes")
    parser.add_argument(
        "--data", type=Path, default=Path("../shared/data"), help="the shared data, for published scores"
    )
    parser.add_argument("--real", type=Path, default=Path("../shared/real"), help="sets of real sensors with truth")
    parser.add_argument("--no-speed", action="store_true", help="accuracy only")
    options = parser.parse_args()
    start = time.perf_counter()
    for rival in RIVALS:
        if (why := rival.missing()) is not None:
            print(f"skipped: {rival.name}: {why}")
    names = scenes.QUICK if options.quick else scenes.TEST
    tuned = tune(options.quick)
    results: dict[str, Any] = {
        "quick": options.quick,
        "machine": machine(),
        "tuning": tuned,
        "accuracy": list(run_accuracy(names, tuned)),
    }
    results["sensed"] = list(run_accuracy(scenes.SENSED[:: 3 if options.quick else 1], {}))
    results["real_sensors"] = real_sensors.run(options.real, quick=options.quick)
    truth = options.data / "truth"
    results["published"] = published.published(truth) + published.measured(truth) if truth.is_dir() else []
    results["normals"] = normals.run()
    results["geometry"] = geometry.run()
    results["wedges"] = geometry.wedges()
    results["convexity"], results["rims"] = outside.convexity(), outside.rims()
    results["curves"] = curves.run(options.data, quick=options.quick)
    results["curves_real"] = {} if options.quick else curves_real.run(options.data, options.real)
    print("\n".join(curves.summary(results["curves"])))
    if not options.no_speed:
        sizes = (10_000, 100_000) if options.quick else (10_000, 30_000, 100_000, 300_000, 647_984)
        slowest = 2.0 if options.quick else speed.SLOWEST
        results["speed"] = speed.normals_of_all_points(sizes, slowest=slowest) + speed.edges(sizes, slowest)
        results["frames"] = speed.frames(1 if options.quick else speed.ROUNDS)
        results["first_run"] = first_run.run(1, 200) if options.quick else first_run.run()
        results["memory"] = memory.run()
        results["stages"] = speed.stages()
        results["roofline"] = roofline.run(min(sizes[-1], 647_984), 3 if options.quick else 7)
        results["promises"] = [] if options.quick else promises.run()
        results["growth"] = [] if options.quick else growth.run([1, 4, 16, 32], 100.0, rounds=2)
    results["minutes"] = (time.perf_counter() - start) / 60
    path = (
        HERE / "results" / f"{results['machine']['date']}-{results['machine']['commit']}{'-quick' * options.quick}.json"
    )
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(rounded(results), default=float) + "\n")
    print(f"{path}: the results, after {results['minutes']:.1f} minutes")
    if not options.quick:
        print(f"{report.write(results)}: the tables and plots")
    print(report.summary(results))


def rounded(value: Any) -> Any:
    """Round every float to six digits: results are kept in the repository."""
    if isinstance(value, dict):
        return {key: rounded(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(each) for each in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def machine() -> dict[str, Any]:
    """Machine, versions and commit."""

    def git(*arguments: str) -> str:
        return subprocess.run(["git", *arguments], capture_output=True, text=True, cwd=HERE, check=True).stdout.strip()

    cpu = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        cpu = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), cpu)
    versions = {}
    for package in VERSIONS:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = None
    return {
        "date": datetime.date.today().isoformat(),
        "commit": git("rev-parse", "--short", "HEAD")
        + ("-changed" if git("status", "--porcelain", "--", "../src") else ""),
        "cpu": cpu,
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "python": platform.python_version(),
        "versions": versions,
    }


def tune(quick: bool) -> dict[str, dict[str, Any]]:
    """Choose each rival's parameters on scenes apart, for each level of noise: the best it could do if told the noise.

    A quick run takes what the last whole run chose, and writes so.
    """
    path = HERE / "tuned.json"
    if quick:
        return json.loads(path.read_text()) if path.exists() else {}
    by_noise: dict[str, list[str]] = {}
    for name in scenes.TUNE:
        by_noise.setdefault(noise_of(name), []).append(name)
    jobs = [(rival.name, noise, names) for rival in RIVALS if tunable(rival) for noise, names in by_noise.items()]
    tuned: dict[str, dict[str, Any]] = {}
    with ProcessPoolExecutor(2, mp_context=get_context("spawn"), initializer=one_thread) as pool:
        for (name, noise, _), (best, tried) in zip(jobs, pool.map(_tune_one, jobs), strict=True):
            tuned.setdefault(name, {})[noise] = {"best": dict(best), "tried": tried}
            print(f"  tuned: {name}, noise {noise}: {dict(best)}", flush=True)
    path.write_text(json.dumps(tuned, indent=1, default=float) + "\n")
    return tuned


def _tune_one(job: tuple[str, str, list[str]]) -> Any:
    name, _, names = job
    rival = next(r for r in RIVALS if r.name == name)
    fitting = [scene for scene in map(scenes.load, names) if scene.cloud.is_organized or not rival.organized_only]
    return accuracy.best_of_grid(rival, fitting, answer)


def tunable(rival: Rival) -> bool:
    return rival.missing() is None and len(rival.grid) > 0


def noise_of(name: str) -> str:
    return name.split("/")[2]


def one_thread() -> None:
    os.environ["EDGEL_NUM_THREADS"] = "1"
    os.environ["OMP_NUM_THREADS"] = "1"


def run_accuracy(names: list[str] | tuple[str, ...], tuned: dict[str, dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Every rival on every scene: with its defaults, and with the best of its grid for the scene's noise."""
    jobs = [(name, tuned) for name in names]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn"), initializer=one_thread) as pool:
        for done, rows in enumerate(pool.map(_scene_rows, jobs), start=1):
            if done % 10 == 0 or done == len(jobs):
                print(f"  {done} of {len(jobs)} scenes", flush=True)
            yield from rows


def _scene_rows(job: tuple[str, dict[str, dict[str, Any]]]) -> list[dict[str, Any]]:
    name, tuned = job
    try:
        scene = scenes.load(name)
    except ImportError as error:  # build123d is not there
        print(f"skipped: {name}: {error}", flush=True)
        return []
    rows = []
    ceiling = accuracy.ceiling(scene) if len(accuracy.target(scene, accuracy.ALL).strong) else None
    for rival in RIVALS:
        if rival.missing() is not None or (rival.organized_only and not scene.cloud.is_organized):
            continue
        best = tuned.get(rival.name, {}).get(noise_of(name))
        variants = {"defaults": rival.defaults} | ({"tuned": best["best"]} if best else {})
        for variant, parameters in variants.items():
            found = answer(rival, scene, parameters)
            shape, view, noise, outliers = name.split("/")
            rows.append(
                {
                    "scene": name,
                    "shape": shape,
                    "view": view,
                    "noise": float(noise[1:]),
                    "outliers": float(outliers[1:]),
                    "organized": scene.cloud.is_organized,
                    "method": rival.name,
                    "variant": variant,
                    "seconds": found.seconds,
                    "ceiling": ceiling if rival.name == "edgel default" else None,
                }
                | accuracy.score(scene, found.mask, found.kind, rival.finds)
            )
    return rows


if __name__ == "__main__":
    main()
