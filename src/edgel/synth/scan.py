"""A structured-light scanner that looks down on a part: an unorganized list of points, row by row."""

from __future__ import annotations

import numpy as np

from edgel.cloud import Cloud
from edgel.edges import EdgeKind
from edgel.synth.jumps import Rays, grid_kinds
from edgel.synth.rays import RayHits, RayTree, build_ray_tree, cast
from edgel.synth.solid import Solid
from edgel.synth.truth import CREASE_REACH, CREASE_TURN, STEP, Scene, TrueEdges, join, near_edges, sample_curves
from edgel.synth.view import outline_edges, shows, surface_normals

_SURPLUS = 1.01  # rays that hit, for each point wanted; the rest are the scanner's dropouts
_JITTER = 0.1  # greatest shift of a ray from its place in the grid, in pitches
_DOWN = np.array([0.0, 0.0, -1.0])


def scan(
    solid: Solid, *, num_points: int | None = None, pitch: float | None = None, noise: float = 0.02, seed: int = 0
) -> Scene:
    """Scan a solid from above: parallel rays along -Z on a square grid, each shifted by up to a tenth of the pitch.

    The cloud is unorganized, in the solid's frame, row by row: y ascending, within a row x ascending. The viewer is
    infinitely far up +Z. Its truth is that of the orthographic `view` from there; `Scene.spacing` is the pitch.

    Parameters
    ----------
    solid : Solid
    num_points : int, optional
        Exact number of points: surplus ones drop out at random. By default every ray that hits gives one.
    pitch : float, optional
        Distance between neighbouring rays, mm. By default what gives 1 % more hits than points wanted, or without such
        a number the spacing that the solid is meant for.
    noise : float
        Standard deviation of the Gaussian noise added to z, mm.
    seed : int
        Same seed, same bytes.

    Raises
    ------
    ValueError
        If a number is out of range, or with this pitch fewer rays hit than points are wanted.

    Examples
    --------
    >>> from edgel import synth
    >>> scene = synth.scan(synth.elbow(), num_points=1000, noise=0.0)
    >>> scene.cloud, round(scene.spacing, 2)
    (Cloud(1,000 points, unorganized; attributes: none), 5.2)
    """
    if num_points is not None and num_points < 1:
        raise ValueError(f"num_points: expected 1 or more, got {num_points}")
    if pitch is not None and not (np.isfinite(pitch) and pitch > 0):
        raise ValueError(f"pitch: expected a length above 0, got {pitch}")
    if not (np.isfinite(noise) and noise >= 0):
        raise ValueError(f"noise: expected a length of 0 or more, got {noise}")
    rng = np.random.default_rng(seed)
    tree = build_ray_tree(solid)
    wanted = num_points or 1
    step = pitch or (float(np.sqrt(_seen_area(tree) / (wanted * _SURPLUS))) if num_points else solid.spacing)
    rays, hits = _look_down(tree, step, rng)
    while pitch is None and np.count_nonzero(hits.triangle >= 0) < wanted:
        step *= 0.99
        rays, hits = _look_down(tree, step, rng)
    rows = np.flatnonzero(hits.triangle >= 0)
    if len(rows) < wanted:
        raise ValueError(f"pitch: {pitch} gives {len(rows)} hits of the {wanted} wanted; make it smaller")
    if num_points:
        rows = rows[np.sort(rng.choice(len(rows), num_points, replace=False, shuffle=False))]
    depth = hits.distance.reshape(rays.origins.shape[:2])
    normals = surface_normals(solid, hits.triangle, hits.weights)
    kind = grid_kinds(tree, rays, depth, normals.reshape(rays.origins.shape), step).ravel()[rows]
    noise_free, normals = rays.at(depth).reshape(-1, 3)[rows], normals[rows]
    creases = _seen_creases(solid, tree, step)
    strong = creases.take(creases.dihedral >= CREASE_TURN)
    outline = outline_edges(noise_free, kind, normals)
    kind[near_edges(noise_free, strong, CREASE_REACH * step)] |= int(EdgeKind.CREASE)
    xyz = noise_free.copy()
    xyz[:, 2] += rng.normal(0.0, noise, len(xyz))
    return Scene(
        name=f"{solid.name}/scan",
        cloud=Cloud(xyz),
        spacing=step,
        edges=join([creases, outline]),
        point_kind=kind,
        normals=normals,
        noise_free=noise_free,
        outlier=np.zeros(len(xyz), bool),
        depth=None,
        pose=np.eye(4),
    )


def _look_down(tree: RayTree, pitch: float, rng: np.random.Generator) -> tuple[Rays, RayHits]:
    """Cast one jittered grid of rays, y ascending by rows, x by columns."""
    low, high = tree.bounds
    columns, rows = np.ceil((high - low)[:2] / pitch).astype(int) + 2
    # The grid begins anywhere within a cell, so that it is never aligned with the part by chance.
    first_x, first_y = low[:2] - pitch * (0.5 + rng.random(2))
    dx, dy = rng.uniform(-_JITTER * pitch, _JITTER * pitch, (2, rows, columns))
    x = first_x + pitch * np.arange(columns) + dx
    y = first_y + pitch * np.arange(rows)[:, None] + dy
    return _cast_down(tree, x, y)


def _cast_down(tree: RayTree, x: np.ndarray, y: np.ndarray) -> tuple[Rays, RayHits]:
    """Cast rays along -Z at x, y (H, W), from above all there is."""
    origins = np.stack([x, y, np.full_like(x, _above(tree))], axis=-1)
    rays = Rays(origins, np.broadcast_to(_DOWN, origins.shape))
    return rays, cast(tree, origins.reshape(-1, 3), rays.directions.reshape(-1, 3))


def _above(tree: RayTree) -> float:
    """A height above the solid, by as much as it is high."""
    low, high = tree.bounds
    return float(2 * high[2] - low[2] + 1)


def _seen_area(tree: RayTree, cells: int = 400) -> float:
    """Area of the solid seen from above, mm^2, by counting the cells of a regular grid."""
    low, high = tree.bounds[:, :2]
    step = (high - low) / cells
    centres = np.arange(cells) + 0.5
    x, y = np.meshgrid(low[0] + step[0] * centres, low[1] + step[1] * centres)
    return float((_cast_down(tree, x, y)[1].triangle >= 0).mean() * np.prod(high - low))


def _seen_creases(solid: Solid, tree: RayTree, pitch: float) -> TrueEdges:
    creases = sample_curves(solid.creases, STEP * pitch)
    eyes = np.column_stack([creases.positions[:, :2], np.full(len(creases), _above(tree))])
    return creases.take(shows(creases, eyes, solid, tree, pitch))
