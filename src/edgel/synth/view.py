"""What a sensor sees of a solid from one place, and which of its edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from edgel.cloud import Cloud, as_vector
from edgel.edges import EdgeKind
from edgel.synth.jumps import Rays, grid_kinds
from edgel.synth.rays import RayHits, RayTree, build_ray_tree, cast
from edgel.synth.solid import Solid
from edgel.synth.truth import (
    CREASE_REACH,
    CREASE_TURN,
    STEP,
    Scene,
    TrueEdges,
    join,
    near_edges,
    point_edges,
    sample_curves,
)

PROJECTIONS = ("orthographic", "pinhole", "spherical")
_AWAY = {"orthographic": 10.0, "pinhole": 2.5, "spherical": 2.0}  # of the solid's size, from its centre to the sensor
_RING = np.sqrt(2.0)  # a spinning LiDAR's rings lie twice as far apart as its shots along them
_SEEN = 0.25  # spacings in front of a crease that do not hide it
_GRAZING = 0.05  # least cosine to the line of sight at which a face shows (87 degrees)


def view(
    solid: Solid,
    *,
    projection: str = "orthographic",
    spacing: float,
    noise: float = 0.0,
    outliers: float = 0.0,
    seed: int = 0,
    direction: Sequence[float] = (-0.48, 0.66, -0.58),
    roll: float = 0.2,
) -> Scene:
    """See a solid from one place.

    The cloud is organized and in the sensor's frame: x right, y down, z forward, the sensor at the origin, which is the
    viewpoint (of the orthographic view, whose rays are parallel to z, the middle of the plane they start from).
    The spherical view is that of a spinning LiDAR: equal steps of azimuth about the y axis, rings of equal steps of
    elevation twice as large, so that its points are twice as dense along the rings as across.

    Of two neighbours in the grid (of 4) the near one is OCCLUDING and the far one OCCLUDED when their step in depth
    exceeds what the steeper of both tangent planes explains by more than 2 spacings, or is more than 2 spacings and the
    surface seen between them breaks off; a hit whose neighbour is a miss is BOUNDARY.

    A crease is seen where nothing is more than a quarter of a spacing in front of it and both its faces turn their
    outside (of an open surface: the same side) to the sensor by 3 degrees or more. An edge of which only one face is
    seen is an outline: its points are BOUNDARY or OCCLUDING.

    Parameters
    ----------
    solid : Solid
    projection : {"orthographic", "pinhole", "spherical"}
    spacing : float
        Root of the area per point, mm, wanted on average over what is seen.
    noise : float
        Standard deviation of the depth error, along the ray, in spacings.
    outliers : float
        Share of the hits that are given a random depth, 0 to 1.
    seed : int
        Of noise and outliers.
    direction : (3,)
        In which the sensor looks, in the solid's frame; oblique, so that three sides show.
    roll : float
        By how much the sensor is turned about its line of sight, radians: no edge should follow the pixels.

    Raises
    ------
    ValueError
        If an option is out of its range.

    Examples
    --------
    >>> from edgel import synth
    >>> scene = synth.view(synth.frustum(), projection="pinhole", spacing=1.0)
    >>> scene.cloud.is_organized, scene.cloud.viewpoint.tolist()
    (True, [0.0, 0.0, 0.0])
    """
    check_options(spacing, noise, outliers)
    if projection not in PROJECTIONS:
        raise ValueError(f"projection: expected one of {PROJECTIONS}, got {projection!r}")
    pose = _pose(solid, as_vector(direction, "direction"), roll, _AWAY[projection])
    tree = build_ray_tree(solid)
    rays, hits = _aim(solid, tree, pose, projection, spacing)
    shape = rays.directions.shape[:2]
    depth = hits.distance.reshape(shape)
    hit = np.isfinite(depth)
    normals = surface_normals(solid, hits.triangle, hits.weights)
    kind = grid_kinds(tree, rays, depth, normals.reshape(*shape, 3), spacing).ravel()
    normals = normals @ pose[:3, :3].T
    noise_free = _moved(rays.at(depth), pose)
    seen = _sensor_edges(solid, tree, pose, projection, spacing)
    rng = np.random.default_rng(seed)
    measured = np.where(hit, depth + noise * spacing * rng.standard_normal(shape), np.nan)
    outlier = np.zeros(shape, bool)
    rows = np.flatnonzero(hit)
    outlier.flat[rng.choice(rows, round(outliers * len(rows)), replace=False)] = True
    near, far = depth[hit].min(), depth[hit].max()
    margin = 0.1 * solid.size
    measured[outlier] = rng.uniform(near - margin, far + margin, np.count_nonzero(outlier))
    xyz = _moved(rays.at(measured), pose)
    outline = outline_edges(noise_free, kind, normals)
    flat_hit, flat_out = hit.ravel(), outlier.ravel()
    strong = seen.take(seen.dihedral >= CREASE_TURN)
    kind[rows[near_edges(noise_free[rows], strong, CREASE_REACH * spacing)]] |= int(EdgeKind.CREASE)
    return Scene(
        name=f"{solid.name}/{projection}/n{noise:g}/o{100 * outliers:g}",
        cloud=Cloud(xyz, shape=shape, viewpoint=np.zeros(3)),
        spacing=float(spacing),
        edges=join([seen, outline]),
        point_kind=np.where(flat_hit & ~flat_out, kind, 0).astype(np.uint8),
        normals=np.where(flat_out[:, None], np.nan, normals),
        noise_free=np.where(flat_out[:, None], xyz, noise_free),
        outlier=flat_out,
        depth=measured,
        pose=pose,
    )


def check_options(spacing: float, noise: float, outliers: float) -> None:
    """Check the options that views and samples share."""
    if not (np.isfinite(spacing) and spacing > 0):
        raise ValueError(f"spacing: expected a length above 0, got {spacing}")
    if not (np.isfinite(noise) and noise >= 0):
        raise ValueError(f"noise: expected 0 or more spacings, got {noise}")
    if not 0 <= outliers < 1:
        raise ValueError(f"outliers: expected a share of 0 or more and below 1, got {outliers}")


def surface_normals(solid: Solid, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """True unit normals (M, 3) at places given by triangle (M,) and weights (M, 3); NaN where the triangle is -1."""
    normals = np.einsum("ij,ijk->ik", weights, solid.normals[triangle])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _pose(solid: Solid, direction: np.ndarray, roll: float, away: float) -> np.ndarray:
    """From the solid's frame to that of a sensor that looks at the middle of its box."""
    if not np.linalg.norm(direction) > 0:
        raise ValueError("direction: expected a vector other than 0")
    forward = direction / np.linalg.norm(direction)
    up = np.eye(3)[2 if abs(forward[2]) < 0.99 else 1]
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    rotation = np.stack([c * right + s * down, c * down - s * right, forward])
    middle = (solid.vertices.min(axis=0) + solid.vertices.max(axis=0)) / 2
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = (0, 0, away * solid.size) - rotation @ middle
    return pose


