"""Where exactly an edge runs, and the surface on either side: creases from curved faces, ends from outermost points."""

from __future__ import annotations

import numpy as np

from edgel._faces import Faces, facing
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.normals import Normals
from edgel._neighbors.queries import at_points
from edgel._surface import rims
from edgel._surface.classify import Classification
from edgel._surface.curved_faces import COUNTS, EDGE, FIRST, LINE, POSITION, SECOND, STD, fit_curved_faces
from edgel._surface.evidence import MAX_AWAY, MIN_TURN


def localize(
    index: NeighborIndex,
    smoothed: NeighborIndex,
    edge: np.ndarray,
    planes: Normals,
    num_neighbors: int,
    creases: Classification,
    ends: np.ndarray,
    outermost: np.ndarray,
    viewpoint: np.ndarray | None,
) -> Faces:
    """Say where exactly the edge runs at each edge point, and how the surface lies on either side.

    Parameters
    ----------
    index, smoothed : NeighborIndex
        All points, and where they were looked at.
    edge : (E,) int64
        The edge points, ascending.
    planes : Normals
        Of one plane fitted at each edge point: the first normal where no crease is known.
    num_neighbors : int
        Of each of them.
    creases : Classification
        Of those edge points that lie on a crease.
    ends : (E,) bool
        Those where the surface ends.
    outermost : (K, 3) float64
        The points that surely are where it ends, whatever edge points are asked for.
    viewpoint : (3,) float64 or None
        Normals are turned towards it, or upwards (+Z) without one.

    Returns
    -------
    Faces
        One row an edge point; where neither crease nor end is known the position is the point itself.
    """
    faces = Faces.of_points(index.at(index.places_of(edge)), planes.normals)
    noise = np.sqrt(planes.residual / max(num_neighbors - 3, 1))
    _put_rims(faces, index, edge, planes, noise, ends, outermost)
    found = crease_faces(refined(smoothed, creases), smoothed.at(smoothed.places_of(creases.points)), viewpoint)
    known = creases.evidence.placed & (found.convex != 0)
    faces.put(np.searchsorted(edge, creases.points[known]), found, known)
    return faces


def refined(index: NeighborIndex, creases: Classification) -> np.ndarray:
    """Fit curved faces to the neighbours of creases, from their best fit of two planes: see `fit_curved_faces`."""
    edges = np.empty((len(creases.points), EDGE))
    if len(edges):
        k = min(COUNTS[-1], len(index))
        arguments = (creases.evidence.fit.astype(np.float64), MAX_AWAY, MIN_TURN, edges)
        visit_neighbors(fit_curved_faces, at_points(index, creases.points), index, k, *arguments)
    return edges


def crease_faces(edges: np.ndarray, xyz: np.ndarray, viewpoint: np.ndarray | None) -> Faces:
    """Describe the creases (M, 13) at points (M, 3), by the columns that `edgel._surface.curved_faces` names.

    Normals are turned towards the viewpoint, or upwards (+Z) without one.
    """
    a, b, line, foot = (edges[:, i : i + 3] for i in (FIRST, SECOND, LINE, POSITION))
    turn = np.arccos(np.clip((a * b).sum(axis=1), -1, 1))
    known = turn > MIN_TURN
    normals, sign = facing(xyz, (a, b), viewpoint)
    unknown = np.where(known, 1.0, np.nan)[:, None]
    return Faces(
        position=xyz + foot * unknown,
        position_std=edges[:, STD] * unknown[:, 0],
        direction=line * unknown,
        normals=normals * unknown[:, None],
        angle=turn * unknown[:, 0],
        convex=np.where(known, sign, 0).astype(np.int8),
    )


def _put_rims(
    faces: Faces,
    index: NeighborIndex,
    edge: np.ndarray,
    planes: Normals,
    noise: np.ndarray,
    ends: np.ndarray,
    outermost: np.ndarray,
) -> None:
    """Put the place and the tangent of the surface's end into the faces of those edge points where it is one."""
    at = np.flatnonzero(ends & ~np.isnan(planes.offset))
    some = planes.take(at)
    found = rims.find_rims(index, edge[at], outermost, some.normals, noise[at])
    known = ~np.isnan(found[:, rims.STD])
    at, found, some = at[known], found[known], some.take(known)
    place = faces.position[at] + found[:, rims.POSITION : rims.POSITION + 3]
    off = (place * some.normals).sum(axis=1) - some.offset
    faces.position[at] = place - off[:, None] * some.normals
    faces.position_std[at] = found[:, rims.STD]
    faces.direction[at] = found[:, rims.LINE : rims.LINE + 3]
