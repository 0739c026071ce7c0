"""Pairs of clouds whose pose is known: views, parts, crops and clutter; each is made again from its row, noise and number.

A pair is right by less than 5 degrees and 5 spacings at the middle of the part, up to the symmetries of the part. The
groups are exact: turns about an axis by a share of the circle, and half turns about axes across it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import parts
import scenes
from scipy.spatial import KDTree

from edgel import Cloud, synth
from edgel.synth import Solid, make_solid

PLANAR = ("stepped_block", "cube_fractal", "wedge_fan", "frustum", "bracket", "plate", "chamfered_block")
ROUND = ("flange", "tee", "elbow", "gear")
ROWS = ("view to view", "part to view", "clutter", "crops", "planar", "round", "refinement")
"""Kinds of pairs; those of planar and round parts, and those to be refined, are views."""
MIN_OVERLAP = {"part to view": 0.15, "clutter": 0.25}
"""Least share of the source's points that the target shows too, else .3: less is no question of matching."""
MOST_POINTS = 12_000
"""Of a cloud: spacings follow from it, as a scanner's do from its distance."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two clouds, and where the first lies in the second.

    Attributes
    ----------
    source, target : Cloud
    pose : (4, 4) float64
        True T_target_source.
    group : (G, 4, 4) float64
        Moves of the source's frame that leave its part as it is.
    middle : (3,) float64
        Of the part, in the source's frame.
    spacing : float
        Of the coarser cloud.
    """

    part: str
    source: Cloud
    target: Cloud
    pose: np.ndarray
    group: np.ndarray
    middle: np.ndarray
    spacing: float


def errors(pair: Pair, found: np.ndarray) -> tuple[float, float]:
    """Degrees and spacings by which a pose is off, up to the part's symmetry; the smallest by their larger share."""
    best = (np.inf, np.inf)
    for move in pair.group:
        true = pair.pose @ move
        rotation = found[:3, :3].T @ true[:3, :3]
        degrees = float(np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))))
        off = (found - true) @ np.append(pair.middle, 1)
        best = min(best, (degrees, float(np.linalg.norm(off[:3])) / pair.spacing), key=max)
    return best


def turn_about(axis: Any, angle: float, point: Any = (0, 0, 0)) -> np.ndarray:
    """Turn about an axis through a point (4, 4), against the right hand."""
    axis, point = np.asarray(axis, float) / np.linalg.norm(axis), np.asarray(point, float)
    across = np.cross(np.eye(3), -axis)
    pose = np.eye(4)
    pose[:3, :3] = np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * across @ across
    pose[:3, 3] = point - pose[:3, :3] @ point
    return pose


_TOOTH = 2 * np.pi / 16 * 0.725  # where the middle of a tooth is
SYMMETRIES: dict[str, list[tuple[Any, int]]] = {
    "cube_fractal": [((0, 0, 1), 4), ((1, 0, 0), 4)],
    "frustum": [((0, 0, 1), 6)],
    "flange": [((0, 0, 1), 8)],
    "tee": [((0, 1, 0), 2)],
    "elbow": [((1, 1, 0), 2)],
    "gear": [((0, 0, 1), 16), ((np.cos(_TOOTH), np.sin(_TOOTH), 0), 2)],
}
"""Generators of each part's proper symmetries (axis through its middle, or through the origin where told; order)."""


def symmetry(name: str, solid: Solid) -> np.ndarray:
    """Return the part's group (G, 4, 4)."""
    middle = (solid.vertices.min(axis=0) + solid.vertices.max(axis=0)) / 2
    point = np.zeros(3) if name == "elbow" else middle
    moves = [np.eye(4)]
    steps = [turn_about(a, 2 * np.pi / n, point) for a, n in SYMMETRIES.get(name, [])]
    for move in moves:  # it grows while it is read, until the group is closed
        for step in steps:
            new = step @ move
            if all(np.abs(new - old).max() > 1e-6 for old in moves):
                moves.append(new)
    return np.array(moves)


@cache
def solid_of(name: str) -> Solid:
    if name == "plate":
        import curves

        return parts.tessellate(name, curves.plate(), 0.8)
    return scenes.solid(name)


def overlap(source: Cloud, target: Cloud, pose: np.ndarray, h: float) -> float:
    """Share of the source's points that lie by the target's within 2 spacings, at the true pose."""
    a, b = (cloud.xyz[np.isfinite(cloud.xyz).all(axis=1)] for cloud in (source, target))
    return float((KDTree(b).query(a[::5] @ pose[:3, :3].T + pose[:3, 3])[0] < 2 * h).mean())


def direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def random_pose(rng: np.random.Generator, shift: float) -> np.ndarray:
    pose = turn_about(direction(rng), rng.uniform(0, np.pi))
    pose[:3, 3] = shift * rng.standard_normal(3)
    return pose


def spacing_of(solid: Solid, points: int = MOST_POINTS) -> float:
    """Spacing at which half of a part has so many points."""
    return float(np.sqrt(0.5 * solid.area / points))


