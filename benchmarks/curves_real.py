"""Curves on real roofs, against surveyed sides of buildings, on CAD models whose edge points are known, and their time."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

import edgel
from edgel import synth
from edgel.curves import FAINT, Curves, right_angles, trace


def run(data: Path, real: Path) -> dict[str, Any]:
    """Return whatever the folders allow."""
    found: dict[str, Any] = {"time": timed()}
    if (data / "roofs").is_dir():
        found["roofs"] = roofs(data / "roofs")
    if (real / "ahn3_bgt" / "dev").is_dir():
        found["sides"] = sides(real / "ahn3_bgt" / "dev")
    if (data / "truth").is_dir():
        found["truth"] = truth(data / "truth")
    return found


def sampled(first: np.ndarray, last: np.ndarray, step: float) -> np.ndarray:
    """Places along segments (S, 3), so far apart."""
    return places_along(first, last, step)[0]


def places_along(first: np.ndarray, last: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Places along segments (S, D), so far apart, and the segment of each."""
    number = np.maximum((np.linalg.norm(last - first, axis=1) / step).astype(np.int64), 1)
    owner = np.repeat(np.arange(len(number)), number)
    at = (np.arange(len(owner)) - np.repeat(np.cumsum(number) - number, number) + 0.5) / number[owner]
    return first[owner] + at[:, None] * (last - first)[owner], owner


def segments(curves: Curves) -> tuple[np.ndarray, np.ndarray]:
    """First and last places of all straight steps of curves."""
    inner = np.ones(len(curves.vertices), bool)
    inner[curves.start[1:] - 1] = False
    first = np.flatnonzero(inner)
    return curves.vertices[first], curves.vertices[first + 1]


