"""What a change did: two results of bench.py side by side, for review.

Run: python benchmarks/compare.py BEFORE.json AFTER.json [--method "edgel default"]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import published


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--method", default="edgel default", help="whose scenes are listed one by one")
    options = parser.parse_args()
    before, after = (json.loads(path.read_text()) for path in (options.before, options.after))
    for name, results in (("before", before), ("after", after)):
        machine = results["machine"]
        print(f"{name}: {machine['commit']}, {machine['date']}, {machine['cores']} cores of {machine['cpu']}")
    print("\nmean over the scenes both have")
    _means(before["accuracy"], after["accuracy"])
    print(f"\nscenes whose F1 at 2.5 spacings changed most: {options.method}")
    _scenes(before["accuracy"], after["accuracy"], options.method)
    _published(before.get("published", []), after.get("published", []))
    _speed(before.get("speed", []), after.get("speed", []))


def _key(row: dict[str, Any]) -> tuple[str, str, str]:
    return row["method"], row["variant"], row["scene"]


def _figures(row: dict[str, Any]) -> dict[str, float]:
    """The figures that are compared, by name; those the scene does not have are absent."""
    if "all" in row:
        return {"F1@1.0": row["all"]["f1@1.0"], "F1@2.5": row["all"]["f1@2.5"], "zero F1": row["zero"]["f1"]}
    return {"false in 1000": row["false_per_thousand"]}


def _means(before: list[dict[str, Any]], after: list[dict[str, Any]]) -> None:
    old, new = ({_key(row): _figures(row) for row in rows} for rows in (before, after))
    changes: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for key in old.keys() & new.keys():
        for figure in old[key].keys() & new[key].keys():
            changes.setdefault((*key[:2], figure), []).append((old[key][figure], new[key][figure]))
    for (method, variant, figure), pairs in sorted(changes.items()):
        a, b = np.mean(pairs, axis=0)
        print(f"  {method:20} {variant:9} {figure:14} {a:8.4f} -> {b:8.4f}  {b - a:+.4f}  ({len(pairs)} scenes)")


def _scenes(before: list[dict[str, Any]], after: list[dict[str, Any]], method: str) -> None:
    old = {_key(row): _figures(row) for row in before}
    rows = []
    for row in after:
        figures, earlier = _figures(row), old.get(_key(row), {})
        if row["method"] == method and "F1@2.5" in figures and "F1@2.5" in earlier:
            rows.append((figures["F1@2.5"] - earlier["F1@2.5"], row["scene"], earlier["F1@2.5"], figures["F1@2.5"]))
    rows.sort()
    shown = rows if len(rows) <= 20 else rows[:10] + rows[-10:]
    for change, scene, a, b in shown:
        if change:
            print(f"  {scene:40} {a:.4f} -> {b:.4f}  {change:+.4f}")
    print(f"  {sum(1 for row in rows if row[0] == 0)} of {len(rows)} scenes unchanged")


def _published(before: list[dict[str, Any]], after: list[dict[str, Any]]) -> None:
    old, new = (published.means([row for row in rows if not row["published"]]) for rows in (before, after))
    if old.keys() & new.keys():
        print("\npublished models, mean F1")
    for key in sorted(old.keys() & new.keys()):
        print(f"  {key[1]:20} {key[0]:16} {old[key]:.4f} -> {new[key]:.4f}  {new[key] - old[key]:+.4f}")


def _speed(before: list[dict[str, Any]], after: list[dict[str, Any]]) -> None:
    """Times wander from run to run: each is also given as a ratio to Open3D's normals of the same run."""
    old, new = ({(r["work"], r["method"], r["points"]): r["seconds"] for r in rows} for rows in (before, after))
    if old.keys() & new.keys():
        print("\nseconds, and the change as a ratio (in brackets against Open3D's normals of the same run)")
    for key in sorted(old.keys() & new.keys()):
        yard = ("normals of all points", "Open3D", key[2])
        relative = ""
        if yard in old and yard in new:
            relative = f"  [{(new[key] / new[yard]) / (old[key] / old[yard]):.2f}]"
        print(
            f"  {key[0]}, {key[1]}, {key[2]:,}: {old[key]:.4f} -> {new[key]:.4f}  x {new[key] / old[key]:.2f}{relative}"
        )


if __name__ == "__main__":
    main()
