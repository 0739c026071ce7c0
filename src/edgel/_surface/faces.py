"""Where exactly an edge runs, and the surface on either side: creases from curved faces, ends from outermost points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from edgel._faces import Faces, facing
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import knn, visit_neighbors
from edgel._neighbors.normals import fit_nearest, towards
from edgel._neighbors.queries import at_points
from edgel._neighbors.spacing import DISC
from edgel._surface import rims
from edgel._surface.classify import Classification
from edgel._surface.curved_faces import COUNTS, EDGE, FIRST, LINE, POSITION, SECOND, STD, fit_curved_faces
from edgel._surface.evidence import MAX_AWAY, MIN_TURN, support
from edgel.edges import OUTLINES, EdgeKind

ALIKE = 2.75  # deviations of edges between faces of smoothed points over what independent errors would leave: measured


@dataclass(frozen=True, eq=False)
class LocalFits:
    """What the neighbours of some points (E,) tell of an edge there: all of its place that other edge points do not.

    Attributes
    ----------
    xyz, seen : (E, 3) float64
        The points, as measured and where they were looked at.
    normals : (E, 3) float64
        Of one plane fitted at each, towards the viewer.
    offset, noise : (E,) float64
        Of that plane: its distance from the origin, and the standard deviation of the neighbours off it.
    outward : (E, 5) float64
        See `rims.find_outward`; NaN where no end was looked for.
    refined : (E, 13) float64
        The crease, see `refine`; NaN where none was looked for or none is placed.
    disc, reach : (E,) float64
        Distance of the farthest of the 16 nearest, and of as many as show most of the crease.
    """

    xyz: np.ndarray
    seen: np.ndarray
    normals: np.ndarray
    offset: np.ndarray
    noise: np.ndarray
    outward: np.ndarray
    refined: np.ndarray
    disc: np.ndarray
    reach: np.ndarray

    def take(self, rows: np.ndarray) -> Self:
        """Return the fits of some rows."""
        return type(self)(*(getattr(self, name)[rows] for name in type(self).__dataclass_fields__))

    def faces(self, kind: np.ndarray, outermost: np.ndarray, viewpoint: np.ndarray | None) -> Faces:
        """Say where exactly the edge runs at points of kinds (E,) uint8, and how the surface lies on either side.

        Parameters
        ----------
        kind : (E,) uint8
        outermost : (K, 3) float64
            The points that surely are where the surface ends, whatever edge points are asked for.
        viewpoint : (3,) float64 or None
            Normals are turned towards it, or upwards (+Z) without one.

        Returns
        -------
        Faces
            One row a point; where neither crease nor end is known the position is the point itself.
        """
        faces = Faces.of_points(self.xyz, self.normals)
        faces.scale[:] = self.disc
        self._put_rims(faces, np.flatnonzero(((kind & OUTLINES) > 0) & ~np.isnan(self.offset)), outermost)
        rows = np.flatnonzero(kind & EdgeKind.CREASE)
        found = crease_faces(self.refined[rows], self.seen[rows], viewpoint)
        found.scale[:] = self.reach[rows]
        known = found.convex != 0
        faces.put(rows[known], found, known)
        return faces

    def _put_rims(self, faces: Faces, at: np.ndarray, outermost: np.ndarray) -> None:
        """Put the place and the tangent of the surface's end into the faces of some rows."""
        found = rims.fit_rims(self.xyz[at], outermost, self.normals[at], self.outward[at])
        known = ~np.isnan(found[:, rims.STD])
        at, found = at[known], found[known]
        place = faces.position[at] + found[:, rims.POSITION : rims.POSITION + 3]
        off = (place * self.normals[at]).sum(axis=1) - self.offset[at]
        faces.position[at] = place - off[:, None] * self.normals[at]
        faces.position_std[at] = found[:, rims.STD]
        faces.direction[at] = found[:, rims.LINE : rims.LINE + 3]


def fit_locally(
    index: NeighborIndex,
    smoothed: NeighborIndex,
    stretch: np.ndarray | None,
    classified: Classification,
    points: np.ndarray,
    creases: np.ndarray,
    ends: np.ndarray,
    num_neighbors: int,
    viewpoint: np.ndarray | None,
) -> LocalFits:
    """Fit what the neighbours of points (E,), ascending, tell of an edge there.

    Parameters
    ----------
    index, smoothed : NeighborIndex
        All points, and where they were looked at.
    stretch : (3, N) float64 or None
        Of each place of `smoothed` on scan lines: see `edgel._neighbors.scan_lines`.
    classified : Classification
    points : (E,) int64
    creases, ends : (E,) bool
        Where a crease and where the surface's end is looked for.
    num_neighbors : int
        Of the plane at each point.
    viewpoint : (3,) float64 or None
        Normals are turned towards it, or upwards (+Z) without one.
    """
    places = index.places_of(points)
    xyz, own = index.at(places), stretch if stretch is None else stretch[:, smoothed.places_of(index.order)]
    planes = towards(fit_nearest(index, at_points(index, points, own), num_neighbors), xyz, viewpoint)
    noise = np.sqrt(planes.residual / max(num_neighbors - 3, 1))
    outward = np.full((len(points), rims.OUTWARD), np.nan)
    outward[ends] = rims.find_outward(index, points[ends], planes.normals[ends], noise[ends])
    asked = classified.take(np.isin(classified.points, points[creases]) & classified.evidence.placed)
    refined, count = np.full((len(points), EDGE), np.nan), np.full(len(points), DISC)
    rows = np.searchsorted(points, asked.points)
    refined[rows] = refine(index, smoothed, asked, stretch)
    count[rows] = support(asked.evidence)
    # Radii by the density around the point, as the disc of its 16 nearest has it: 16 tell where a surface ends.
    disc = knn(index, at_points(index, points), min(DISC, len(index))).distances[:, -1]
    return LocalFits(
        xyz=xyz,
        seen=xyz if smoothed is index else smoothed.at(smoothed.places_of(points)),
        normals=planes.normals,
        offset=planes.offset,
        noise=noise,
        outward=outward,
        refined=refined,
        disc=disc,
        reach=disc * np.sqrt(count / DISC),
    )


def refine(
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