def make(row: str, noise: float, number: int, *, held: int = 0) -> Pair:
    """Make a pair; `held` above 0 gives others of the same kinds."""
    rng = np.random.default_rng([ROWS.index(row), round(100 * noise), number, held])
    names = {"planar": PLANAR, "round": ROUND}.get(row, PLANAR + ROUND)
    name = names[number % len(names)]
    solid = solid_of(name)
    group = symmetry(name, solid)
    h = spacing_of(solid)
    maker = {"part to view": _part_to_view, "clutter": _clutter, "crops": _crops}.get(row, _view_to_view)
    while True:
        source, target, pose, frame = maker(name, h, noise, rng)
        if overlap(source, target, pose, h) >= MIN_OVERLAP.get(row, 0.3):
            break
    inverse = np.linalg.inv(frame)
    middle = (frame @ np.append((solid.vertices.min(axis=0) + solid.vertices.max(axis=0)) / 2, 1))[:3]
    return Pair(name, source, target, pose, frame @ group @ inverse, middle, h)


def _view(
    solid: Solid, h: float, noise: float, along: np.ndarray, rng: np.random.Generator, outliers: float = 0.0
) -> Any:
    seed = int(rng.integers(2**31))
    roll = float(rng.uniform(-np.pi, np.pi))
    return synth.view(
        solid, projection="pinhole", spacing=h, noise=noise, direction=along, roll=roll, seed=seed, outliers=outliers
    )


def _view_to_view(
    name: str, h: float, noise: float, rng: np.random.Generator
) -> tuple[Cloud, Cloud, np.ndarray, np.ndarray]:
    """Two views 25 to 70 degrees apart."""
    solid = solid_of(name)
    first = direction(rng)
    across = np.cross(first, direction(rng))
    second = turn_about(across, np.radians(rng.uniform(25, 70)))[:3, :3] @ first
    a, b = _view(solid, h, noise, first, rng), _view(solid, h, noise, second, rng)
    return a.cloud, b.cloud, b.pose @ np.linalg.inv(a.pose), a.pose


def _part_to_view(
    name: str, h: float, noise: float, rng: np.random.Generator
) -> tuple[Cloud, Cloud, np.ndarray, np.ndarray]:
    """The whole part, sampled without noise and with its normals as from its mesh, to a view."""
    solid = solid_of(name)
    part = synth.sample(solid, pattern="blue_noise", spacing=h, seed=int(rng.integers(2**31)))
    b = _view(solid, h, noise, direction(rng), rng)
    frame = random_pose(rng, solid.size)
    cloud = Cloud(part.cloud.xyz @ frame[:3, :3].T + frame[:3, 3])
    return cloud, b.cloud, b.pose @ np.linalg.inv(frame), frame


def _crops(name: str, h: float, noise: float, rng: np.random.Generator) -> tuple[Cloud, Cloud, np.ndarray, np.ndarray]:
    """Two samples of the whole part, of each of which a plane cuts off a third; no sensor is known."""
    solid = solid_of(name)
    clouds, frames = [], []
    for _ in range(2):
        xyz = synth.sample(solid, pattern="blue_noise", spacing=h, noise=noise, seed=int(rng.integers(2**31))).cloud.xyz
        along = xyz @ direction(rng)
        xyz = xyz[along > np.quantile(along, 0.33)]
        frames.append(random_pose(rng, solid.size))
        clouds.append(Cloud(xyz @ frames[-1][:3, :3].T + frames[-1][:3, 3]))
    return clouds[0], clouds[1], frames[1] @ np.linalg.inv(frames[0]), frames[0]


def _clutter(
    name: str, h: float, noise: float, rng: np.random.Generator
) -> tuple[Cloud, Cloud, np.ndarray, np.ndarray]:
    """A view of the part, to one of it on a table among three others, with 1 % outliers."""
    solid = solid_of(name)
    others = [solid_of(n) for n in rng.choice([n for n in PLANAR + ROUND if n != name], 3, replace=False)]
    pitch = 0.9 * solid.size
    corners, faces, normals, placed = [], [], [], []
    for k, one in enumerate([solid, *others]):
        pose = turn_about(direction(rng), rng.uniform(0, np.pi))
        scale = 1.0 if k == 0 else solid.size / one.size
        local = scale * one.corners @ pose[:3, :3].T
        low, high = local.min(axis=(0, 1)), local.max(axis=(0, 1))
        spot = np.array([(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)][k]) * pitch
        shift = np.append(spot - (low + high)[:2] / 2, 0.02 * solid.size - low[2])
        corners.append(local + shift)
        normals.append(one.normals @ pose[:3, :3].T)
        faces.append(one.face + 10_000 * k)
        pose[:3, 3] = shift
        placed.append(pose)
    side = 1.9 * pitch
    table = side * (np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]) - [0.5, 0.5, 0])
    corners.append(table)
    normals.append(np.broadcast_to([0.0, 0.0, 1.0], table.shape))
    faces.append(np.full(2, 10_000 * len(corners)))
    scene = make_solid("clutter", np.concatenate(corners), np.concatenate(faces), np.concatenate(normals), spacing=h)
    down = direction(rng)
    down[2] = -abs(down[2]) - 0.7
    b = _view(scene, h, noise, down, rng, outliers=0.01)
    # A view of the part from nearby, as someone would take to find it: 25 to 60 degrees off.
    tilt = turn_about(np.cross(down, direction(rng)), np.radians(rng.uniform(25, 60)))[:3, :3]
    a = _view(solid, h, noise, placed[0][:3, :3].T @ (tilt @ (down / np.linalg.norm(down))), rng)
    return a.cloud, b.cloud, b.pose @ placed[0] @ np.linalg.inv(a.pose), a.pose
