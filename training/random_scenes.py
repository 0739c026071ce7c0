"""Random scenes of solids to train on, and which of their points are edge points. None is a scene of the benchmark."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from random_solids import log_uniform, solid

from edgel import metrics, synth
from edgel.edges import EdgeKind
from edgel.synth import Scene

OUTLINE = int(EdgeKind.BOUNDARY | EdgeKind.OCCLUDING | EdgeKind.OCCLUDED)
MIN_TURN = np.radians(25.0)  # a crease that turns less is neither learned nor unlearned
OWN = 1.5  # spacings within which a point can be a stretch of an edge's own
VIEWS = 0.35  # share of the scenes that are seen from one place
IN_STEPS = 0.4  # share of the views that are those of a depth camera


@dataclass(frozen=True, eq=False)
class Example:
    """A cloud to learn from.

    Attributes
    ----------
    xyz : (N, 3) float64
    labels : (N, 2) bool
        Which points lie on a crease, and where the surface ends.
    counts : (N,) bool
        Which points are learned from.
    spacing : float
    """

    xyz: np.ndarray
    labels: np.ndarray
    counts: np.ndarray
    spacing: float


def make(rng: np.random.Generator) -> Example:
    """Make the example of a solid's scene."""
    made = scene(rng)
    true, counts = labels(made)
    return Example(made.cloud.xyz[np.isfinite(made.cloud.xyz).all(axis=1)], true, counts, made.spacing)


def scene(rng: np.random.Generator) -> Scene:
    """Make a scene of a solid."""
    body = solid(rng)
    points = np.exp(rng.uniform(np.log(3000), np.log(15000)))
    noise = [0.0, rng.uniform(0, 0.15), rng.uniform(0.15, 0.5), rng.uniform(0.5, 1.1)][
        rng.choice(4, p=[0.3, 0.2, 0.3, 0.2])
    ]
    degraded = {
        "noise": noise,
        "outliers": [0.0, 0.01, 0.05][rng.choice(3, p=[0.75, 0.15, 0.1])],
        "seed": int(rng.integers(2**31)),
    }
    if rng.random() < VIEWS:
        direction = rng.standard_normal(3)
        projection = synth.PROJECTIONS[rng.integers(3)]
        spacing = np.sqrt(body.area / 2.2 / points)
        seen = synth.view(
            body, projection=projection, spacing=spacing, direction=direction, roll=rng.uniform(-3, 3), **degraded
        )
        return in_steps(seen, projection, rng) if rng.random() < IN_STEPS else seen
    pattern = rng.choice(synth.PATTERNS, p=[0.17, 0.17, 0.14, 0.14, 0.38])
    return synth.sample(body, pattern=str(pattern), spacing=np.sqrt(body.area / points), **degraded)


def in_steps(scene: Scene, projection: str, rng: np.random.Generator) -> Scene:
    """See a scene as depth cameras do: errors alike in neighbouring pixels, and depths rounded to whole steps.

    A slanted face becomes a staircase whose stairs have ragged rims.
    """
    xyz = scene.noise_free
    depth = np.linalg.norm(xyz, axis=1) if projection == "spherical" else xyz[:, 2]
    step, error = scene.spacing * log_uniform(rng, 0.2, 3, 2)
    field = rng.standard_normal(scene.cloud.shape)
    for _ in range(rng.integers(1, 7)):  # patches of a few pixels
        for axis in (0, 1):
            field = (np.roll(field, -1, axis) + 2 * field + np.roll(field, 1, axis)) / 4
    error *= rng.uniform(0, 0.5) / field.std()
    measured = np.where(scene.outlier, depth, step * np.round((depth + error * field.ravel()) / step))
    if projection == "orthographic":
        moved = np.column_stack([xyz[:, :2], measured])
    else:
        moved = xyz * (measured / depth)[:, None]
    return replace(scene, cloud=replace(scene.cloud, xyz=moved))


def labels(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Which finite points are edge points, (M, 2) bool for crease and outline, and which count, (M,) bool.

    A crease point is one whose cell among all points (by where they lie without noise) the crease runs through: it is
    nearest to some stretch of it. So edges are one point thick and without gaps, whatever the pattern.
    """
    rows = np.flatnonzero(np.isfinite(scene.cloud.xyz).all(axis=1))
    true, counts = np.zeros((len(rows), 2), bool), np.ones(len(rows), bool)
    places = scene.noise_free[rows]
    inlier = ~scene.outlier[rows]
    organized = scene.cloud.is_organized
    here = np.flatnonzero(inlier)
    for column, kind in enumerate([EdgeKind.CREASE] if organized else [EdgeKind.CREASE, EdgeKind.BOUNDARY]):
        edges = scene.edges.take((scene.edges.kind & int(kind)) > 0)
        strong = np.nan_to_num(edges.dihedral, nan=np.pi) >= MIN_TURN
        if strong.any():
            near = metrics.nearest(edges.positions[strong], places[here])
            own = near.distances[:, 0] <= OWN * scene.spacing
            true[here[near.points[own, 0]], column] = True
        if not strong.all():
            counts &= metrics.nearest(places, edges.positions[~strong]).distances[:, 0] >= OWN * scene.spacing
    counts |= true.any(axis=1)
    if organized:
        true[:, 1] = (scene.point_kind[rows] & OUTLINE) > 0
    true[~inlier] = False
    return true, counts
