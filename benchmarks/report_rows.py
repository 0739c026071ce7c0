"""Picking and averaging a benchmark's results, row by row."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from accuracy import ANGLE_BINS

NOISES = (0.0, 0.1, 0.3, 1.0)
Row = dict[str, Any]


def methods(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Methods and variants, edgel's first, in the order they ran."""
    seen = list(dict.fromkeys((row["method"], row["variant"]) for row in rows))
    return sorted(seen, key=lambda one: not one[0].startswith("edgel"))


def method_name(method: str, variant: str) -> str:
    return method if method.startswith("edgel") else f"{method}, {variant}"


def mean(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None and np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def pick(rows: Sequence[Row], method: str, variant: str, test: Callable[[Row], bool]) -> list[Row]:
    return [row for row in rows if row["method"] == method and row["variant"] == variant and test(row)]


def angle_f1(rows: Sequence[Row], method: str, variant: str) -> np.ndarray:
    picked = pick(rows, method, variant, lambda r: r["noise"] == 0 and r["outliers"] == 0 and "by_angle" in r)
    if not picked:
        return np.full(len(ANGLE_BINS) - 1, np.nan)
    total = {
        name: np.sum([r["by_angle"][name] for r in picked], axis=0) for name in ("hits", "found", "reached", "true")
    }
    with np.errstate(invalid="ignore", divide="ignore"):
        precision, recall = total["hits"] / total["found"], total["reached"] / total["true"]
        f1 = np.nan_to_num(2 * precision * recall / (precision + recall))
    return np.where(total["true"] > 0, f1, np.nan)
