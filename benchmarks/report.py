"""Tables and plots of a benchmark's results: docs/benchmarks.md."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import growth
import numpy as np
import promises
import published
import roofline
from accuracy import ANGLE_BINS, TOLERANCES
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rivals import RIVALS
from scenes import LADDER, NEGATIVES

DOCS = Path(__file__).parent.parent / "docs"
NOISES = (0.0, 0.1, 0.3, 1.0)
Row = dict[str, Any]


def write(results: dict[str, Any]) -> Path:
    """Write docs/benchmarks.md and its plots."""
    (DOCS / "benchmarks").mkdir(exist_ok=True)
    rows = results["accuracy"]
    plots = {
        "noise-views.png": _plot_noise(rows, True, "f1@2.5", "flange and stepped block, pinhole: F1 at 2.5 spacings"),
        "noise-whole.png": _plot_noise(rows, False, "f1@1.0", "flange and stepped block, blue noise: F1 at 1 spacing"),
        "angle.png": _plot_angle(rows),
    }
    if "speed" in results:
        plots["time-normals.png"] = _plot_time(results["speed"], "normals of all points")
        plots["time-edges.png"] = _plot_time(results["speed"], "edges")
        if results["growth"]:
            plots["growth.png"] = growth.plot(results["growth"])
    for name, figure in plots.items():
        FigureCanvasAgg(figure).print_png(str(DOCS / "benchmarks" / name))
    path = DOCS / "benchmarks.md"
    path.write_text("\n\n".join(_page(results, rows)) + "\n")
    return path


def summary(results: dict[str, Any]) -> str:
    """The two main tables, for the terminal."""
    rows = results["accuracy"]
    return "\n\n".join(
        ["Single views, F1 at 2.5 spacings", _by_noise(rows, True, "f1@2.5"), "Whole surfaces, F1 at 1 spacing"]
        + [_by_noise(rows, False, "f1@1.0"), "False positives in 1000 points, negatives", _negatives(rows)]
    )


def _page(results: dict[str, Any], rows: list[Row]) -> Iterable[str]:
    m = results["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in m["versions"].items() if version)
    scenes = len({row["scene"] for row in rows})
    yield "# Benchmarks"
    yield (
        f"`make bench` on {m['date']}, commit {m['commit']}: {m['cores']} cores of {m['cpu']}, Python {m['python']}, {versions}; "
        f"{results['minutes']:.0f} minutes. {scenes} scenes of parts whose edges are known exactly; how they are made, what "
        "counts as an edge and how a score is taken is said in `benchmarks/scenes.py`, `edgel.synth` and `edgel.metrics`."
    )
    yield (
        "Each rival stands twice: with its documented *defaults*, and *tuned*: the best of a small grid, chosen on other "
        "scenes for each level of noise, as if the noise were told to it. edgel has no parameter to tune. All parameters: "
        "`benchmarks/rivals/README.md`, `benchmarks/tuned.json`. A method is scored against every true edge of a scene; "
        "*own kinds* counts only the kinds it claims to find. A crease that turns less than 25 degrees counts neither way."
    )
    yield "## Single views (organized clouds)\n\nMean F1 at 2.5 spacings by noise (in spacings), without outliers."
    yield _by_noise(rows, True, "f1@2.5")
    yield "The same, own kinds only."
    yield _by_noise(rows, True, "f1@2.5", "own")
    yield "![F1 against noise, single views](benchmarks/noise-views.png)"
    yield "## Whole surfaces (unorganized clouds)\n\nMean F1 at 1 spacing."
    yield _by_noise(rows, False, "f1@1.0")
    if any(row.get("ceiling") for row in rows):
        yield "Where points are strewn at random, or on lines 10 times as far apart as their steps, many a stretch of an edge has no point within a spacing. The mean F1 at 1 spacing of edgel's default beside the best that any choice of points could have:"
        yield _ceilings(rows)
    yield "Mean F1 at 2.5 spacings."
    yield _by_noise(rows, False, "f1@2.5")
    yield "![F1 against noise, whole surfaces](benchmarks/noise-whole.png)"
    yield "## By view and sampling\n\nMean F1 at 2.5 spacings, noise 0 and 0.1, without outliers."
    yield _by(
        rows, "view", sorted({row["view"] for row in rows}), lambda row: row["noise"] <= 0.1 and row["outliers"] == 0
    )
    yield "## By shape\n\nMean F1 at 2.5 spacings, noise 0 and 0.1, without outliers."
    shapes = sorted({row["shape"] for row in rows if "all" in row})
    yield _by(rows, "shape", shapes, lambda row: row["noise"] <= 0.1 and row["outliers"] == 0)
    yield "## Outliers\n\nMean F1 at 2.5 spacings by outliers in percent, noise 0 and 0.1."
    yield _by(rows, "outliers", sorted({row["outliers"] for row in rows}), lambda row: row["noise"] <= 0.1)
    yield "## Negatives\n\nFound points farther than 2.5 spacings from any true edge, in 1000 points, on shapes without a crease (sphere, torus, wavy sheet, plane; their outlines and borders are true edges), by noise, without outliers."
    yield _negatives(rows)
    if results.get("geometry"):
        yield "## Geometry of creases\n\nMedian errors of edgel's creases (default) on scenes without noise: position in spacings; direction, the worse of both faces' normals, and the turn, in degrees; and for which share of the crease points they are known."
        yield _geometry(results["geometry"])
    if results.get("wedges"):
        yield "## Wedges\n\nShare of a wedge's edge that edgel's default finds, within 1 and within 2.5 spacings, by the angle it turns (degrees); no noise."
        yield _wedges(results["wedges"])
    yield "## By the turn of the crease\n\nF1 at 1 spacing, all scenes of noise 0 without outliers, by the angle the surface turns (degrees)."
    yield _angles(rows)
    yield "![F1 against the turn of the crease](benchmarks/angle.png)"
    yield "## All measures\n\nMeans over all scenes with edges. Zero tolerance is against points within half a spacing of an edge; distances in spacings."
    yield _measures(rows)
    if results["published"]:
        yield "## Published models\n\nMean F1 at zero tolerance on public models, per point. *Published* rows are the authors' own (`published.csv`), measured on exactly these points; edgel's default is scored by its creases only."
        yield _published(results["published"])
    yield "## Normals of all points\n\nAngle to the true normal, degrees, k = 16: median and 95th percentile away from creases, and within 1.5 spacings of one."
    table = [[r["scene"], r["method"], *(_cell(r[key], 2) for key in list(r)[2:])] for r in results["normals"]]
    yield _table(["scene", "method", *list(results["normals"][0])[2:]], table)
    if "speed" in results:
        yield "## Speed\n\nThe tee, simulated with as many points; seconds, medians of 5 interleaved rounds on 2 threads, whatever index is needed included."
        yield _speed(results["speed"], "normals of all points")
        yield "![time of normals](benchmarks/time-normals.png)"
        yield _speed(results["speed"], "edges")
        yield "![time of edges](benchmarks/time-edges.png)"
        yield "Stages of both presets at 647,984 points."
        table = [[s["preset"], s["stage"], f"{s['seconds']:.4f}"] for s in results["stages"]]
        yield _table(["preset", "stage", "s"], table)
        yield from _limits(results)
    yield "## Parameters\n\nLengths in spacings, angles in degrees; *tuned* for each level of noise. Every grid entry tried and its mean is in `benchmarks/tuned.json`."
    yield _parameters(results["tuning"])
    pictures = DOCS / "benchmarks" / "pictures.md"
    if pictures.exists():
        yield pictures.read_text().strip()


def _limits(results: dict[str, Any]) -> Iterable[str]:
    if results["promises"]:
        yield "### What edgel promises\n\nMedians of interleaved rounds on 2 threads, indexes included (`benchmarks/promises.py`)."
        yield promises.table(results["promises"])
    yield "### How far from the limit\n\nBytes that have to move and operations that have to be done, at least, of each stage on the tee (`benchmarks/roofline.py`)."
    yield roofline.table(results["roofline"])
    if results["growth"]:
        yield "### Growth\n\nA wavy plateau, each size in a process of its own (`benchmarks/growth.py`); *projection* is the default detector with its outlines from an orthographic view."
        yield growth.table(results["growth"])
        yield "![time a point as clouds grow](benchmarks/growth.png)"


def _geometry(rows: Sequence[Row]) -> str:
    figures = ("position", "direction", "normals", "angle", "known")
    middle = ["**median**", *(_cell(float(np.median([row[figure] for row in rows]))) for figure in figures)]
    return _table(
        ["scene", *figures], [middle, *([row["scene"], *(_cell(row[figure]) for figure in figures)] for row in rows)]
    )


def _wedges(rows: Sequence[Row]) -> str:
    turns = sorted({row["turn"] for row in rows})
    at = {(row["seen"], row["turn"]): row for row in rows}
    lines = [
        [f"{seen}, {tolerance}", *(_cell(at[seen, turn][f"recall@{tolerance}"]) for turn in turns)]
        for seen in dict.fromkeys(row["seen"] for row in rows)
        for tolerance in ("1", "2.5")
    ]
    return _table(["view or pattern, spacings", *turns], lines)


def _ceilings(rows: Sequence[Row]) -> str:
    lines = []
    for pattern in sorted({row["view"] for row in rows if not row["organized"]}):
        line = [pattern]
        for noise in NOISES:
            picked = _pick(
                rows,
                "edgel default",
                "defaults",
                lambda r, n=noise, p=pattern: (
                    r["view"] == p and r["noise"] == n and r["outliers"] == 0 and r.get("ceiling")
                ),
            )
            line += [
                _cell(_mean(r["all"]["f1@1.0"] for r in picked)),
                _cell(_mean(r["ceiling"]["f1@1.0"] for r in picked)),
            ]
        lines.append(line)
    return _table(["pattern", *(f"{n}" for noise in NOISES for n in (f"noise {noise:g}", "best possible"))], lines)


def _parameters(tuning: dict[str, Any]) -> str:
    def text(parameters: Any) -> str:
        return ", ".join(
            f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}" for key, value in parameters.items()
        )

    lines = []
    for rival in RIVALS:
        if rival.grid:
            lines.append([rival.name, "defaults", text(rival.defaults)])
            lines += [[rival.name, noise, text(one["best"])] for noise, one in tuning.get(rival.name, {}).items()]
    return _table(["rival", "noise", "parameters"], lines)


def _methods(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Methods and variants, edgel's first, in the order they ran."""
    seen = list(dict.fromkeys((row["method"], row["variant"]) for row in rows))
    return sorted(seen, key=lambda one: not one[0].startswith("edgel"))


