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
_PIECES = np.linspace(-0.5, 0.5, 5)  # of a cell, along the edge from each point that lies on one
_FRACTIONS = 2.0**24  # of a cell: sums of whole ones do not depend on the order of the points


def means_of_cells(index: NeighborIndex, size: float) -> np.ndarray:
    """Return the mean of the points in each cell that holds any, (M, 3) float64, whatever the order of the points.

    The cells begin at the origin of the coordinates, so that what lies far away does not move them.
    """
    xyz = index.by_point()
    cell = np.floor(xyz / size)
    voxel = number_voxels(cell - cell.min(axis=0))
    count, corner = np.bincount(voxel), np.empty((voxel.max() + 1, 3))
    corner[voxel] = cell
    inside = np.rint((xyz / size - cell) * _FRACTIONS)
    sums = np.column_stack([np.bincount(voxel, inside[:, axis]) for axis in range(3)])
    return (corner + sums / (_FRACTIONS * count[:, None])) * size


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

    def seen_at(self, points: np.ndarray, own: Strengths) -> tuple[np.ndarray, np.ndarray]:
        """Return those of some points (E,), ascending, that the closer look shows less of, and their sources."""
        closer = np.zeros(max(points.max(initial=-1), own.points.max(initial=-1)) + 1)
        closer[own.points] = own.strongest
        _, rows, carried = np.intersect1d(points, self.strengths.points, assume_unique=True, return_indices=True)
        less = closer[points[rows]] < self.strengths.strongest[carried]
        return rows[less], self.sources[carried[less]]


def carry(index: NeighborIndex, size: float, found: Strengths, faces: Faces) -> Carried:
    """Carry edges of a coarser look, with a row of `faces` for each point of `found`, to the points nearest to them.

    An edge is a piece of its line as long as a cell, and marks the points that are nearest to some place of it.
    """
    at = faces.position[:, None] + size * _PIECES[None, :, None] * np.nan_to_num(faces.direction)[:, None]
    source = np.repeat(np.arange(len(found.points)), len(_PIECES))
    nearest = knn(index, anywhere(at.reshape(-1, 3)), 1).points[:, 0]
    strongest = found.strongest[source]
    order = np.lexsort((found.points[source], -strongest, nearest))  # of each point the strongest comes first
    points, first = np.unique(nearest[order], return_index=True)
    rows = source[order[first]]
    return Carried(Strengths(points, found.crease[rows], found.outline[rows]), found.points[rows])


def apart(index: NeighborIndex, size: float, found: Strengths, carried: Carried) -> Carried:
    """Keep what is carried to places without any likely edge of the closer look around."""
    likely = found.points[found.strongest >= LIKELY]
    points = carried.strengths.points
    if not (len(likely) and len(points)):
        return carried
    of_edges = build_index(index.at(index.places_of(likely)))
    near = knn(of_edges, anywhere(index.at(index.places_of(points))), 1).distances[:, 0]
    kept = near > APART * size
    return Carried(carried.strengths.take(kept), carried.sources[kept])
