"""Scene: a cloud of a solid together with everything that is true of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.cloud import Cloud
from edgel.edges import EdgeKind
from edgel.synth.edges import EdgeCurve
from edgel.synth.solid import is_convex, unit

STEP = 0.25
"""True curves are sampled at most this many spacings apart."""
CREASE_TURN = np.radians(25.0)
"""A point is labelled a crease point only where the surface turns by at least this, radians."""
CREASE_REACH = 0.5
"""And only within this many spacings of the crease; the same for boundaries of a surface sampled all around."""


@dataclass(frozen=True, eq=False)
class TrueEdges:
    """The edges of a scene, as positions closely along them.

    Attributes
    ----------
    positions : (T, 3) float64
        In the frame of the cloud. Along curves they are at most `STEP` spacings apart; boundaries and occlusions of a
        view are the noise-free places of the points that show them.
    kind : (T,) uint8
        One `EdgeKind` flag each; a point that is several has several positions.
    tangents : (T, 3) float64
        Unit direction of the edge; NaN where it is not known.
    normals : (T, 2, 3) float64
        Unit normals of the faces that meet; of the one face at boundaries and occlusions where it is known, NaN else.
    dihedral : (T,) float64
        By how much the surface turns at a crease, radians: 0 is smooth, pi / 2 the edge of a cube; NaN elsewhere.
    convex : (T,) int8
        1 where a crease is convex, -1 where it is concave, 0 elsewhere.
    """

    positions: np.ndarray
    kind: np.ndarray
    tangents: np.ndarray
    normals: np.ndarray
    dihedral: np.ndarray
    convex: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)

    def take(self, rows: np.ndarray) -> TrueEdges:
        """Return the given rows, (M,) int or (T,) bool."""
        return TrueEdges(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@dataclass(frozen=True, eq=False)
class Scene:
    """A cloud and the truth about it; made by `view`, `scan` and `sample`.

    Attributes
    ----------
    name : str
    cloud : Cloud
        With noise and outliers. A view's is organized, in the frame of the sensor (x right, y down, z forward), NaN
        where the ray met nothing, the viewpoint at the origin; others are unorganized, in the frame of the solid.
    spacing : float
        Root of the area a point stands for, mm: of the surface's area over the number of points, of a view the area it
        sees, of a scan that seen from above. The nominal value; what came out is within a few percent of it.
    edges : TrueEdges
        A crease is among them wherever it turns by more than `edgel.synth.solid.MIN_TURN`; in a view, where it is seen.
    point_kind : (N,) uint8
        `EdgeKind` flags of each point, 0 off all edges and for outliers. Crease: its noise-free place is within
        `CREASE_REACH` spacings of a crease that turns by `CREASE_TURN` or more. Boundary: the same distance from a
        boundary curve; in a view, a neighbour in the grid (of 4) is a miss. Occluding and occluded: see `view`.
    normals : (N, 3) float64
        True unit normals at the noise-free places; NaN for misses and outliers.
    noise_free : (N, 3) float64
        Where the points would be without noise; outliers are where they are.
    outlier : (N,) bool
        Which points are outliers.
    depth : (H, W) float64 or None
        Depth map of a view, noise and outliers in it: z (of the spherical view the range), NaN for misses.
    pose : (4, 4) float64
        From the solid's frame to the cloud's: ``x_cloud = pose[:3, :3] @ x_solid + pose[:3, 3]``.
    """

    name: str
    cloud: Cloud
    spacing: float
    edges: TrueEdges
    point_kind: np.ndarray
    normals: np.ndarray
    noise_free: np.ndarray
    outlier: np.ndarray
    depth: np.ndarray | None
    pose: np.ndarray


def sample_curves(curves: Sequence[EdgeCurve], step: float) -> TrueEdges:
    """Sample curves at most `step` apart, mm."""
    parts = [_sample_curve(curve, step) for curve in curves]
    return join(parts)


def join(parts: Sequence[TrueEdges]) -> TrueEdges:
    """Put the rows of several together; of none, an empty one."""
    empty = np.empty
    nothing = TrueEdges(empty((0, 3)), empty(0, np.uint8), empty((0, 3)), empty((0, 2, 3)), empty(0), empty(0, np.int8))
    columns = [[getattr(part, name) for part in (nothing, *parts)] for name in TrueEdges.__dataclass_fields__]
    return TrueEdges(*(np.concatenate(column) for column in columns))


def point_edges(positions: np.ndarray, kind: EdgeKind, normals: np.ndarray) -> TrueEdges:
    """Make edges of points (M, 3) of one kind with the normal (M, 3) of their own face."""
    count = len(positions)
    both = np.full((count, 2, 3), np.nan)
    both[:, 0] = normals
    unknown = np.full((count, 3), np.nan)
    flags, none = np.full(count, int(kind), np.uint8), np.zeros(count, np.int8)
    return TrueEdges(positions, flags, unknown, both, unknown[:, 0].copy(), none)


def near_edges(points: np.ndarray, edges: TrueEdges, reach: float) -> np.ndarray:
    """Tell which points (N, 3) lie within `reach`, mm, of the curves that were sampled; (N,) bool."""
    near = np.zeros(len(points), bool)
    if len(edges) == 0:
        return near
    low, high = edges.positions.min(axis=0) - 2 * reach, edges.positions.max(axis=0) + 2 * reach
    inside = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    if len(inside) == 0:
        return near
    queries, count = np.ascontiguousarray(points[inside]), min(4, len(edges))
    found = knn(build_index(np.ascontiguousarray(edges.positions)), queries, count)
    for column in range(count):  # where curves meet, the nearest sample may belong to the other one
        samples = found.points[:, column]
        offset, tangents = queries - edges.positions[samples], edges.tangents[samples]
        along = np.einsum("ij,ij->i", offset, tangents)
        along = np.clip(along, -reach / 4, reach / 4)  # as far as the samples' own stretch of the curve goes
        near[inside] |= np.linalg.norm(offset - along[:, None] * tangents, axis=1) <= reach
    return near


def _sample_curve(curve: EdgeCurve, step: float) -> TrueEdges:
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve.points, axis=0), axis=1))])
    # Two samples at least; in the middle of their stretch, so that curves that meet do not repeat a corner.
    count = max(2, int(np.ceil(length[-1] / step)))
    at = (np.arange(count) + 0.5) / count * length[-1]
    left = np.clip(np.searchsorted(length, at, side="right") - 1, 0, len(length) - 2)
    part = ((at - length[left]) / (length[left + 1] - length[left]))[:, None]
    positions = (1 - part) * curve.points[left] + part * curve.points[left + 1]
    tangents = unit(curve.points[left + 1] - curve.points[left])
    if curve.normals is None:
        unknown = np.full((count, 2, 3), np.nan)
        flags, none = np.full(count, int(EdgeKind.BOUNDARY), np.uint8), np.zeros(count, np.int8)
        return TrueEdges(positions, flags, tangents, unknown, unknown[:, 0, 0].copy(), none)
    normals = unit((1 - part[..., None]) * curve.normals[left] + part[..., None] * curve.normals[left + 1])
    turn = 2 * np.arcsin(np.minimum(np.linalg.norm(normals[:, 0] - normals[:, 1], axis=1) / 2, 1))
    convex = np.where(is_convex(normals, tangents), 1, -1).astype(np.int8)
    return TrueEdges(positions, np.full(count, int(EdgeKind.CREASE), np.uint8), tangents, normals, turn, convex)
