"""Score a method's answer on a scene, and choose a rival's parameters on scenes apart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from edgel import metrics
from edgel.edges import EdgeKind
from edgel.synth import Scene

TOLERANCES = (0.5, 1.0, 1.5, 2.5)  # in spacings
FAR = 2.5  # spacings: what is found farther from every true edge is false
MIN_TURN = np.radians(25.0)  # a crease that turns less is neither asked for nor held against anyone
ANGLE_BINS = tuple(range(0, 181, 20))  # degrees of turn
ALL = EdgeKind.BOUNDARY | EdgeKind.OCCLUDING | EdgeKind.OCCLUDED | EdgeKind.CREASE


@dataclass(frozen=True)
class Target:
    """What has to be found in a scene: positions of true edges, and those that count neither way."""

    strong: np.ndarray
    weak: np.ndarray


def target(scene: Scene, kinds: EdgeKind) -> Target:
    """True positions of some kinds; creases that hardly turn, and the other kinds, count neither way."""
    edges = scene.edges
    wanted = (edges.kind & int(kinds)) > 0
    faint = (
        ((edges.kind & int(EdgeKind.CREASE)) > 0) & (edges.kind == int(EdgeKind.CREASE)) & (edges.dihedral < MIN_TURN)
    )
    return Target(edges.positions[wanted & ~faint], edges.positions[~wanted | faint])


def score(scene: Scene, mask: np.ndarray, kind: np.ndarray, finds: EdgeKind) -> dict[str, Any]:
    """Every figure of one answer on one scene.

    A point is judged by where it would lie without noise: the answer is a choice of points, and must not be blamed for
    the sensor. An outlier lies nowhere and is always false.
    """
    finite = np.isfinite(scene.cloud.xyz).all(axis=1)
    rows = np.flatnonzero(mask)
    row: dict[str, Any] = {"points": int(finite.sum()), "found": len(rows)}
    labels = metrics.score_labels(mask[finite], scene.point_kind[finite] != 0)
    row["zero"] = {name: getattr(labels, name) for name in ("precision", "recall", "f1", "mcc", "iou")}
    away = _distance(scene.noise_free[rows], scene.edges.positions, scene.outlier[rows]) > FAR * scene.spacing
    row["false_per_thousand"] = 1000 * int(away.sum()) / row["points"]
    if len(target(scene, ALL).strong) == 0:
        return row
    row["all"] = _matched(scene, rows, target(scene, ALL))
    own = ALL & finds
    asked = target(scene, own)
    row["own"] = _matched(scene, rows, asked) if len(asked.strong) else None  # a closed surface has no boundary
    strong = target(scene, ALL).strong
    found = scene.cloud.xyz[rows]
    apart = metrics.distances(found, strong)
    row["chamfer"], row["hausdorff"], row["mean_hausdorff"] = (
        value / scene.spacing for value in (apart.chamfer, apart.hausdorff, apart.mean_hausdorff)
    )
    row["position"] = position_error(scene, rows)
    row["kinds_right"] = kinds_right(scene, mask, kind)
    row["by_angle"] = by_angle(scene, rows)
    return row


def ceiling(scene: Scene) -> dict[str, float]:
    """Best F1 that any choice of points could have: that of all points within the tolerance of a true edge."""
    strong = target(scene, ALL).strong
    points = scene.noise_free[np.isfinite(scene.cloud.xyz).all(axis=1) & ~scene.outlier]
    away = _distance(strong, points, np.zeros(len(strong), bool))
    recalls = {tolerance: float(np.mean(away <= tolerance * scene.spacing)) for tolerance in TOLERANCES}
    return {f"f1@{tolerance}": metrics.Matches(1.0, recall).f1 for tolerance, recall in recalls.items()}


def _matched(scene: Scene, rows: np.ndarray, truth: Target) -> dict[str, float]:
    """Precision, recall and F1 at each tolerance; predictions that only a weak edge explains are left out."""
    placed, outlier = scene.noise_free[rows], scene.outlier[rows]
    to_strong, to_weak = (_distance(placed, those, outlier) for those in (truth.strong, truth.weak))
    back = _distance(truth.strong, placed[~outlier], np.zeros(len(truth.strong), bool))
    figures = {}
    for tolerance in TOLERANCES:
        reach = tolerance * scene.spacing
        counted = (to_strong <= reach) | (to_weak > reach)
        precision = float(np.mean(to_strong[counted] <= reach)) if counted.any() else 0.0
        recall = float(np.mean(back <= reach)) if len(back) else 0.0
        figures |= {
            f"precision@{tolerance}": precision,
            f"recall@{tolerance}": recall,
            f"f1@{tolerance}": metrics.Matches(precision, recall).f1,
        }
    return figures


def _distance(positions: np.ndarray, among: np.ndarray, never: np.ndarray) -> np.ndarray:
    """Distance to the nearest of some positions; infinite where `never`, or where there are none."""
    result = np.full(len(positions), np.inf)
    if len(among) and not never.all():
        result[~never] = metrics.nearest(positions[~never], among).distances[:, 0]
    return result


def position_error(scene: Scene, rows: np.ndarray) -> dict[str, float] | None:
    """Distance, in spacings, of the found points as measured (noise and all) from the nearest true edge they found."""
    strong = target(scene, ALL).strong
    apart = _distance(scene.cloud.xyz[rows], strong, scene.outlier[rows]) / scene.spacing
    near = apart[apart <= FAR]
    if len(near) == 0:
        return None
    errors = metrics.spread(near)
    return {"median": errors.median, "p95": errors.p95}


def kinds_right(scene: Scene, mask: np.ndarray, kind: np.ndarray) -> float | None:
    """Share of the found true edge points that are called a kind they are; None where no kinds are told apart."""
    told = mask & (scene.point_kind != 0) & ((kind & int(ALL)) > 0)
    if not told.any():
        return None
    return float(np.mean((kind[told] & scene.point_kind[told]) != 0))


def by_angle(scene: Scene, rows: np.ndarray, tolerance: float = 1.0) -> dict[str, list[float]]:
    """True positives, found points and true positions of creases by their turn (bins of 20 degrees).

    A found point belongs to the bin of the nearest true edge, right or wrong; those nearest to another kind are left out.
    """
    edges = scene.edges
    placed = scene.noise_free[rows[~scene.outlier[rows]]]
    crease = edges.kind == int(EdgeKind.CREASE)
    bins = np.clip(np.digitize(np.degrees(np.nan_to_num(edges.dihedral)), ANGLE_BINS) - 1, 0, len(ANGLE_BINS) - 2)
    bins = np.where(crease, bins, -1)
    size = len(ANGLE_BINS) - 1

    def counts(of: np.ndarray) -> list[float]:
        return np.bincount(of[of >= 0], minlength=size)[:size].tolist()

    reach = tolerance * scene.spacing
    if len(placed) == 0 or len(edges.positions) == 0:
        return {"hits": [0] * size, "found": [0] * size, "reached": [0] * size, "true": counts(bins)}
    near = metrics.nearest(placed, edges.positions)
    which, hit = bins[near.points[:, 0]], near.distances[:, 0] <= reach
    back = metrics.nearest(edges.positions, placed).distances[:, 0] <= reach
    return {"hits": counts(which[hit]), "found": counts(which), "reached": counts(bins[back]), "true": counts(bins)}


def best_of_grid(
    rival: Any, scenes: Iterable[Scene], answer: Callable[[Any, Scene, Mapping[str, Any]], Any]
) -> tuple[Mapping[str, Any], list[dict[str, Any]]]:
    """Choose a rival's parameters by the mean F1 at 2.5 spacings (of the kinds it claims to find) over scenes apart.

    Where there is nothing to find, one minus the share of points called edges stands in for it.
    """
    scenes = list(scenes)
    tried = []
    for parameters in (rival.defaults, *rival.grid):
        goods = []
        for scene in scenes:
            found = answer(rival, scene, parameters)
            row = score(scene, found.mask, found.kind, rival.finds)
            goods.append(row["own"]["f1@2.5"] if row.get("own") else 1 - row["found"] / row["points"])
        tried.append({"parameters": dict(parameters), "mean": float(np.mean(goods))})
    return max(tried, key=lambda one: one["mean"])["parameters"], tried
