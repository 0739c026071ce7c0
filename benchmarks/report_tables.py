"""Tables of a benchmark's results, in Markdown."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import published
from accuracy import ANGLE_BINS, TOLERANCES
from report_rows import NOISES, Row, angle_f1, mean, method_name, methods, pick
from rivals import RIVALS
from scenes import NEGATIVES


def geometry(rows: Sequence[Row]) -> str:
    figures = ("position", "direction", "normals", "angle", "known")
    middle = ["**median**", *(cell(float(np.median([row[figure] for row in rows]))) for figure in figures)]
    return table(
        ["scene", *figures], [middle, *([row["scene"], *(cell(row[figure]) for figure in figures)] for row in rows)]
    )


def wedges(rows: Sequence[Row]) -> str:
    turns = sorted({row["turn"] for row in rows})
    at = {(row["seen"], row["turn"]): row for row in rows}
    lines = [
        [f"{seen}, {tolerance}", *(cell(at[seen, turn][f"recall@{tolerance}"]) for turn in turns)]
        for seen in dict.fromkeys(row["seen"] for row in rows)
        for tolerance in ("1", "2.5")
    ]
    return table(["view or pattern, spacings", *turns], lines)


def ceilings(rows: Sequence[Row]) -> str:
    lines = []
    for pattern in sorted({row["view"] for row in rows if not row["organized"]}):
        line = [pattern]
        for noise in NOISES:
            picked = pick(
                rows,
                "edgel default",
                "defaults",
                lambda r, n=noise, p=pattern: (
                    r["view"] == p and r["noise"] == n and r["outliers"] == 0 and r.get("ceiling")
                ),
            )
            line += [
                cell(mean(r["all"]["f1@1.0"] for r in picked)),
                cell(mean(r["ceiling"]["f1@1.0"] for r in picked)),
            ]
        lines.append(line)
    return table(["pattern", *(f"{n}" for noise in NOISES for n in (f"noise {noise:g}", "best possible"))], lines)


def parameters(tuning: dict[str, Any]) -> str:
    def text(parameters: Any) -> str:
        return ", ".join(
            f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}" for key, value in parameters.items()
        )

    lines = []
    for rival in RIVALS:
        if rival.grid:
            lines.append([rival.name, "defaults", text(rival.defaults)])
            lines += [[rival.name, noise, text(one["best"])] for noise, one in tuning.get(rival.name, {}).items()]
    return table(["rival", "noise", "parameters"], lines)


def table(head: Sequence[str], lines: Iterable[Sequence[Any]]) -> str:
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in [head, ["---"] * len(head), *lines])


def rows_of(rows: Sequence[Row]) -> str:
    """Rows as they are, their keys as the head."""
    lines = [[cell(value) if isinstance(value, float) else value for value in row.values()] for row in rows]
    return table(list(rows[0]), lines)


def cell(value: float, digits: int = 3) -> str:
    return "" if not np.isfinite(value) else f"{value:.{digits}f}"


def by_noise(rows: Sequence[Row], organized: bool, figure: str, which: str = "all") -> str:
    lines = []
    for method, variant in methods(rows):
        cells = []
        for noise in NOISES:
            picked = pick(
                rows,
                method,
                variant,
                lambda r, n=noise: r["organized"] == organized and r["noise"] == n and r["outliers"] == 0,
            )
            cells.append(cell(mean(r[which][figure] for r in picked if r.get(which))))
        if any(cells):
            lines.append([method_name(method, variant), *cells])
    return table(["method", *(f"noise {n:g}" for n in NOISES)], lines)


def by_scene(rows: Sequence[Row], key: str, values: Sequence[Any], test: Callable[[Row], bool]) -> str:
    lines = []
    for method, variant in methods(rows):
        picked = [r for r in pick(rows, method, variant, test) if "all" in r]
        lines.append(
            [method_name(method, variant)]
            + [cell(mean(r["all"]["f1@2.5"] for r in picked if r[key] == v)) for v in values]
        )
    # Long lists read better down than across.
    if len(values) > 6:
        turned = [[value, *(line[i + 1] for line in lines)] for i, value in enumerate(values)]
        return table([key, *(line[0] for line in lines)], turned)
    return table(["method", *(f"{v:g}" if isinstance(v, float) else v for v in values)], lines)


def negatives(rows: Sequence[Row]) -> str:
    lines = []
    for method, variant in methods(rows):
        cells = []
        for noise in NOISES:
            picked = pick(
                rows,
                method,
                variant,
                lambda r, n=noise: r["shape"] in NEGATIVES and r["noise"] == n and r["outliers"] == 0,
            )
            cells.append(cell(mean(r["false_per_thousand"] for r in picked), 1))
        if any(cells):
            lines.append([method_name(method, variant), *cells])
    return table(["method", *(f"noise {n:g}" for n in NOISES)], lines)


def by_turn(rows: Sequence[Row]) -> str:
    bins = [f"{a}-{b}" for a, b in itertools.pairwise(ANGLE_BINS)]
    lines = [[method_name(m, v), *map(cell, angle_f1(rows, m, v))] for m, v in methods(rows)]
    return table(["method", *bins], [line for line in lines if any(line[1:])])


def measures(rows: Sequence[Row]) -> str:
    head = ["method", "scenes", *(f"F1@{t}" for t in TOLERANCES), "zero: precision", "recall", "F1", "MCC", "IoU"]
    head += ["chamfer", "Hausdorff", "mean Hausdorff", "position: median", "95 %", "kinds right"]
    lines = []
    for method, variant in methods(rows):
        picked = pick(rows, method, variant, lambda r: "all" in r)
        if not picked:
            continue
        line = [method_name(method, variant), len(picked)]
        line += [cell(mean(r["all"][f"f1@{t}"] for r in picked)) for t in TOLERANCES]
        line += [cell(mean(r["zero"][name] for r in picked)) for name in ("precision", "recall", "f1", "mcc", "iou")]
        line += [cell(mean(r[name] for r in picked), 2) for name in ("chamfer", "hausdorff", "mean_hausdorff")]
        line += [cell(mean(r["position"][part] for r in picked if r["position"]), 2) for part in ("median", "p95")]
        lines.append([*line, cell(mean(r["kinds_right"] for r in picked))])
    return table(head, lines)


def published_scores(rows: list[Row]) -> str:
    means = published.means(rows)
    ours = [method for method in published.METHODS if any(key[1] == method for key in means)]
    theirs = sorted({row["method"] for row in rows if row["published"]})
    lines = []
    for method, is_published in [(m, False) for m in ours] + [(m, True) for m in theirs]:
        cells = [cell(means.get((family, method), float("nan"))) for family in published.FAMILIES]
        lines.append([f"{method} (published)" if is_published else method, *cells])
    return table(["method", *published.FAMILIES], lines)


def times(rows: list[Row], work: str) -> str:
    rows = [row for row in rows if row["work"] == work]
    sizes = sorted({row["points"] for row in rows})
    lines = []
    for method in dict.fromkeys(row["method"] for row in rows):
        seconds = {row["points"]: row["seconds"] for row in rows if row["method"] == method}
        lines.append([method, *(f"{seconds[size]:.3g}" if size in seconds else "" for size in sizes)])
    return table([work, *(f"{size:,}" for size in sizes)], lines)


def frame_times(rows: list[Row]) -> str:
    """Milliseconds of each method on each frame, and how many times as long the default takes."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    lines = []
    for frame in dict.fromkeys(row["frame"] for row in rows):
        mine = {row["method"]: row["seconds"] for row in rows if row["frame"] == frame}
        own = mine[methods[0]]
        times = [f"{1e3 * mine[m]:.1f} (x {own / mine[m]:.2f})" if m in mine else "" for m in methods[1:]]
        points = next(row["points"] for row in rows if row["frame"] == frame)
        lines.append([frame, f"{points:,}", f"{1e3 * own:.1f}", *times])
    return table(["frame, ms", "points", *methods], lines)


def memory(rows: list[Row]) -> str:
    lines = [[row["cloud"], f"{row['points']:,}", f"{row['bytes']:.0f}"] for row in rows]
    return table(["default, on", "points", "peak above the input, bytes a point"], lines)
