"""Edge points as curves need them: where they are, how far apart the cloud's points lie there, and its index."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import at_points
from edgel._neighbors.spacing import disc_spacing
from edgel.edges import EdgeKind, Edges

LEFT_OUT = EdgeKind.OCCLUDED | EdgeKind.FRAME
"""The far side of a jump has no edge of its own, and the end of what a sensor sees is none of things."""
_AROUND = 16


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """Edge points, and the cloud they lie in, about an origin of its own.

    Attributes
    ----------
    rows : (E,) int64
        Of the `Edges`.
    position : (E, 3) float64
    direction : (E, 3) float64
        NaN where unknown.
    normals : (E, 2, 3) float64
    kind : (E,) uint8
    convex : (E,) int8
    strength : (E,) float64
    spacing : (E,) float64
    index : NeighborIndex
        Of the cloud.
    """

    rows: np.ndarray
    position: np.ndarray
    direction: np.ndarray
    normals: np.ndarray
    kind: np.ndarray
    convex: np.ndarray
    strength: np.ndarray
    spacing: np.ndarray
    index: NeighborIndex

    def __len__(self) -> int:
        return len(self.rows)


def edge_points(xyz: np.ndarray, points: np.ndarray, edges: Edges, origin: np.ndarray) -> EdgePoints:
    """Take from the edges what curves are made of; `points` (E,) are the edges' rows among the points (N, 3)."""
    kind = edges.kind & ~np.uint8(LEFT_OUT)
    rows = np.flatnonzero(kind > 0)
    index = build_index(xyz)
    spacing = np.zeros(len(rows))
    if len(rows):
        visit_neighbors(_spacing, at_points(index, points[rows]), index, min(_AROUND, len(index)), spacing)
    # Points that repeat each other have no spacing.
    known = spacing[spacing > 0]
    spacing[spacing <= 0] = float(np.median(known)) if len(known) else 1.0
    parts = (edges.position - origin, edges.direction, edges.normals)
    position, direction, normals = (np.ascontiguousarray(part[rows], np.float64) for part in parts)
    return EdgePoints(
        rows, position, direction, normals, kind[rows], edges.convex[rows], edges.strength[rows], spacing, index
    )


@kernel
def _spacing(first, places, squared, queries, targets, xyz, spacing):
    for q in range(len(places)):
        spacing[targets[first + q]] = disc_spacing(squared[q])