def _moved(places: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Places (..., 3) of the solid's frame in the sensor's, (N, 3)."""
    return places.reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]


def _aim(solid: Solid, tree: RayTree, pose: np.ndarray, projection: str, spacing: float) -> tuple[Rays, RayHits]:
    """Choose the resolution that gives the wanted area per point, from a coarse look first; then look."""
    pitch = 3 * spacing
    rays, hits = _look(solid, tree, pose, projection, pitch)
    rows = np.flatnonzero(hits.triangle >= 0)
    if len(rows) == 0:
        raise ValueError(f"spacing: too coarse for a solid of {solid.size:.3g} mm, got {spacing}")
    normals = surface_normals(solid, hits.triangle[rows], hits.weights[rows])
    directions = rays.directions.reshape(-1, 3)[rows]
    places = rays.origins.reshape(-1, 3)[rows] + hits.distance[rows, None] * directions
    facing = np.abs((normals * directions).sum(axis=1)) / np.linalg.norm(directions, axis=1)
    across = _pixel_area(projection, pitch, _AWAY[projection] * solid.size, places @ pose[:3, :3].T + pose[:3, 3])
    # Area of a pixel on the surface. Grazing hits are rare and huge: a floor keeps few of them from deciding.
    pitch *= spacing / np.sqrt((across / np.maximum(facing, _GRAZING)).mean())
    return _look(solid, tree, pose, projection, pitch)


def _pixel_area(projection: str, pitch: float, away: float, places: np.ndarray) -> np.ndarray:
    """Area across the ray that a pixel has at places (M, 3) in the sensor's frame."""
    reach = np.linalg.norm(places, axis=1)
    if projection == "orthographic":
        return np.full(len(places), pitch**2)
    if projection == "pinhole":
        return (pitch / away) ** 2 * places[:, 2] ** 2 * (places[:, 2] / reach)
    return (pitch / away) ** 2 * reach**2 * np.hypot(places[:, 0], places[:, 2]) / reach


def _look(solid: Solid, tree: RayTree, pose: np.ndarray, projection: str, pitch: float) -> tuple[Rays, RayHits]:
    """Cast a grid of rays that covers the solid, `pitch` mm apart at the distance of its middle, a frame around."""
    away = _AWAY[projection] * solid.size
    seen = solid.vertices @ pose[:3, :3].T + pose[:3, 3]
    step = np.array([pitch, pitch])
    if projection == "orthographic":
        plane = seen[:, :2]
    elif projection == "pinhole":
        plane = away * seen[:, :2] / seen[:, 2:]
    else:
        plane = away * np.column_stack(
            [np.arctan2(seen[:, 0], seen[:, 2]), np.arctan2(seen[:, 1], np.hypot(seen[:, 0], seen[:, 2]))]
        )
        step = step * (1 / _RING, _RING)
    low, high = plane.min(axis=0), plane.max(axis=0)
    count = np.ceil((high - low) / step).astype(int) + 6
    # A third of a pixel off the middle: symmetric solids must not have their edges on the rays.
    columns, rows = ((low[i] + high[i]) / 2 + (np.arange(count[i]) - count[i] / 2 + 0.37) * step[i] for i in range(2))
    u, v = np.meshgrid(columns, rows)
    nothing = np.zeros_like(u)
    origins = np.stack([nothing, nothing, nothing], axis=-1)
    if projection == "orthographic":
        origins = np.stack([u, v, nothing], axis=-1)
        directions = np.stack([nothing, nothing, nothing + 1], axis=-1)
    elif projection == "pinhole":
        directions = np.stack([u / away, v / away, nothing + 1], axis=-1)
    else:
        azimuth, elevation = u / away, v / away
        level = np.cos(elevation)
        directions = np.stack([level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)], axis=-1)
    rays = Rays((origins - pose[:3, 3]) @ pose[:3, :3], directions @ pose[:3, :3])
    return rays, cast(tree, rays.origins.reshape(-1, 3), rays.directions.reshape(-1, 3))


