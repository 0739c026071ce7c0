"""The whole surface of a solid as points, in the patterns that scanners and meshes make."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel
from edgel.cloud import Cloud
from edgel.edges import EdgeKind
from edgel.synth.solid import Solid
from edgel.synth.truth import CREASE_REACH, CREASE_TURN, STEP, Scene, near_edges, sample_curves
from edgel.synth.view import check_options, surface_normals

PATTERNS = ("uniform", "blue_noise", "scan_lines", "graded", "vertices")
_SWEEP = np.array([0.81, 0.47, 0.35])  # normal of the scan lines' planes: oblique, so that every face has lines
_ANISOTROPY = 10.0
_GRADE = 4.0
_TRIES = 10  # darts for each point wanted
_DISC = 0.752  # spacings between the centres of discs: then `_TRIES` darts leave one point for each spacing^2


def sample(
    solid: Solid,
    *,
    pattern: str = "uniform",
    spacing: float,
    noise: float = 0.0,
    outliers: float = 0.0,
    seed: int = 0,
) -> Scene:
    """Sample the whole surface of a solid, an unorganized cloud in the solid's frame.

    Parameters
    ----------
    solid : Solid
    pattern : {"uniform", "blue_noise", "scan_lines", "graded", "vertices"}
        Independent uniform points; points that keep a distance of 0.75 spacings (Poisson disc); lines whose mean
        distance on the surface is 10 times the step along them, with one shot in regular steps; independent points
        whose density falls to a quarter along the longest axis; or, as a mesher sets its vertices, points in steps of
        a spacing exactly on all creases and boundaries, and a Poisson disc between them.
    spacing : float
        Root of the surface's area over the number of points, mm.
    noise : float
        Standard deviation of the error, isotropic (each coordinate), in spacings.
    outliers : float
        Share of the points that are replaced by random ones in the bounding box, enlarged by a tenth of its diagonal
        on each side; 0 to 1.
    seed : int

    Raises
    ------
    ValueError
        If an option is out of its range.

    Examples
    --------
    >>> from edgel import synth
    >>> solid = synth.frustum()
    >>> scene = synth.sample(solid, pattern="blue_noise", spacing=1.0)
    >>> round(len(scene.cloud) / solid.area, 1), scene.cloud.is_organized
    (1.0, False)
    """
    check_options(spacing, noise, outliers)
    if pattern not in PATTERNS:
        raise ValueError(f"pattern: expected one of {PATTERNS}, got {pattern!r}")
    rng = np.random.default_rng(seed)
    triangle, weights = _PATTERNS[pattern](solid, spacing, rng)
    places = np.einsum("ij,ijk->ik", weights, solid.corners[triangle])
    normals = surface_normals(solid, triangle, weights)
    edges = sample_curves(solid.edges, STEP * spacing)
    crease = edges.take((edges.kind == EdgeKind.CREASE) & (np.nan_to_num(edges.dihedral) >= CREASE_TURN))
    boundary = edges.take(edges.kind == EdgeKind.BOUNDARY)
    kind = np.zeros(len(places), np.uint8)
    kind[near_edges(places, crease, CREASE_REACH * spacing)] |= int(EdgeKind.CREASE)
    kind[near_edges(places, boundary, CREASE_REACH * spacing)] |= int(EdgeKind.BOUNDARY)
    xyz = places + noise * spacing * rng.standard_normal(places.shape)
    outlier = np.zeros(len(places), bool)
    outlier[rng.choice(len(places), round(outliers * len(places)), replace=False)] = True
    low, high = solid.vertices.min(axis=0) - 0.1 * solid.size, solid.vertices.max(axis=0) + 0.1 * solid.size
    xyz[outlier] = rng.uniform(low, high, (np.count_nonzero(outlier), 3))
    return Scene(
        name=f"{solid.name}/{pattern}/n{noise:g}/o{100 * outliers:g}",
        cloud=Cloud(xyz),
        spacing=float(spacing),
        edges=edges,
        point_kind=np.where(outlier, 0, kind).astype(np.uint8),
        normals=np.where(outlier[:, None], np.nan, normals),
        noise_free=np.where(outlier[:, None], xyz, places),
        outlier=outlier,
        depth=None,
        pose=np.eye(4),
    )


def _uniform(solid: Solid, spacing: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Independent points, uniform over the area: triangles (N,) and weights (N, 3)."""
    return _scatter(solid, round(solid.area / spacing**2), rng)


