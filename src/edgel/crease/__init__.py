"""The crease test on the cloud: three formulations, of which two have to agree.

Each wins somewhere: planes near the point, planes through it, a hinge against a quadric (docs/decisions.md).
"""

from __future__ import annotations

import math

import numpy as np

from edgel.crease import hinge, near, through
from edgel.crease.hinge import hinge_angle
from edgel.crease.near import planes_near
from edgel.crease.through import planes_through
from edgel.kdtree import NeighborIndex, build_index
from edgel.neighbors import visit_neighbors
from edgel.normals import fit_planes
from edgel.parallel import kernel

FIT_NEIGHBORS = 10  # of the small planes, which must lie on one face each
_FADE = 0.01  # surface variation at which planarity has fallen to 1/e
_FLAT = 0.002  # surface variation below which no crease is looked for: a turn of 25 degrees has three times as much
_NEIGHBORS = max(near.NEIGHBORS, through.NEIGHBORS, hinge.NEIGHBORS)


def crease_angles(index: NeighborIndex, xyz: np.ndarray, min_angle: float) -> np.ndarray:
    """Find the points on a crease and how far the surface turns there.

    Neighbourhoods are of fixed size: noise above a few tenths of the spacing hides creases.

    Parameters
    ----------
    index : NeighborIndex
        Of the points.
    xyz : (N, 3) float64
        The points themselves.
    min_angle : float
        In radians.

    Returns
    -------
    (N,) float64
        Angle between the two faces' planes in radians, 0 to pi / 2 (a turn of 120 degrees counts as 60), in the order
        of the input; 0 where there is no crease.
    """
    fits = fit_planes(index, index, min(FIT_NEIGHBORS, len(index)))
    angles = np.zeros(len(index))
    candidates = np.flatnonzero(fits.variation > _FLAT)
    if len(candidates) == 0:
        return angles
    planes = np.column_stack([fits.normals, np.exp(-fits.variation / _FADE)])
    planes = np.nan_to_num(planes[index.order])
    found = np.zeros(len(candidates))
    visit_neighbors(
        _crease_angles,
        build_index(xyz[candidates]),
        index,
        min(_NEIGHBORS, len(index)),
        planes,
        math.cos(min_angle),
        found,
    )
    angles[candidates] = found
    return angles


@kernel
def _crease_angles(first, places, squared, queries, query_order, xyz, planes, cos_min, angles):
    k = places.shape[1]
    vectors, room = np.empty((k, 3)), np.empty((6, 7))
    for q in range(places.shape[0]):
        spacing = _spacing(squared[q])
        if spacing == 0.0:
            continue
        for i in range(k):
            for axis in range(3):
                vectors[i, axis] = xyz[axis, places[q, i]] - queries[axis, first + q]
        a = planes_near(places[q], squared[q], vectors, min(near.NEIGHBORS, k), spacing, planes, cos_min)
        b = planes_through(vectors, min(through.NEIGHBORS, k), spacing, cos_min)
        votes, total = int(a > 0.0) + int(b > 0.0), a + b
        if votes == 1:  # the third is the slowest, and is asked only when it decides
            own = planes[places[q, 0]]
            c = hinge_angle(vectors, min(hinge.NEIGHBORS, k), spacing, own[0], own[1], own[2], room)
            votes, total = votes + int(c > 0.0), total + min(c, math.pi - c)
        if votes > 1:
            angles[query_order[first + q]] = total / votes


@kernel
def _spacing(squared):
    """Distance between points about a query: the median to its six nearest, repeats of it left out."""
    k = len(squared)
    skip = 1
    while skip < k and squared[skip] == 0.0:
        skip += 1
    if skip >= k:
        return 0.0
    low, high = min(skip + 2, k - 1), min(skip + 3, k - 1)
    return 0.5 * (math.sqrt(squared[low]) + math.sqrt(squared[high]))
