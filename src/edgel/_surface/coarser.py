"""A coarser look: the surface by the means of cells, where noise asks for more support than neighbours give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._faces import Faces
from edgel._kinds import LIKELY
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import anywhere
from edgel._neighbors.thinning import number_voxels
from edgel._surface.line import Strengths

CELL = 1.6  # spacings of the cloud: side of a cell
FEWEST = 100  # cells that make a surface
FAINT = 0.25  # least strength, in the coarser look, of what is carried back
APART = 1.5  # cells: what is seen nearer to a likely edge of the closer look is that edge again
PIECES = 5  # places along the edge of each point that lies on one
_ALONG = np.linspace(-0.5, 0.5, PIECES)  # of a cell: where they are
_FRACTIONS = 2.0**24  # of a cell: sums of whole ones do not depend on the order of the points


def means_of_cells(xyz: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Take the mean of the points (N, 3) in each cell that holds any, whatever the order of the points.

    The cells begin at the origin of the coordinates, so that what lies far away does not move them.

    Returns
    -------
    (M, 3) float64, (M, 3) float64
        The means, and in whole numbers where their cells lie along the axes: x first, ascending.
    """
    cell = np.floor(xyz / size)
    voxel = number_voxels(cell - cell.min(axis=0))
    count, corner = np.bincount(voxel), np.empty((voxel.max() + 1, 3))
    corner[voxel] = cell
    inside = np.rint((xyz / size - cell) * _FRACTIONS)
    sums = np.column_stack([np.bincount(voxel, inside[:, axis]) for axis in range(3)])
    return (corner + sums / (_FRACTIONS * count[:, None])) * size, corner


@dataclass(frozen=True, eq=False)
class Carried:
    """Edges of a coarser look, at the points of the closer one that lie nearest to them.

    Attributes
    ----------
    strengths : Strengths
        At some points (C,), ascending.
    sources : (C,) int64
        The point of the coarser cloud whose edge each lies on.
    """

    strengths: Strengths
    sources: np.ndarray

    def take(self, some: np.ndarray) -> Carried:
        """Return what is carried to some of these points."""
        return Carried(self.strengths.take(some), self.sources[some])

    def seen_at(self, points: np.ndarray, own: Strengths) -> tuple[np.ndarray, np.ndarray]:
        """Return those of some points (E,), ascending, that the closer look shows less of, and their sources."""
        both, rows, carried = np.intersect1d(points, self.strengths.points, assume_unique=True, return_indices=True)
        closer = np.zeros(len(both))
        _, here, there = np.intersect1d(both, own.points, assume_unique=True, return_indices=True)
        closer[here] = own.strongest[there]
        less = closer < self.strengths.strongest[carried]
        return rows[less], self.sources[carried[less]]


def pieces_of(faces: Faces, size: float) -> np.ndarray:
    """Return places (M * `PIECES`, 3) along the edge of each row of some faces: a piece as long as a cell."""
    at = faces.position[:, None] + size * _ALONG[None, :, None] * np.nan_to_num(faces.direction)[:, None]
    return at.reshape(-1, 3)


def strongest_at(points: np.ndarray, found: Strengths) -> Carried:
    """Choose the strongest of the edges that are carried to points (M,), in any order; of equals the first source.

    `found` are their strengths, a row each, at the points of the coarser cloud that they come from.
    """
    order = np.lexsort((found.points, -found.strongest, points))  # of each point the strongest comes first
    marked, first = np.unique(points[order], return_index=True)
    rows = order[first]
    return Carried(Strengths(marked, found.crease[rows], found.outline[rows]), found.points[rows])


def carry(index: NeighborIndex, size: float, found: Strengths, faces: Faces) -> Carried:
    """Carry edges of a coarser look, with a row of `faces` for each point of `found`, to the points nearest to them.

    An edge is a piece of its line as long as a cell, and marks the points that are nearest to some place of it.
    """
    nearest = knn(index, anywhere(pieces_of(faces, size)), 1).points[:, 0]
    return strongest_at(nearest, found.take(np.repeat(np.arange(len(found.points)), PIECES)))


def apart(index: NeighborIndex, size: float, found: Strengths, carried: Carried) -> Carried:
    """Keep what is carried to places without any likely edge of the closer look around."""
    likely, points = found.points[found.strongest >= LIKELY], carried.strengths.points
    return carried.take(lie_apart(index.at(index.places_of(points)), index.at(index.places_of(likely)), size))


def lie_apart(xyz: np.ndarray, likely: np.ndarray, size: float) -> np.ndarray:
    """Whether each of some places (M, 3) has none of the likely edge points (L, 3) around, (M,) bool."""
    if not (len(likely) and len(xyz)):
        return np.ones(len(xyz), bool)
    near: np.ndarray = knn(build_index(likely), anywhere(xyz), 1).distances[:, 0]
    return near > APART * size
