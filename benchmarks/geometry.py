"""How exactly edgel places clean creases (position, direction, normals of both faces), and how blunt a wedge it finds."""

from __future__ import annotations

from typing import Any

import numpy as np
import scenes
from accuracy import MIN_TURN

import edgel
from edgel import metrics, synth
from edgel.edges import EdgeKind
from edgel.synth import Scene

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


TURNS = (30, 40, 50, 60, 75, 90, 105, 120, 135, 150)
"""Degrees by which the edges of wedges turn."""


def wedges() -> list[dict[str, Any]]:
    """Recall of clean wedges by their turn, within 1 and 2.5 spacings, for each view and pattern without scan lines."""
    rows = []
    solids = {turn: synth.wedge_fan(angles=(180 - turn,) * 3, flank=15.0) for turn in TURNS}
    for seen in (*synth.PROJECTIONS, "uniform", "blue_noise", "graded", "vertices"):
        for turn, solid in solids.items():
            if seen in synth.PROJECTIONS:
                scene = synth.view(solid, projection=seen, spacing=0.8, **scenes.POSES[0])
            else:
                scene = synth.sample(solid, pattern=seen, spacing=0.8, seed=turn)
            rows.append({"seen": seen, "turn": turn} | recall(scene, turn))
    return rows


def recall(scene: Scene, turn: float) -> dict[str, float]:
    """Share of the edges that turn by so many degrees (the feet of the wedges turn otherwise) that a found point is near."""
    found = edgel.detect(scene.cloud)
    wanted = np.abs(np.degrees(np.nan_to_num(scene.edges.dihedral, nan=-90.0)) - turn) < 1
    away = metrics.nearest(scene.edges.positions[wanted], scene.cloud.xyz[found.index]).distances[:, 0] / scene.spacing
    return {"recall@1": float(np.mean(away <= 1)), "recall@2.5": float(np.mean(away <= 2.5))}


def errors(found: edgel.Edges, true: Any, spacing: float) -> dict[str, float]:
    """Median errors of the found creases against the nearest true one: spacings and degrees."""
    nearest = metrics.nearest(found.position, true.positions)
    here = nearest.distances[:, 0] < REACH * spacing
    found, true = found.take(here), true.take(nearest.points[here, 0])
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