def _name(method: str, variant: str) -> str:
    return method if method.startswith("edgel") else f"{method}, {variant}"


def _mean(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None and np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def _table(head: Sequence[str], lines: Iterable[Sequence[Any]]) -> str:
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in [head, ["---"] * len(head), *lines])


def _cell(value: float, digits: int = 3) -> str:
    return "" if not np.isfinite(value) else f"{value:.{digits}f}"


def _pick(rows: Sequence[Row], method: str, variant: str, test: Callable[[Row], bool]) -> list[Row]:
    return [row for row in rows if row["method"] == method and row["variant"] == variant and test(row)]


def _by_noise(rows: Sequence[Row], organized: bool, figure: str, which: str = "all") -> str:
    lines = []
    for method, variant in _methods(rows):
        cells = []
        for noise in NOISES:
            picked = _pick(
                rows,
                method,
                variant,
                lambda r, n=noise: r["organized"] == organized and r["noise"] == n and r["outliers"] == 0,
            )
            cells.append(_cell(_mean(r[which][figure] for r in picked if r.get(which))))
        if any(cells):
            lines.append([_name(method, variant), *cells])
    return _table(["method", *(f"noise {n:g}" for n in NOISES)], lines)


def _by(rows: Sequence[Row], key: str, values: Sequence[Any], test: Callable[[Row], bool]) -> str:
    lines = []
    for method, variant in _methods(rows):
        picked = [r for r in _pick(rows, method, variant, test) if "all" in r]
        lines.append(
            [_name(method, variant)] + [_cell(_mean(r["all"]["f1@2.5"] for r in picked if r[key] == v)) for v in values]
        )
    # Long lists read better down than across.
    if len(values) > 6:
        turned = [[value, *(line[i + 1] for line in lines)] for i, value in enumerate(values)]
        return _table([key, *(line[0] for line in lines)], turned)
    return _table(["method", *(f"{v:g}" if isinstance(v, float) else v for v in values)], lines)


