"""Tiles against the whole cloud: a city made file by file, its answer in tiles and at once, time and memory of both.

Run: python benchmarks/tiles.py make FOLDER --millions 10 [--uneven] [--noise N]; then tiled FOLDER OUT [--tile-points N] [--workers N], and
whole FOLDER OUT, each in a process of its own; then compare OUT OUT2. Times are processor time, memory is the peak of the process.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from pathlib import Path
from typing import Any

import numpy as np

import edgel
from edgel import tiled
from edgel.tiled.output import edges_of
from edgel.tiled.plan import Plan

SIDE = 1000  # of a file in plan, metres: a point a square metre
FIELDS = ("kind", "strength", "position", "position_std", "scale", "direction", "normals", "angle", "convex")


def block(column: int, row: int, *, uneven: bool, noise: float = 0.03) -> np.ndarray:
    """Points (N, 3) of a square kilometre: hilly ground, gabled houses and trees, jittered about a grid; spacing 1.

    Uneven, stretches of ground have a tenth of the points and others three times as many, and some points hang in the air.
    """
    rng = np.random.default_rng([column, row])
    side = SIDE * 2 if uneven else SIDE
    plan = np.stack(np.meshgrid(*2 * [(np.arange(side) + 0.5) * SIDE / side]), axis=-1).reshape(-1, 2)
    plan += rng.uniform(-0.4, 0.4, plan.shape) * SIDE / side + np.array([column, row]) * SIDE
    if uneven:
        dense = 0.5 + 0.5 * np.sin(plan[:, 0] / 90) * np.sin(plan[:, 1] / 130)
        plan = plan[rng.random(len(plan)) < np.where(dense < 0.15, 0.025, np.where(dense > 0.85, 0.75, 0.25))]
    x, y = plan.T
    along, across = np.abs(x % 40 - 20), np.abs(y % 30 - 15)
    house = (along < 11) & (across < 7) & ((x // 40 + 3 * (y // 30)) % 5 > 0)
    z = 6 * np.sin(x / 170) * np.cos(y / 140) + np.where(house, 6 + 0.7 * (7 - across), 0.0)
    tree = ((x // 40 + 3 * (y // 30)) % 5 == 0) & (along < 6) & (across < 6) & (rng.random(len(x)) < 0.5)
    z += np.where(tree, rng.uniform(1, 9, len(x)), 0.0) + noise * rng.standard_normal(len(x))
    if uneven:
        z += np.where(rng.random(len(x)) < 1e-4, 30.0, 0.0)
    return np.column_stack([x, y, z]) + [512_000.0, 5_401_000.0, 80.0]


def make(folder: Path, millions: int, *, uneven: bool, noise: float) -> None:
    """Write so many files of about a million points, never more than one of them in memory."""
    folder.mkdir(parents=True, exist_ok=True)
    columns = int(np.ceil(np.sqrt(millions)))
    for number in range(millions):
        np.save(folder / f"{number:05d}.npy", block(number % columns, number // columns, uneven=uneven, noise=noise))


def run_tiled(files: list[str], out: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Answer in tiles; the steps by processor time."""
    steps: dict[str, list[float]] = {}

    def say(line: str) -> None:
        steps.setdefault(line.split(":")[0], []).append(time.process_time())
        if options.verbose:
            print(line, flush=True)

    begin = time.process_time()
    found = tiled.detect(files, out, tile_points=options.tile_points, workers=options.workers, progress=say)
    ends = {name: times[-1] for name, times in steps.items()}
    seconds = dict(zip(ends, np.diff([begin, *ends.values()]).round(2).tolist(), strict=True))
    return {
        "points": found.num_points,
        "edges": found.num_edges,
        "read": found.points_read / found.num_points,
        "seconds": seconds,
    }


def run_whole(files: list[str], out: Path) -> dict[str, Any]:
    """Answer at once, kept in `out`."""
    begin = time.process_time()
    xyz = np.concatenate([np.load(file) for file in files])
    found = edgel.detect(xyz, method="surface")
    seconds = {**found.seconds, "all": time.process_time() - begin}
    out.mkdir(parents=True, exist_ok=True)
    np.savez(out / "whole.npz", index=found.index, **{name: getattr(found, name) for name in FIELDS})
    return {"points": len(xyz), "edges": len(found), "seconds": seconds}


def compare(files: list[str], out: Path, whole: Path) -> dict[str, Any]:
    """Compare the answer in tiles with the whole's, bit for bit."""
    plan = Plan.read(out / "work")
    parts = [edges_of(plan, part) for part in plan.spool.parts]
    first = np.cumsum([0, *(len(np.load(file, mmap_mode="r")) for file in files)])
    index = np.concatenate([part.index + begin for part, begin in zip(parts, first, strict=False)])
    with np.load(whole / "whole.npz") as kept:
        same = {"index": bool(np.array_equal(index, kept["index"]))}
        for name in FIELDS:
            mine = np.concatenate([getattr(part, name) for part in parts])
            same[name] = mine.tobytes() == kept[name].tobytes()
    return {"edges": len(index), "unlike": [name for name, equal in same.items() if not equal]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["make", "tiled", "whole", "compare"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path, nargs="?", default=Path("out"))
    parser.add_argument("other", type=Path, nargs="?", help="of compare: where the whole's answer is")
    parser.add_argument("--millions", type=int, default=10)
    parser.add_argument("--uneven", action="store_true")
    parser.add_argument("--noise", type=float, default=0.03, help="in height, metres; points lie a metre apart")
    parser.add_argument("--tile-points", type=int, default=2_500_000)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    if options.what == "make":
        make(options.folder, options.millions, uneven=options.uneven, noise=options.noise)
        return
    files = sorted(str(path) for path in options.folder.glob("*.npy"))
    if options.what == "tiled":
        result = run_tiled(files, options.out, options)
    elif options.what == "whole":
        result = run_whole(files, options.out)
    else:
        result = compare(files, options.out, options.other)
    used = resource.getrusage(resource.RUSAGE_SELF)
    result["cpu"] = used.ru_utime + used.ru_stime
    result["peak_gb"] = used.ru_maxrss / 1e6
    print(json.dumps(result))


if __name__ == "__main__":
    main()