def _sensor_edges(solid: Solid, tree: RayTree, pose: np.ndarray, projection: str, spacing: float) -> TrueEdges:
    """Sample the creases that show, in the sensor's frame."""
    rotation, shift = pose[:3, :3], pose[:3, 3]
    creases = sample_curves(solid.creases, STEP * spacing)
    moved = creases.positions @ rotation.T + shift
    from_ = moved * (1, 1, 0) if projection == "orthographic" else np.zeros_like(moved)
    creases = creases.take(shows(creases, (from_ - shift) @ rotation, solid, tree, spacing))
    return replace(
        creases,
        positions=creases.positions @ rotation.T + shift,
        tangents=creases.tangents @ rotation.T,
        normals=creases.normals @ rotation.T,
    )


def shows(creases: TrueEdges, eyes: np.ndarray, solid: Solid, tree: RayTree, spacing: float) -> np.ndarray:
    """Tell which places of creases show both their faces, unhidden, to eyes (T, 3), one for each; (T,) bool."""
    rays = creases.positions - eyes
    length = np.linalg.norm(rays, axis=1)
    sight = rays / length[:, None]
    facing = -np.einsum("ijk,ik->ij", creases.normals, sight)
    both = (facing > _GRAZING).all(axis=1)
    if solid.boundaries:
        both |= (facing < -_GRAZING).all(axis=1)
    return both & (cast(tree, eyes, sight).distance >= length - _SEEN * spacing)


def outline_edges(places: np.ndarray, kind: np.ndarray, normals: np.ndarray) -> TrueEdges:
    """Make edges of the places (N, 3) whose flags (N,) say that the depth breaks off there."""
    flags = (EdgeKind.BOUNDARY, EdgeKind.OCCLUDING, EdgeKind.OCCLUDED)
    return join([point_edges(places[(kind & flag) > 0], flag, normals[(kind & flag) > 0]) for flag in flags])
