"""Registration: how often the right pose is found, how near, how surely, and at what cost, beside rivals.

Run: make bench-register, or python benchmarks/register.py [--pairs 100] [--first 0] [--noise 0.3 0.5]
[--rows "view to view" ...] [--no-rivals] [--held 1] [--output folder]. A pair is right by less than 5 degrees and 5 spacings
(`register_pairs`). Times are CPU seconds of the whole process, detection included, rivals' ICP included. Rivals have two
voxel sizes; that which is right more often in a row counts there. Each pair has a file in the output folder; what is there is
not done again, so rows can be run in pieces, also by several processes, and the tables are of all that is there.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import register_pairs as pairs

import edgel
from edgel.matching import SURE

WITHIN = (5.0, 5.0)
"""Degrees and spacings by which a pose may be off."""
START = (4.0, 4.0)
"""Degrees and spacings by which refinements begin off."""
REFINED = 1.0
"""Spacings within which a refinement ends that is right."""
WANTED = {"view to view": 0.95, "part to view": 0.95, "planar": 0.92, "clutter": 0.90, "crops": 0.85}

Run = Callable[..., Any]


def methods(row: str, rivals: bool) -> dict[str, Run]:
    """Everything that finds a pose from anywhere, or refines one in the row of refinements, by name."""
    # Refinements have a pose to start from as well.
    found: dict[str, Run] = {
        "edgel": lambda pair, *start: edgel.register(pair.source, pair.target, initial=start[0] if start else None)
    }
    if not rivals:
        return found
    import register_rivals as others

    if row == "refinement":
        found["Open3D point to plane"] = lambda pair, start: others.icp(pair.source, pair.target, pair.spacing, start)
        found["small_gicp"] = lambda pair, start: others.small_gicp(pair.source, pair.target, pair.spacing, start)
        return found
    for name, run in others.GLOBAL.items():
        for voxel in others.VOXELS:
            found[f"{name} {voxel:g}"] = lambda pair, run=run, voxel=voxel: run(
                pair.source, pair.target, pair.spacing, voxel
            )
    return found


def measure(pair: pairs.Pair, run: Run, *arguments: Any) -> dict[str, Any]:
    """Time a method and say how far off it is."""
    start = time.process_time()
    answer = run(pair, *arguments)
    seconds = time.process_time() - start
    if not isinstance(answer, edgel.Registration):
        degrees, shift = pairs.errors(pair, answer)
        return {"degrees": degrees, "shift": shift, "seconds": seconds}
    degrees, shift = pairs.errors(pair, answer.T_target_source) if answer.found else (180.0, 1e3)
    row = {"degrees": degrees, "shift": shift, "seconds": seconds, "found": answer.found, "margin": answer.margin}
    return row | {"std": answer.position_std / pair.spacing if answer.found else None}


def start_of(pair: pairs.Pair, number: int) -> np.ndarray:
    """Return the true pose, turned and shifted about the part's middle."""
    rng = np.random.default_rng([number, 7])
    moved = pairs.turn_about(pairs.direction(rng), np.radians(START[0])) @ pair.pose
    middle = np.append(pair.middle, 1)
    moved[:3, 3] += (pair.pose @ middle - moved @ middle)[:3] + START[1] * pair.spacing * pairs.direction(rng)
    return moved


def run(options: argparse.Namespace) -> None:
    """Measure every pair by every method, but what is measured already."""
    warm = set()
    options.output.mkdir(parents=True, exist_ok=True)
    for number in range(options.first, options.pairs):
        for noise in options.noise:
            for row in options.rows:
                name = f"{row.replace(' ', '-')}_{round(100 * noise)}_{number}_{options.held}.json"
                path = options.output / name
                known = json.loads(path.read_text()) if path.exists() else []
                done = {one["method"] for one in known}
                todo = {n: f for n, f in methods(row, options.rivals).items() if n not in done}
                for method, one in todo.items():
                    if (row == "refinement", method) not in warm:  # compile and load before anything is timed
                        example = pairs.make("view to view", 0.0, 3)
                        one(example, *([example.pose] if row == "refinement" else []))
                        warm.add((row == "refinement", method))
                if not todo:
                    continue
                pair = pairs.make(row, noise, number, held=options.held)
                start = [start_of(pair, number)] if row == "refinement" else []
                said = {"row": row, "noise": noise, "number": number, "held": options.held, "part": pair.part}
                known += [said | {"method": n} | measure(pair, one, *start) for n, one in todo.items()]
                whole = path.with_suffix(f".{os.getpid()}.part")
                whole.write_text(json.dumps(known))
                whole.replace(path)


