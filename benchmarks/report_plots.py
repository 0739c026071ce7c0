"""Plots of a benchmark's results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from accuracy import ANGLE_BINS
from matplotlib.figure import Figure
from report_rows import NOISES, Row, angle_f1, mean, method_name, methods, pick
from scenes import LADDER


def _axes(title: str, x: str, y: str) -> tuple[Figure, Any]:
    figure = Figure(figsize=(8, 4.6), layout="constrained")
    axes = figure.add_subplot(title=title, xlabel=x, ylabel=y)
    axes.grid(alpha=0.3)
    return figure, axes


def _style(method: str, variant: str) -> dict[str, Any]:
    if method.startswith("edgel"):
        return {"linewidth": 2.5, "marker": "o"}
    return {"linewidth": 1.2, "marker": ".", "linestyle": "-" if variant == "tuned" else ":"}


def noise(rows: Sequence[Row], organized: bool, figure: str, title: str) -> Figure:
    drawing, axes = _axes(title, "noise (spacings)", "F1")
    for method, variant in methods(rows):
        values = []
        for noise in NOISES:
            picked = pick(
                rows,
                method,
                variant,
                lambda r, n=noise: r["organized"] == organized and r["noise"] == n and r["scene"] in LADDER,
            )
            values.append(mean(r["all"][figure] for r in picked if "all" in r))
        if np.isfinite(values).any():
            axes.plot(NOISES, values, label=method_name(method, variant), **_style(method, variant))
    axes.set_ylim(0, 1)
    drawing.legend(loc="outside right upper", fontsize=8)
    return drawing


def turn(rows: Sequence[Row]) -> Figure:
    drawing, axes = _axes("F1 at 1 spacing by the turn of the crease, no noise", "turn (degrees)", "F1")
    middles = (np.array(ANGLE_BINS[:-1]) + ANGLE_BINS[1:]) / 2
    for method, variant in methods(rows):
        values = angle_f1(rows, method, variant)
        if np.isfinite(values).any():
            axes.plot(middles, values, label=method_name(method, variant), **_style(method, variant))
    axes.set_ylim(0, 1)
    drawing.legend(loc="outside right upper", fontsize=8)
    return drawing


def time(rows: list[Row], work: str) -> Figure:
    drawing, axes = _axes(f"{work}: median time", "points", "seconds")
    for method in dict.fromkeys(row["method"] for row in rows if row["work"] == work):
        mine = sorted((r["points"], r["seconds"]) for r in rows if r["work"] == work and r["method"] == method)
        axes.loglog(*zip(*mine, strict=True), label=method, **_style(method, "tuned"))
    drawing.legend(loc="outside right upper", fontsize=8)
    return drawing
