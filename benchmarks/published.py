"""Per-point scores on public models with truth, beside the published ones of other methods on the same points."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
from rivals import RIVALS

import edgel
from edgel import metrics
from edgel._neighbors.thinning import median_spacing
from edgel.edges import EdgeKind

FAMILIES = ("abc", "abc_noise_0.04", "shrec", "default")
METHODS = ("edgel default", "edgel paper", "surface variation")
SCORES = ("precision", "recall", "f1", "mcc", "iou")


def published(data: Path) -> list[dict[str, Any]]:
    """Rows of published.csv as they are."""
    with (data / "published.csv").open() as file:
        return [
            {"family": row["dataset"], "model": row["model"], "method": row["method"], "published": True}
            | {name: float(row[name]) for name in SCORES}
            for row in csv.DictReader(file)
        ]


def measured(data: Path) -> list[dict[str, Any]]:
    """Zero-tolerance scores of ours and of the classical rival, with their defaults; only creases are asked for."""
    rows = []
    rivals = [rival for rival in RIVALS if rival.name in METHODS and rival.missing() is None]
    for file in sorted(data.glob("*.ply")):
        cloud = edgel.read(file)
        family, model = file.stem.rsplit("_", 1)
        truth = cloud.attributes["edge"]
        for rival in rivals:
            found = rival.run(cloud, median_spacing(cloud), rival.defaults)
            mask = found.mask
            if rival.name == "edgel default":  # these models are closed: a boundary is no crease
                mask = mask & ((found.kind & int(EdgeKind.CREASE)) > 0)
            scores = metrics.score_labels(mask, truth)
            rows.append(
                {"family": family, "model": model, "method": rival.name, "published": False}
                | {name: getattr(scores, name) for name in SCORES}
            )
    return rows


def means(rows: list[dict[str, Any]]) -> dict[tuple[str, str], float]:
    """Mean F1 by family and method."""
    return {
        (family, method): float(np.mean([r["f1"] for r in rows if r["family"] == family and r["method"] == method]))
        for family, method in {(r["family"], r["method"]) for r in rows}
    }
