"""Registration: how often the right pose is found, how near, how surely, and at what cost, beside rivals.

Run: make bench-register, or python benchmarks/register.py [--pairs 100] [--noise 0.3 0.5] [--rows "view to view" ...]
[--no-rivals] [--held 1] [--output register.jsonl]. A pair is right by less than 5 degrees and 5 spacings (`register_pairs`). Times are
CPU seconds of the whole process, detection included, rivals' ICP included. Rivals have two voxel sizes; that which is right
more often in a row counts there. What is done already, by an output that is there, is not done again.
"""

from __future__ import annotations

import argparse
import json
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
WANTED = {"view to view": 0.95, "part to view": 0.95, "planar": 0.92, "clutter": 0.90, "crops": 0.85}


def methods(rivals: bool) -> dict[str, Callable[[pairs.Pair], Any]]:
    """Everything that finds a pose from anywhere, by name."""
    found: dict[str, Callable[[pairs.Pair], Any]] = {"edgel": lambda pair: edgel.register(pair.source, pair.target)}
    if rivals:
        import register_rivals as others

        for name, run in others.GLOBAL.items():
            for voxel in others.VOXELS:
                found[f"{name} {voxel:g}"] = lambda pair, run=run, voxel=voxel: run(
                    pair.source, pair.target, pair.spacing, voxel
                )
    return found


def refinements(rivals: bool) -> dict[str, Callable[[pairs.Pair, np.ndarray], Any]]:
    """Everything that refines a pose, by name."""
    found: dict[str, Callable[[pairs.Pair, np.ndarray], Any]] = {
        "edgel": lambda pair, start: edgel.register(pair.source, pair.target, initial=start)
    }
    if rivals:
        import register_rivals as others

        found["Open3D point to plane"] = lambda pair, start: others.icp(pair.source, pair.target, pair.spacing, start)
        found["small_gicp"] = lambda pair, start: others.small_gicp(pair.source, pair.target, pair.spacing, start)
    return found


def measure(pair: pairs.Pair, run: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
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


def run(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Measure every pair by every method."""
    path = Path(options.output)
    done = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    known = {(r["row"], r["noise"], r["number"], r["held"], r["method"], r["kind"]) for r in done}
    everything, refiners = methods(options.rivals), refinements(options.rivals)
    warm_up(everything, refiners)
    with path.open("a") as file:
        for number in range(options.pairs):
            for noise in options.noise:
                for row in options.rows:
                    todo = [("match", n, f, ()) for n, f in everything.items()]
                    if row == "view to view":
                        todo += [("refine", n, f, (number,)) for n, f in refiners.items()]
                    key = (row, noise, number, options.held)
                    todo = [one for one in todo if (*key, one[1], one[0]) not in known]
                    pair = pairs.make(row, noise, number, held=options.held) if todo else None
                    for kind, name, method, more in todo:
                        assert pair is not None
                        arguments = [start_of(pair, n) for n in more]
                        said = dict(zip(("row", "noise", "number", "held"), key, strict=True))
                        said |= {"part": pair.part, "method": name, "kind": kind} | measure(pair, method, *arguments)
                        done.append(said)
                        file.write(json.dumps(said) + "\n")
                        file.flush()
    return done


def warm_up(everything: dict[str, Any], refiners: dict[str, Any]) -> None:
    """Compile and load before anything is timed."""
    pair = pairs.make("view to view", 0.0, 3)
    for method in everything.values():
        method(pair)
    for method in refiners.values():
        method(pair, pair.pose)


def is_right(one: dict[str, Any]) -> bool:
    return one["degrees"] < WITHIN[0] and one["shift"] < WITHIN[1]


def tables(done: list[dict[str, Any]]) -> str:
    """Write what was measured as Markdown."""
    lines = []
    rows = dict.fromkeys((r["row"], r["noise"]) for r in done)
    rows |= {("planar", noise): None for _, noise in list(rows)} | {("round", noise): None for _, noise in list(rows)}
    names = list(dict.fromkeys(r["method"].rpartition(" ")[0] or r["method"] for r in done if r["kind"] == "match"))
    lines += [
        "| pairs, noise | pairs | " + " | ".join(names) + " | wanted | 90 % shift, spacings | CPU s |",
        "|---" * (len(names) + 5) + "|",
    ]
    for row, noise in rows:
        of_row = [r for r in done if r["kind"] == "match" and r["noise"] == noise and belongs(r, row)]
        shares, own, others = [], [], {}
        for name in names:
            sizes: dict[str, list[dict[str, Any]]] = {}
            for r in of_row:
                if (r["method"].rpartition(" ")[0] or r["method"]) == name:
                    sizes.setdefault(r["method"], []).append(r)
            best = max(sizes.values(), key=lambda rs: np.mean([is_right(r) for r in rs]), default=[])
            shares.append(f"{100 * np.mean([is_right(r) for r in best]):.0f} %" if best else "-")
            own, others = (best, others) if name == "edgel" else (own, others | {name: best})
        shift = quantile([r["shift"] for r in own if is_right(r)], 0.9)
        cost = " / ".join(f"{np.mean([r['seconds'] for r in rs]):.2f}" for rs in [own, *others.values()] if rs)
        wanted = f"{100 * WANTED[row]:.0f} %" if row in WANTED else "best rival"
        lines.append(f"| {row}, {noise:g} | {len(own)} | {' | '.join(shares)} | {wanted} | {shift:.2f} | {cost} |")
    own = [r for r in done if r["method"] == "edgel" and r["kind"] == "match"]
    sure = [r for r in own if r["margin"] > SURE]
    if own:
        right = np.mean([is_right(r) for r in sure]) if sure else np.nan
        lines += [
            "",
            f"Margin above {SURE:g}: {len(sure) / len(own):.0%} of {len(own)} answers, {right:.1%} of them right.",
        ]
    lines += [
        "",
        "| refinement from 4 degrees and 4 spacings | runs | median shift, spacings | within 1 |",
        "|---" * 4 + "|",
    ]
    for name in dict.fromkeys(r["method"] for r in done if r["kind"] == "refine"):
        shifts = [r["shift"] for r in done if r["kind"] == "refine" and r["method"] == name]
        lines.append(f"| {name} | {len(shifts)} | {quantile(shifts, 0.5):.3f} | {np.mean(np.array(shifts) < 1):.0%} |")
    return "\n".join(lines)


def belongs(one: dict[str, Any], row: str) -> bool:
    """Whether a pair counts in a row; planar and round are the views and parts of such parts."""
    kinds = {"planar": pairs.PLANAR, "round": pairs.ROUND}
    if row in kinds:
        return one["part"] in kinds[row] and one["row"] in ("view to view", "part to view", row)
    return one["row"] == row


def quantile(values: list[float], share: float) -> float:
    return float(np.quantile(values, share)) if values else float("nan")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.3, 0.5])
    parser.add_argument("--rows", nargs="+", default=["view to view", "part to view", "clutter", "crops"])
    parser.add_argument("--no-rivals", dest="rivals", action="store_false")
    parser.add_argument("--held", type=int, default=0)
    parser.add_argument("--output", default=str(Path(__file__).parent / "cache" / "register.jsonl"))
    print(tables(run(parser.parse_args())))