def _negatives(rows: Sequence[Row]) -> str:
    lines = []
    for method, variant in _methods(rows):
        cells = []
        for noise in NOISES:
            picked = _pick(
                rows,
                method,
                variant,
                lambda r, n=noise: r["shape"] in NEGATIVES and r["noise"] == n and r["outliers"] == 0,
            )
            cells.append(_cell(_mean(r["false_per_thousand"] for r in picked), 1))
        if any(cells):
            lines.append([_name(method, variant), *cells])
    return _table(["method", *(f"noise {n:g}" for n in NOISES)], lines)


def _angle_f1(rows: Sequence[Row], method: str, variant: str) -> np.ndarray:
    picked = _pick(rows, method, variant, lambda r: r["noise"] == 0 and r["outliers"] == 0 and "by_angle" in r)
    if not picked:
        return np.full(len(ANGLE_BINS) - 1, np.nan)
    total = {
        name: np.sum([r["by_angle"][name] for r in picked], axis=0) for name in ("hits", "found", "reached", "true")
    }
    with np.errstate(invalid="ignore", divide="ignore"):
        precision, recall = total["hits"] / total["found"], total["reached"] / total["true"]
        f1 = np.nan_to_num(2 * precision * recall / (precision + recall))
    return np.where(total["true"] > 0, f1, np.nan)


def _angles(rows: Sequence[Row]) -> str:
    bins = [f"{a}-{b}" for a, b in itertools.pairwise(ANGLE_BINS)]
    lines = [[_name(m, v), *map(_cell, _angle_f1(rows, m, v))] for m, v in _methods(rows)]
    return _table(["method", *bins], [line for line in lines if any(line[1:])])


