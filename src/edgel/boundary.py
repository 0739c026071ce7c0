"""Boundary of an unorganized surface: points whose neighbours leave a wide empty sector of their tangent plane."""

from __future__ import annotations

import math

import numpy as np

from edgel.kdtree import NeighborIndex
from edgel.neighbors import visit_neighbors
from edgel.parallel import kernel

NEIGHBORS = 32


def boundary_gaps(index: NeighborIndex, normals: np.ndarray, min_gap: float) -> np.ndarray:
    """Find boundary points by the angle criterion (Bendels et al. 2006; PCL's BoundaryEstimation).

    The neighbours are seen from the point in its tangent plane; on a boundary they leave a sector without any.

    Parameters
    ----------
    index : NeighborIndex
    normals : (N, 3) float64
        Unit normals in the order of the input; points without one (NaN) are no boundary.
    min_gap : float
        Least angle of the empty sector, in radians.

    Returns
    -------
    (N,) float64
        The empty sector's angle in radians, in the order of the input; 0 where it is below `min_gap`.
    """
    gaps = np.zeros(len(index))
    visit_neighbors(_boundary_gaps, index, index, min(NEIGHBORS, len(index)), normals, min_gap, gaps)
    return gaps


@kernel
def _boundary_gaps(first, places, squared, queries, query_order, xyz, normals, min_gap, gaps):
    k = places.shape[1]
    angles = np.empty(k)
    for q in range(places.shape[0]):
        row = query_order[first + q]
        nx, ny, nz = normals[row, 0], normals[row, 1], normals[row, 2]
        if not nx * nx + ny * ny + nz * nz > 0.5:
            continue
        # Any two directions that span the tangent plane will do: u lies across the normal's smallest component.
        ux, uy, uz = (0.0, nz, -ny) if abs(nx) <= min(abs(ny), abs(nz)) else (-nz, 0.0, nx)
        if abs(nz) < min(abs(nx), abs(ny)):
            ux, uy, uz = ny, -nx, 0.0
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        ux, uy, uz = ux / length, uy / length, uz / length
        vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
        seen = 0
        for i in range(k):
            if squared[q, i] > 0.0:
                dx = xyz[0, places[q, i]] - queries[0, first + q]
                dy = xyz[1, places[q, i]] - queries[1, first + q]
                dz = xyz[2, places[q, i]] - queries[2, first + q]
                angles[seen] = math.atan2(dx * vx + dy * vy + dz * vz, dx * ux + dy * uy + dz * uz)
                seen += 1
        if seen == 0:
            continue
        sorted_angles = np.sort(angles[:seen])
        gap = 2.0 * math.pi - (sorted_angles[seen - 1] - sorted_angles[0])
        for i in range(1, seen):
            gap = max(gap, sorted_angles[i] - sorted_angles[i - 1])
        if gap >= min_gap:
            gaps[row] = gap
