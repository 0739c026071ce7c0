"""Where exactly an edge runs, and the surface on either side: creases from curved faces, ends from outermost points."""

from __future__ import annotations

import numpy as np

from edgel._faces import Faces, facing
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import knn, visit_neighbors
from edgel._neighbors.normals import Normals
from edgel._neighbors.queries import at_points
from edgel._neighbors.spacing import DISC
from edgel._surface import rims
from edgel._surface.classify import Classification
from edgel._surface.curved_faces import COUNTS, EDGE, FIRST, LINE, POSITION, SECOND, STD, fit_curved_faces
from edgel._surface.evidence import MAX_AWAY, MIN_TURN, support

ALIKE = 2.75  # deviations of edges between faces of smoothed points over what independent errors would leave: measured


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
    stretch: np.ndarray | None,
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
    stretch : (3, N) float64 or None
        Of each place of `smoothed` on scan lines: see `edgel._neighbors.scan_lines`.

    Returns
    -------
    Faces
        One row an edge point; where neither crease nor end is known the position is the point itself.
    """
    faces = Faces.of_points(index.at(index.places_of(edge)), planes.normals)
    noise = np.sqrt(planes.residual / max(num_neighbors - 3, 1))
    _put_rims(faces, index, edge, planes, noise, ends, outermost)
    found = crease_faces(
        refined(index, smoothed, creases, stretch), smoothed.at(smoothed.places_of(creases.points)), viewpoint
    )
    known = creases.evidence.placed & (found.convex != 0)
    rows = np.searchsorted(edge, creases.points[known])
    faces.put(rows, found, known)
    # Radii by the density around the point, as the disc of its 16 nearest has it: 16 tell where a surface ends.
    count = np.full(len(edge), DISC)
    count[rows] = support(creases.evidence.take(known))
    disc = knn(index, at_points(index, edge), min(DISC, len(index))).distances[:, -1]
    faces.scale[:] = disc * np.sqrt(count / DISC)
    return faces


def refined(
    index: NeighborIndex, smoothed: NeighborIndex, creases: Classification, stretch: np.ndarray | None = None
) -> np.ndarray:
    """Fit curved faces to the neighbours of creases, from their best fit of two planes: see `fit_curved_faces`.

    Those of the cloud as it was measured: errors of smoothed neighbours are alike, so that fits are too sure. Where
    these alone make an edge, its deviation is `ALIKE` times what its residuals say.
    """
    edges, again = np.empty((2, len(creases.points), EDGE))
    if len(edges):
        k, asked = min(COUNTS[-1], len(index)), at_points(smoothed, creases.points, stretch)
        fits = creases.evidence.fit.astype(np.float64)
        visit_neighbors(fit_curved_faces, asked, index, k, fits, MAX_AWAY, MIN_TURN, edges)
        if smoothed is not index:
            visit_neighbors(fit_curved_faces, asked, smoothed, k, fits, MAX_AWAY, MIN_TURN, again)
            again[:, STD] *= ALIKE
            edges = np.where(np.isnan(edges[:, STD:]), again, edges)
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
        scale=np.full(len(xyz), np.nan),
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