def _scatter(solid: Solid, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    total = np.cumsum(solid.areas)
    triangle = np.searchsorted(total, rng.random(count) * total[-1], side="right").clip(max=len(total) - 1)
    root, other = np.sqrt(rng.random(count)), rng.random(count)
    return triangle, np.stack([1 - root, root * (1 - other), root * other], axis=1)


def _blue_noise(solid: Solid, spacing: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Throw darts; keep those that land farther than a disc from all kept before."""
    triangle, weights = _scatter(solid, round(_TRIES * solid.area / spacing**2), rng)
    places = np.einsum("ij,ijk->ik", weights, solid.corners[triangle])
    keep = poisson_disc(places, _DISC * spacing)
    return triangle[keep], weights[keep]


def poisson_disc(places: np.ndarray, radius: float) -> np.ndarray:
    """Tell which places (N, 3), taken in turn, are no nearer than the radius to any kept before; (N,) bool.

    Cook 1986, doi:10.1145/7529.8927.
    """
    cells = np.floor((places - places.min(axis=0)) / radius).astype(np.int64) + 1
    keep = np.zeros(len(places), bool)
    _throw(places, cells, cells.max(axis=0) + 2, radius, keep)
    return keep


def _vertices(solid: Solid, spacing: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A Poisson disc whose first darts are set along the creases and boundaries."""
    on_edges = sample_curves(solid.edges, spacing).positions
    triangle, weights = _scatter(solid, round(_TRIES * solid.area / spacing**2), rng)
    places = np.einsum("ij,ijk->ik", weights, solid.corners[triangle])
    edge_triangle, edge_weights = _on_surface(solid, on_edges)
    triangle, weights = np.concatenate([edge_triangle, triangle]), np.concatenate([edge_weights, weights])
    places = np.concatenate([on_edges, places])
    keep = poisson_disc(places, _DISC * spacing)
    return triangle[keep], weights[keep]


def _on_surface(solid: Solid, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (N,) that hold places (N, 3) on the surface, and the weights (N, 3) of their corners there."""
    triangle, weights = np.zeros(len(places), np.int64), np.zeros((len(places), 3))
    slack = 1e-6 * solid.size
    low, high = solid.corners.min(axis=1) - slack, solid.corners.max(axis=1) + slack
    for i, place in enumerate(places):
        near = np.flatnonzero(((low <= place) & (place <= high)).all(axis=1))
        a, b, c = np.moveaxis(solid.corners[near], 1, 0)
        u, v, w = b - a, c - a, place - a
        uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
        wu, wv = (w * u).sum(1), (w * v).sum(1)
        area = np.maximum(uu * vv - uv * uv, 1e-30)
        s, t = (vv * wu - uv * wv) / area, (uu * wv - uv * wu) / area
        inside = np.clip(np.stack([1 - s - t, s, t], axis=1), 0, None)
        inside /= inside.sum(axis=1, keepdims=True)
        off = ((inside[:, :, None] * solid.corners[near]).sum(axis=1) - place) ** 2
        best = int(off.sum(axis=1).argmin())
        triangle[i], weights[i] = near[best], inside[best]
    return triangle, weights


def _graded(solid: Solid, spacing: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Independent points whose density falls geometrically to a quarter along the longest axis."""
    wanted = round(solid.area / spacing**2)
    axis = int(np.argmax(np.ptp(solid.vertices, axis=0)))
    along = solid.vertices[:, axis]
    triangle, weights = _scatter(solid, round(6 * wanted), rng)
    place = np.einsum("ij,ij->i", weights, solid.corners[triangle][..., axis])
    share = _GRADE ** (-(place - along.min()) / np.ptp(along))
    kept = np.flatnonzero(rng.random(len(place)) < share)[:wanted]
    return triangle[kept], weights[kept]


def _scan_lines(solid: Solid, spacing: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Cut the surface with parallel planes and shoot at equal steps along each cut."""
    normal = _SWEEP / np.linalg.norm(_SWEEP)
    step = spacing / np.sqrt(_ANISOTROPY)
    facing = np.linalg.norm(np.cross(solid.normals.mean(axis=1), normal), axis=1)
    gap = spacing * np.sqrt(_ANISOTROPY) * np.average(facing, weights=solid.areas)
    height = solid.corners @ normal
    first = np.ceil((height.min(axis=1) - height.min()) / gap - 0.5).astype(np.int64)
    last = np.floor((height.max(axis=1) - height.min()) / gap - 0.5).astype(np.int64)
    crossed = np.maximum(last - first + 1, 0)
    triangle = np.repeat(np.arange(len(height)), crossed)
    line = np.arange(len(triangle)) - np.repeat(np.cumsum(crossed) - crossed, crossed) + first[triangle]
    ends = _cut(height[triangle], height.min() + (line + 0.5) * gap)
    where = np.einsum("iej,ijk->iek", ends, solid.corners[triangle])
    order = _along_lines(where.mean(axis=1), line, solid.face[triangle], normal)
    triangle, ends, where = triangle[order], ends[order], where[order]
    reach = np.cumsum(np.linalg.norm(where[:, 1] - where[:, 0], axis=1))
    shots = (np.arange(int(reach[-1] / step)) + rng.random()) * step
    segment = np.searchsorted(reach, shots, side="right").clip(max=len(reach) - 1)
    start = reach[segment] - np.linalg.norm(where[segment, 1] - where[segment, 0], axis=1)
    part = ((shots - start) / (reach[segment] - start))[:, None]
    return triangle[segment], (1 - part) * ends[segment, 0] + part * ends[segment, 1]


def _cut(height: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (M, 2, 3) of both ends of the cut of triangles with corner heights (M, 3) at levels."""
    order = np.argsort(height, axis=1)
    low, middle, high = np.take_along_axis(height, order, axis=1).T
    rows = np.arange(len(height))
    ends = np.zeros((len(height), 2, 3))
    long = (level - low) / np.where(high > low, high - low, 1)
    ends[rows, 0, order[:, 0]], ends[rows, 0, order[:, 2]] = 1 - long, long
    below = level < middle
    from_, to = np.where(below, order[:, 0], order[:, 1]), np.where(below, order[:, 1], order[:, 2])
    base, tip = np.where(below, low, middle), np.where(below, middle, high)
    short = (level - base) / np.where(tip > base, tip - base, 1)
    ends[rows, 1, from_], ends[rows, 1, to] = 1 - short, short
    # All cuts run the same way round their triangle, so that steps continue from one to the next.
    flip = ((order[:, 0] + 1) % 3 == order[:, 1]) ^ below
    ends[flip] = ends[flip][:, ::-1]
    return ends


def _along_lines(places: np.ndarray, line: np.ndarray, face: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Order the segments line by line, on each face in the order of the angle about the line's middle."""
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    flat = np.stack([places @ u, places @ np.cross(normal, u)], axis=1)
    _, group = np.unique(line, return_inverse=True)
    middle = np.stack([np.bincount(group, column) for column in flat.T], axis=1) / np.bincount(group)[:, None]
    around = flat - middle[group]
    return np.lexsort((np.arctan2(around[:, 1], around[:, 0]), face, line))


@kernel
def _throw(places, cells, shape, radius, keep):
    """Keep each place in turn unless one kept before is nearer than the radius; cells are as wide as it."""
    first = np.full(shape[0] * shape[1] * shape[2], -1, np.int32)
    following = np.full(len(places), -1, np.int32)
    for p in range(len(places)):
        free = True
        for i in range(cells[p, 0] - 1, cells[p, 0] + 2):
            for j in range(cells[p, 1] - 1, cells[p, 1] + 2):
                for k in range(cells[p, 2] - 1, cells[p, 2] + 2):
                    q = first[(i * shape[1] + j) * shape[2] + k]
                    while q >= 0 and free:
                        dx = places[p, 0] - places[q, 0]
                        dy = places[p, 1] - places[q, 1]
                        dz = places[p, 2] - places[q, 2]
                        free = dx * dx + dy * dy + dz * dz >= radius * radius
                        q = following[q]
        if free:
            keep[p] = True
            cell = (cells[p, 0] * shape[1] + cells[p, 1]) * shape[2] + cells[p, 2]
            following[p], first[cell] = first[cell], p


_PATTERNS = {
    "uniform": _uniform,
    "blue_noise": _blue_noise,
    "scan_lines": _scan_lines,
    "graded": _graded,
    "vertices": _vertices,
}
