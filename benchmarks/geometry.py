"""How exactly edgel places clean creases: position, direction, and the normals of both faces."""

from __future__ import annotations

from typing import Any

import numpy as np
import scenes
from accuracy import MIN_TURN

import edgel
from edgel import metrics
from edgel.edges import EdgeKind

REACH = 1.5  # spacings: a crease point farther from every true crease is false, and counted elsewhere


def run() -> list[dict[str, Any]]:
    """Median errors on every scene without noise and outliers that has creases."""
    rows = []
    for name in scenes.TEST:
        if name.endswith("/n0/o0"):
            try:
                scene = scenes.load(name)
            except ImportError:  # build123d is not there
                continue
            found = edgel.detect(scene.cloud, kinds=EdgeKind.CREASE)
            true = scene.edges.take(np.nan_to_num(scene.edges.dihedral) >= MIN_TURN)
            if len(true) and len(found):
                rows.append({"scene": name} | errors(found, true, scene.spacing))
    return rows


def errors(found: edgel.Edges, true: Any, spacing: float) -> dict[str, float]:
    """Median errors of the found creases against the nearest true one: spacings and degrees."""
    nearest = metrics.nearest(found.position, true.positions)
    here = nearest.distances[:, 0] < REACH * spacing
    found, true = found.take(here), true.take(nearest.rows[here, 0])
    off = found.position - true.positions
    off -= (off * true.tangents).sum(axis=1, keepdims=True) * true.tangents
    straight, crossed = (
        np.maximum(*(_between(found.normals[:, i], true.normals[:, j]) for i, j in pairs))
        for pairs in (((0, 0), (1, 1)), ((0, 1), (1, 0)))
    )
    return {
        "position": float(np.median(np.linalg.norm(off, axis=1)) / spacing),
        "direction": float(np.nanmedian(_between(found.direction, true.tangents))),
        "normals": float(np.nanmedian(np.fmin(straight, crossed))),
        "angle": float(np.nanmedian(np.degrees(np.abs(found.angle - true.dihedral)))),
        "known": float(np.mean(np.isfinite(found.angle))),
    }


def _between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle between lines, degrees."""
    return np.degrees(np.arccos(np.clip(np.abs((a * b).sum(axis=1)), 0, 1)))