def read(folder: Path) -> list[dict[str, Any]]:
    """Return all that is measured."""
    return [one for path in sorted(folder.glob("*.json")) for one in json.loads(path.read_text())]


def is_right(one: dict[str, Any]) -> bool:
    return one["degrees"] < WITHIN[0] and one["shift"] < WITHIN[1]


def tables(done: list[dict[str, Any]]) -> str:
    """Write what was measured as Markdown."""
    matches = [r for r in done if r["row"] != "refinement"]
    names = list(dict.fromkeys(rival_of(r) for r in matches))
    lines = [
        "| pairs, noise | pairs | "
        + " | ".join(names)
        + " | wanted | 90 % shift, spacings | believed, of them wrong | "
        f"margin above {SURE:g}, of them wrong | CPU s |",
        "|---" * (len(names) + 7) + "|",
    ]
    lines += [line_of(matches, row, noise, names) for noise in noises_of(matches) for row in pairs.ROWS[:-1]]
    own = [r for r in matches if r["method"] == "edgel"]
    sure = [r for r in own if r["margin"] > SURE]
    if sure:
        right = np.mean([is_right(r) for r in sure])
        lines += [
            "",
            f"Margin above {SURE:g}: {len(sure) / len(own):.0%} of {len(own)} pairs, {right:.1%} of them right.",
        ]
    lines += [
        "",
        f"| refinement from {START[0]:g} degrees and {START[1]:g} h | pairs | median shift, h | within {REFINED:g} h | CPU s |",
        "|---" * 5 + "|",
    ]
    refined = [r for r in done if r["row"] == "refinement"]
    for noise in noises_of(refined):
        for name in dict.fromkeys(r["method"] for r in refined):
            of = [r for r in refined if r["method"] == name and r["noise"] == noise]
            shifts = [r["shift"] for r in of]
            within, cost = np.mean(np.array(shifts) < REFINED), np.mean([r["seconds"] for r in of])
            lines.append(f"| {name}, {noise:g} | {len(of)} | {quantile(shifts, 0.5):.3f} | {within:.0%} | {cost:.2f} |")
    return "\n".join(lines)


def line_of(matches: list[dict[str, Any]], row: str, noise: float, names: list[str]) -> str:
    """Write a row of the table: every rival on the pairs that it was asked for."""
    of_row = [r for r in matches if r["noise"] == noise and belongs(r, row)]
    shares, costs = [], []
    for name in names:
        sizes: dict[str, list[dict[str, Any]]] = {}
        for r in of_row:
            if rival_of(r) == name:
                sizes.setdefault(r["method"], []).append(r)
        best = max(sizes.values(), key=lambda rs: np.mean([is_right(r) for r in rs]), default=[])
        right = sum(is_right(r) for r in best)
        shares.append(f"{right / len(best):.0%} ({right} of {len(best)})" if best else "-")
        costs.append(f"{np.mean([r['seconds'] for r in best]):.2f}" if best else "-")
    own = [r for r in of_row if r["method"] == "edgel"]
    shift = quantile([r["shift"] for r in own if is_right(r)], 0.9)
    believed, sure = [r for r in own if r["found"]], [r for r in own if r["margin"] > SURE]
    counts = [f"{len(rs)}, {sum(not is_right(r) for r in rs)}" for rs in (believed, sure)]
    wanted = f"{WANTED[row]:.0%}" if row in WANTED else "best rival"
    cells = [f"{row}, {noise:g}", str(len(own)), *shares, wanted, f"{shift:.2f}", *counts, " / ".join(costs)]
    return "| " + " | ".join(cells) + " |"


def noises_of(done: list[dict[str, Any]]) -> list[float]:
    return sorted({r["noise"] for r in done})


def rival_of(one: dict[str, Any]) -> str:
    """Return a method's name without its voxel size."""
    name, _, last = one["method"].rpartition(" ")
    return name if name and last.replace(".", "").isdigit() else one["method"]


def belongs(one: dict[str, Any], row: str) -> bool:
    """Whether a pair counts in a row; planar and round are the views and parts of such parts, too."""
    kinds = {"planar": pairs.PLANAR, "round": pairs.ROUND}
    if row in kinds:
        return one["part"] in kinds[row] and one["row"] in ("view to view", "part to view", row)
    return one["row"] == row


def quantile(values: list[float], share: float) -> float:
    return float(np.quantile(values, share)) if values else float("nan")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.3, 0.5])
    parser.add_argument("--rows", nargs="+", choices=pairs.ROWS, default=pairs.ROWS)
    parser.add_argument("--no-rivals", dest="rivals", action="store_false")
    parser.add_argument("--held", type=int, default=0)
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "cache" / "register")
    chosen = parser.parse_args()
    run(chosen)
    print(tables(read(chosen.output)))
