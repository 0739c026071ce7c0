"""Curves: how much of the true edges is recovered as lines, how near, how round, and how fast.

Run: python benchmarks/curves.py [--quick] [--data ../shared/data] [--real ../shared/real] (part of make bench). Edges are
found with `min_strength=edgel.curves.FAINT`, as the command line does.

True edges turn by 25 degrees or more; extra are curves farther than a spacing from any true edge, faint ones included,
over the true length. True corners are ends of true curves that meet at 20 degrees or more; a corner found is right
within 2 spacings of one, or of a true curve that turns by more than 30 degrees within a spacing. A circle is found if
centre and radius together are off by less than 1.5 spacings.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import parts
import scenes
from scipy.spatial import KDTree

import edgel
from edgel import synth
from edgel.curves import FAINT, CurveKind, Curves, trace
from edgel.synth import nearest_edge
from edgel.synth.truth import CREASE_TURN, sample_curves

SYNTHETIC = ("frustum", "stepped_block", "gear", "wedge_fan", "cube_fractal")
CAD = ("tee", "elbow", "flange", "bracket", "chamfered_block", "sheet_metal", "plate")
STEP = {
    "featuretype": ("cad_trimesh/featuretype.STEP", 40_000),
    "abc_00000050": ("cad_abc/00000050_80d90bfdd2e74e709956122a_step_000.step", 200_000),
}
"""Files, and how many points."""
NOISES = (0.0, 0.1, 0.3)
TARGETS = {
    "recovered": (0.99, 0.97, 0.92), "extra": (0.02, 0.02, 0.03), "distance": (0.05, 0.08, 0.15),
    "corner_recall": (0.95, 0.92, 0.85), "corner_precision": (0.95, 0.92, 0.85), "rims": (0.95, 0.95, 0.95),
    "diameter": (0.02, 0.03, 0.05), "diameter_largest": (0.1, 0.1, np.inf),
}  # fmt: skip


def plate() -> Any:
    """A plate with six holes, a slot, a pocket and a boss."""
    cad = parts.cad
    solid = cad.Box(90, 60, 8)
    for x, y, radius in [(-36, -22, 3), (-36, 22, 4), (-22, 0, 6), (0, -20, 5), (0, 18, 8), (36, 22, 3.5)]:
        solid -= cad.Pos(x, y, 0) * cad.Cylinder(radius, 30)
    slot = cad.Pos(24, -18, 0) * cad.Box(24, 8, 30)
    solid -= cad.fillet(slot.edges().filter_by(cad.Axis.Z), 3.99)
    solid -= cad.Pos(24, 4, 4) * cad.Box(20, 14, 6)
    return solid + cad.Pos(-14, -18, 4) * cad.Cylinder(5, 12, align=(cad.Align.CENTER, cad.Align.CENTER, cad.Align.MIN))


def solid_of(name: str, data: Path) -> synth.Solid | None:
    """Return a part; None where its file is not there."""
    if name == "plate":
        return parts.tessellate(name, plate(), 0.8)
    if name not in STEP:
        return scenes.solid(name)
    path = data / STEP[name][0]
    if not path.exists():
        return None
    shape = parts.cad.import_step(str(path))
    return parts.tessellate(name, shape, float(np.sqrt(shape.area / STEP[name][1])))


def run(data: Path, *, quick: bool = False) -> list[dict[str, Any]]:
    """Score every part at every noise."""
    names = ("plate", "bracket", "gear") if quick else (*SYNTHETIC, *CAD, *STEP)
    rows = []
    for name in names:
        solid = solid_of(name, data)
        for noise in NOISES if solid is not None else ():
            for seed in (1,) if quick else (1, 2):
                rows.append(score(solid, noise, seed))
                print("  " + line_of(rows[-1]), flush=True)
    return rows


def score(solid: synth.Solid, noise: float, seed: int) -> dict[str, Any]:
    """Sample a part, find its curves, and compare."""
    scene = synth.sample(solid, pattern="blue_noise", spacing=solid.spacing, noise=noise, seed=seed)
    return compare(solid, scene, edgel.detect(scene.cloud, min_strength=FAINT), noise, seed)


def compare(solid: synth.Solid, scene: synth.Scene, edges: edgel.Edges, noise: float, seed: int) -> dict[str, Any]:
    """Find the curves of a sample, and compare them with the part's."""
    h = scene.spacing
    start = time.process_time()
    curves = trace(scene.cloud, edges)
    seconds = time.process_time() - start
    sharp = [curve for curve in solid.edges if is_sharp(curve)]
    true = sample_curves(sharp, 0.25 * h).positions
    places, weight = along(curves, 0.25 * h)
    far = nearest_edge(places, solid.edges).distance / h if len(places) else np.empty(0)
    row = {"part": solid.name, "noise": noise, "seed": seed, "points": len(scene.cloud), "edge_points": len(edges)}
    row |= {"curves": len(curves), "seconds": seconds}
    if len(true):
        row["recovered"] = float((KDTree(places).query(true)[0] < h).mean()) if len(places) else 0.0
        row["by_edge_points"] = float((KDTree(edges.position).query(true)[0] < h).mean())
        row["extra"] = float(weight[far > 1].sum() / sum(curve.length for curve in sharp))
        row["distance"] = weighted_median(far[far <= 1], weight[far <= 1])
    corners, vertices = true_corners(sharp, h), true_corners(list(solid.edges), h)
    bends = sharp_bends(list(solid.edges), h)
    if len(corners):
        row["corner_recall"] = near(corners, curves.corners, 2 * h)
    if len(curves.corners):
        row["corner_precision"] = near(curves.corners, np.concatenate([vertices, bends]), 2 * h)
    return row | circles(curves, sharp, h)