def _measures(rows: Sequence[Row]) -> str:
    head = ["method", "scenes", *(f"F1@{t}" for t in TOLERANCES), "zero: precision", "recall", "F1", "MCC", "IoU"]
    head += ["chamfer", "Hausdorff", "mean Hausdorff", "position: median", "95 %", "kinds right"]
    lines = []
    for method, variant in _methods(rows):
        picked = _pick(rows, method, variant, lambda r: "all" in r)
        if not picked:
            continue
        line = [_name(method, variant), len(picked)]
        line += [_cell(_mean(r["all"][f"f1@{t}"] for r in picked)) for t in TOLERANCES]
        line += [_cell(_mean(r["zero"][name] for r in picked)) for name in ("precision", "recall", "f1", "mcc", "iou")]
        line += [_cell(_mean(r[name] for r in picked), 2) for name in ("chamfer", "hausdorff", "mean_hausdorff")]
        line += [_cell(_mean(r["position"][part] for r in picked if r["position"]), 2) for part in ("median", "p95")]
        lines.append([*line, _cell(_mean(r["kinds_right"] for r in picked))])
    return _table(head, lines)


def _published(rows: list[Row]) -> str:
    means = published.means(rows)
    ours = [method for method in published.METHODS if any(key[1] == method for key in means)]
    theirs = sorted({row["method"] for row in rows if row["published"]})
    lines = []
    for method, is_published in [(m, False) for m in ours] + [(m, True) for m in theirs]:
        cells = [_cell(means.get((family, method), float("nan"))) for family in published.FAMILIES]
        lines.append([f"{method} (published)" if is_published else method, *cells])
    return _table(["method", *published.FAMILIES], lines)


def _speed(rows: list[Row], work: str) -> str:
    rows = [row for row in rows if row["work"] == work]
    sizes = sorted({row["points"] for row in rows})
    lines = []
    for method in dict.fromkeys(row["method"] for row in rows):
        seconds = {row["points"]: row["seconds"] for row in rows if row["method"] == method}
        lines.append([method, *(f"{seconds[size]:.3g}" if size in seconds else "" for size in sizes)])
    return _table([work, *(f"{size:,}" for size in sizes)], lines)


def _axes(title: str, x: str, y: str) -> tuple[Figure, Any]:
    figure = Figure(figsize=(8, 4.6), layout="constrained")
    axes = figure.add_subplot(title=title, xlabel=x, ylabel=y)
    axes.grid(alpha=0.3)
    return figure, axes


def _style(method: str, variant: str) -> dict[str, Any]:
    if method.startswith("edgel"):
        return {"linewidth": 2.5, "marker": "o"}
    return {"linewidth": 1.2, "marker": ".", "linestyle": "-" if variant == "tuned" else ":"}


def _plot_noise(rows: Sequence[Row], organized: bool, figure: str, title: str) -> Figure:
    drawing, axes = _axes(title, "noise (spacings)", "F1")
    for method, variant in _methods(rows):
        values = []
        for noise in NOISES:
            picked = _pick(
                rows,
                method,
                variant,
                lambda r, n=noise: r["organized"] == organized and r["noise"] == n and r["scene"] in LADDER,
            )
            values.append(_mean(r["all"][figure] for r in picked if "all" in r))
        if np.isfinite(values).any():
            axes.plot(NOISES, values, label=_name(method, variant), **_style(method, variant))
    axes.set_ylim(0, 1)
    drawing.legend(loc="outside right upper", fontsize=8)
    return drawing


def _plot_angle(rows: Sequence[Row]) -> Figure:
    drawing, axes = _axes("F1 at 1 spacing by the turn of the crease, no noise", "turn (degrees)", "F1")
    middles = (np.array(ANGLE_BINS[:-1]) + ANGLE_BINS[1:]) / 2
    for method, variant in _methods(rows):
        values = _angle_f1(rows, method, variant)
        if np.isfinite(values).any():
            axes.plot(middles, values, label=_name(method, variant), **_style(method, variant))
    axes.set_ylim(0, 1)
    drawing.legend(loc="outside right upper", fontsize=8)
    return drawing


def _plot_time(rows: list[Row], work: str) -> Figure:
    drawing, axes = _axes(f"{work}: median time", "points", "seconds")
    for method in dict.fromkeys(row["method"] for row in rows if row["work"] == work):
        mine = sorted((r["points"], r["seconds"]) for r in rows if r["work"] == work and r["method"] == method)
        axes.loglog(*zip(*mine, strict=True), label=method, **_style(method, "tuned"))
    drawing.legend(loc="outside right upper", fontsize=8)
    return drawing