def wireframe(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and the pairs that are sides of faces, of an OBJ of polygons."""
    vertices, pairs = [], set()
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(word) for word in words[1:4]])
        elif words[:1] in (["f"], ["l"]):
            rows = [int(word.split("/")[0]) - 1 for word in words[1:]]
            steps = zip(rows, rows[1:] + (rows[:1] if words[0] == "f" else []), strict=False)
            pairs |= {(min(a, b), max(a, b)) for a, b in steps}
    return np.array(vertices), np.array(sorted(pairs))


def compare(
    true: tuple[np.ndarray, np.ndarray],
    found: tuple[np.ndarray, np.ndarray],
    corners: np.ndarray,
    true_corners: np.ndarray,
    reach: float,
) -> dict[str, float]:
    step = 0.1 * reach
    asked, there = sampled(*true, step), sampled(*found, step)
    length = float(np.linalg.norm(true[1] - true[0], axis=1).sum())
    result = {"recovered": float((KDTree(there).query(asked)[0] < reach).mean()) if len(there) else 0.0}
    far = KDTree(asked).query(there)[0] >= reach if len(there) else np.empty(0, bool)
    result["extra"] = float(far.sum() * step / length)
    result["corner_recall"] = float((KDTree(corners).query(true_corners)[0] < reach).mean()) if len(corners) else 0.0
    result["corner_precision"] = float((KDTree(true_corners).query(corners)[0] < reach).mean()) if len(corners) else 0.0
    return result


def roofs(folder: Path) -> dict[str, dict[str, float]]:
    """Eight roofs of 1,024 points: ours and the published results, within 1.5 spacings of the true polygons."""
    rows: dict[str, list[dict[str, float]]] = {}
    for roof in sorted(folder.glob("Roof_*")):
        xyz = np.unique(np.loadtxt(roof / "points.xyz")[:, :3], axis=0)
        reach = 1.5 * spacing_of(xyz)
        vertices, pairs = wireframe(roof / "ground_truth.obj")
        true = vertices[pairs[:, 0]], vertices[pairs[:, 1]]
        curves = trace(xyz, edgel.detect(xyz, method="surface", min_strength=FAINT))
        rows.setdefault("edgel", []).append(compare(true, segments(curves), curves.corners, vertices, reach))
        for name in ("Point2Roof", "TopoLAP", "2D_dual_contouring"):
            own, sides_ = wireframe(roof / f"{name}.obj")
            found = own[sides_[:, 0]], own[sides_[:, 1]]
            rows.setdefault(name, []).append(compare(true, found, own, vertices, reach))
    return {name: {key: float(np.mean([row[key] for row in of])) for key in of[0]} for name, of in rows.items()}


def spacing_of(xyz: np.ndarray) -> float:
    """Root of the area a point stands for, from the 16 nearest."""
    return float(np.median(KDTree(xyz).query(xyz, 16)[0][:, -1]) * np.sqrt(np.pi / 16))


def sides(folder: Path) -> dict[str, float]:
    """Surveyed sides of buildings: share covered by lines as they are, and by those turned to right angles."""
    cloud = edgel.read(next(folder.glob("*.laz")))
    curves = trace(cloud, edgel.detect(cloud, min_strength=FAINT))
    surveyed = json.loads((folder / "step_edges.json").read_text())
    turned = {f"right_angles_{d}": covered(surveyed, right_angles(curves, np.radians(d))) for d in (5, 10)}
    return {"covered": covered(surveyed, curves), **turned, "curves": len(curves)}


def covered(surveyed: list[dict[str, Any]], curves: Curves) -> float:
    """Share of the length of sides with a line within 0.4 m in plan and 3 degrees, nearer to the roof than the ground."""
    first, last = segments(curves)
    length = np.linalg.norm((last - first)[:, :2], axis=1)
    long = length > 0.05
    first, last, length = first[long], last[long], length[long]
    direction = (last - first)[:, :2] / length[:, None]
    height = 0.5 * (first + last)[:, 2]
    there, owner = places_along(first[:, :2], last[:, :2], 0.1)
    tree = KDTree(there)
    hits = total = 0
    for side in surveyed:
        a, b = np.array(side["a"]), np.array(side["b"])
        along = (b - a) / np.linalg.norm(b - a)
        # A steep roof ends far below its lowest return inside: the middle of the step tells it from the ground.
        good = (np.abs(direction @ along) > np.cos(np.radians(3))) & (height > side["z_out"] + 0.5 * side["jump"])
        near = tree.query_ball_point(sampled(a[None], b[None], 0.1), 0.4)
        hits += sum(bool(good[owner[which]].any()) for which in near)
        total += len(near)
    return hits / total


def truth(folder: Path) -> dict[str, dict[str, float]]:
    """Share of true edge points within a spacing of an edge point, and of a curve."""
    rows = {}
    for path in sorted(folder.glob("abc_[0-9]*.ply")):
        cloud = edgel.read(path)
        true = cloud.xyz[cloud.attributes["edge"] == 1]
        h = spacing_of(cloud.xyz)
        edges = edgel.detect(cloud.xyz)
        curves = trace(cloud.xyz, edgel.detect(cloud.xyz, min_strength=FAINT))
        there = sampled(*segments(curves), 0.2 * h)
        rows[path.stem] = {
            "edge_points": float((KDTree(cloud.xyz[edges.index]).query(true)[0] < h).mean()),
            "curves": float((KDTree(there).query(true)[0] < h).mean()) if len(there) else 0.0,
        }
    return rows


def timed(wanted: int = 100_000) -> dict[str, float]:
    """Linking and fitting as many edge points: stepped blocks side by side."""
    solid = synth.stepped_block()
    scene = synth.sample(solid, pattern="blue_noise", spacing=solid.spacing, noise=0.1, seed=1)
    one = edgel.detect(scene.cloud)
    count = -(-wanted // len(one))
    size = 1.5 * np.ptp(scene.cloud.xyz, axis=0).max()
    shifts = np.stack([np.arange(count) % 10, np.arange(count) // 10, np.zeros(count)], axis=1) * size
    many = {
        name: np.concatenate([getattr(one, name)] * count)
        for name in ("kind", "strength", "position_std", "direction", "normals", "angle", "convex")
    }
    edges = replace(
        one,
        index=np.concatenate([one.index + k * len(scene.cloud) for k in range(count)]),
        position=np.concatenate([one.position + shift for shift in shifts]),
        num_points=count * len(scene.cloud),
        **many,
    )
    xyz = np.concatenate([scene.cloud.xyz + shift for shift in shifts])
    trace(scene.cloud, one)
    rounds = []
    for _ in range(3):
        wall, cpu = time.perf_counter(), time.process_time()
        trace(xyz, edges)
        rounds.append((time.perf_counter() - wall, time.process_time() - cpu))
    wall, cpu = min(rounds)
    return {"edge_points": len(edges), "points": len(xyz), "wall": wall, "cpu": cpu}