def is_sharp(curve: synth.EdgeCurve) -> bool:
    return curve.normals is None or float(np.median(curve.dihedral)) >= CREASE_TURN


def along(curves: Curves, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Places along all curves, and the length that each stands for."""
    places, weights = [np.empty((0, 3))], [np.empty(0)]
    for k in range(len(curves)):
        path = curves.points_of(k)
        at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        count = max(int(at[-1] / step), 2)
        where = (np.arange(count) + 0.5) / count * at[-1]
        places.append(np.stack([np.interp(where, at, path[:, axis]) for axis in range(3)], axis=1))
        weights.append(np.full(count, at[-1] / count))
    return np.concatenate(places), np.concatenate(weights)


def weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])]) if len(values) else np.nan


def near(asked: np.ndarray, there: np.ndarray, reach: float) -> float:
    return float((KDTree(there).query(asked)[0] < reach).mean()) if len(there) else 0.0


def true_corners(curves: list[synth.EdgeCurve], h: float) -> np.ndarray:
    """Where ends of curves meet at 20 degrees or more."""
    ends, tangents = [], []
    for curve in curves:
        path = curve.points
        if np.linalg.norm(path[0] - path[-1]) < 1e-6:
            continue
        for end, inner in ((path[0], path[min(3, len(path) - 1)]), (path[-1], path[-min(4, len(path))])):
            ends.append(end)
            tangents.append((inner - end) / np.linalg.norm(inner - end))
    if not ends:
        return np.empty((0, 3))
    places, directions = np.array(ends), np.array(tangents)
    done, corners = np.zeros(len(places), bool), []
    tree = KDTree(places)
    for i in range(len(places)):
        group = [] if done[i] else tree.query_ball_point(places[i], 0.02 * h)
        done[group] = True
        if len(group) > 1 and np.abs(directions[group] @ directions[group].T).min() < np.cos(np.radians(20)):
            corners.append(places[i])
    return np.array(corners).reshape(-1, 3)


def sharp_bends(curves: list[synth.EdgeCurve], h: float) -> np.ndarray:
    """Places where a true curve turns by more than 30 degrees within a spacing: corners rounded by less than two."""
    found = [np.empty((0, 3))]
    for curve in curves:
        path = curve.points
        step = np.diff(path, axis=0)
        at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(step, axis=1))])
        where = np.arange(0, at[-1], 0.25 * h)
        tangents = step / np.linalg.norm(step, axis=1, keepdims=True)
        before, after = (np.clip(np.searchsorted(at, where + s * 0.5 * h) - 1, 0, len(step) - 1) for s in (-1, 1))
        turns = (tangents[before] * tangents[after]).sum(axis=1) < np.cos(np.radians(30))
        found.append(np.stack([np.interp(where[turns], at, path[:, axis]) for axis in range(3)], axis=1))
    return np.concatenate(found)


def true_circles(curves: list[synth.EdgeCurve]) -> list[tuple[np.ndarray, float]]:
    """Whole circles: of one curve, or of arcs that go on in each other."""
    arcs = []
    for curve in curves:
        path = curve.points
        middle = path.mean(axis=0)
        _, size, axes = np.linalg.svd(path - middle, full_matrices=False)
        if len(path) < 5 or size[1] < 1e-3 * size[0]:
            continue
        x, y, z = axes @ (path - middle).T
        a, b, c = np.linalg.lstsq(np.stack([2 * x, 2 * y, np.ones(len(x))], axis=1), x * x + y * y, rcond=None)[0]
        radius = float(np.sqrt(c + a * a + b * b))
        if max(np.abs(np.hypot(x - a, y - b) - radius).max(), np.abs(z).max()) < 2e-3 * radius:
            arcs.append((middle + a * axes[0] + b * axes[1], radius, curve.length))
    circles, left = [], arcs
    while left:
        centre, radius, _ = left[0]
        same = [np.linalg.norm(arc[0] - centre) + abs(arc[1] - radius) < 0.02 * radius for arc in left]
        if sum(arc[2] for arc, own in zip(left, same, strict=True) if own) > 0.98 * 2 * np.pi * radius:
            circles.append((centre, radius))
        left = [arc for arc, own in zip(left, same, strict=True) if not own]
    return circles


def circles(curves: Curves, sharp: list[synth.EdgeCurve], h: float) -> dict[str, Any]:
    """Compare circles with true ones of 3.5 spacings and more; false ones with all."""
    found = np.flatnonzero(curves.kind == CurveKind.CIRCLE)
    true = true_circles(sharp)

    def off(centre: np.ndarray, radius: float) -> np.ndarray:
        return np.linalg.norm(curves.centre[found] - centre, axis=1) + np.abs(curves.radius[found] - radius)

    right = np.zeros(len(found), bool)
    errors, deviations, asked = [], [], 0
    for centre, radius in true:
        distance = off(centre, radius)
        hit = len(found) > 0 and distance.min() < 1.5 * h
        right |= distance < 1.5 * h
        if radius < 3.5 * h:
            continue
        asked += 1
        if hit:
            k = found[distance.argmin()]
            errors.append(float(2 * (curves.radius[k] - radius) / h))
            deviations.append(float(2 * curves.radius_std[k] / h))
    return {"rims_true": asked, "rims_errors": errors, "rims_std": deviations, "false_circles": int((~right).sum())}


def summary(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Return the lines of the table: figures over all parts beside what is wanted."""
    for noise, at in zip(NOISES, range(len(NOISES)), strict=True):
        of = [row for row in rows if row["noise"] == noise]
        for name in ("recovered", "extra", "distance", "corner_recall", "corner_precision"):
            values = [row[name] for row in of if name in row]
            worst = sorted(zip(values, (row["part"] for row in of if name in row), strict=True))
            ends = worst[-1] if name in ("extra", "distance") else worst[0]
            yield (
                f"noise {noise}: {name} median {np.median(values):.3f}, mean {np.mean(values):.3f}, worst {ends[0]:.3f} "
                f"({ends[1]}); wanted {TARGETS[name][at]}"
            )
        errors = np.array([error for row in of for error in row["rims_errors"]])
        stds = np.array([std for row in of for std in row["rims_std"]])
        asked = sum(row["rims_true"] for row in of)
        inside = np.mean(np.abs(errors) < 1.96 * stds)
        yield (
            f"noise {noise}: rims {len(errors)} of {asked} ({len(errors) / asked:.3f}); diameter error median "
            f"{np.median(np.abs(errors)):.4f}, largest {np.abs(errors).max():.3f}; 95 % interval covers {inside:.3f}; "
            f"false circles {sum(row['false_circles'] for row in of)}"
        )


def line_of(row: dict[str, Any]) -> str:
    numbers = (
        f"{name} {row[name]:.3f}"
        for name in ("recovered", "by_edge_points", "extra", "distance", "corner_recall", "corner_precision")
        if name in row
    )
    return f"{row['part']:16} {row['noise']:.1f} {row['seed']}: {', '.join(numbers)}, rims {len(row['rims_errors'])}/{row['rims_true']}, false {row['false_circles']}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="three parts")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--real", type=Path, default=Path("../shared/real"))
    options = parser.parse_args()
    rows = run(options.data, quick=options.quick)
    print("\n".join(summary(rows)))
    if not options.quick:
        import curves_real

        print(json.dumps(curves_real.run(options.data, options.real), indent=1))


if __name__ == "__main__":
    main()
