"""The crease test on the cloud: two planes of different direction near a point, both passing through it."""

from __future__ import annotations

import math

import numpy as np

from edgel.kdtree import NeighborIndex
from edgel.neighbors import visit_neighbors
from edgel.normals import fit_planes
from edgel.parallel import kernel

FIT_NEIGHBORS = 10  # of the small planes, which must lie on one face each
NEAR_NEIGHBORS = 32  # among which the two faces are looked for
_REACH = 0.35  # how far from both planes the point may lie, in spacings
_PLANAR = 0.3  # least planarity of the second plane
_VARIATION = 0.01  # surface variation at which planarity has fallen to 1/e


def crease_angles(index: NeighborIndex, min_angle: float) -> np.ndarray:
    """Find the points on a crease and how far the surface turns there.

    Of the planes fitted at the neighbours, A is the most planar one near the point and B the most planar one of another
    direction. The point is on a crease when both pass within 0.35 spacings of it and their normals differ by more than
    `min_angle`. Fixed sizes of neighbourhood: noise above a tenth of the spacing hides creases.

    Parameters
    ----------
    index : NeighborIndex
    min_angle : float
        In radians.

    Returns
    -------
    (N,) float64
        Angle between the two planes' normals in radians, in the order of the input; 0 where there is no crease.
    """
    k = min(FIT_NEIGHBORS, len(index))
    fits = fit_planes(index, index, k)
    planes = np.column_stack([fits.normals, np.exp(-fits.variation / _VARIATION)])[index.order]
    angles = np.zeros(len(index))
    near = min(NEAR_NEIGHBORS, len(index))
    visit_neighbors(_crease_angles, index, index, near, np.nan_to_num(planes), math.cos(min_angle), angles)
    return angles


@kernel
def _crease_angles(first, places, squared, queries, query_order, xyz, planes, cos_min, angles):
    k = places.shape[1]
    for q in range(places.shape[0]):
        spacing_2 = squared[q, min(3, k - 1)]
        if spacing_2 == 0.0:  # repeated points: the nearest different one tells the spacing
            for i in range(k):
                if squared[q, i] > 0.0:
                    spacing_2 = squared[q, i]
                    break
        if spacing_2 == 0.0:
            continue
        a, score_a = 0, -1.0
        for i in range(k):
            score = planes[places[q, i], 3] * math.exp(-squared[q, i] / (9.0 * spacing_2))
            if score > score_a:
                a, score_a = places[q, i], score
        b, score_b, cos_ab = 0, 0.0, 1.0
        for i in range(k):
            row = places[q, i]
            cosine = abs(planes[row, 0] * planes[a, 0] + planes[row, 1] * planes[a, 1] + planes[row, 2] * planes[a, 2])
            score = planes[row, 3] * (1.0 - cosine) * math.exp(-squared[q, i] / (16.0 * spacing_2))
            if score > score_b:
                b, score_b, cos_ab = row, score, cosine
        if cos_ab >= cos_min or planes[b, 3] < _PLANAR:
            continue
        off_2 = max(_off_plane(xyz, planes, first + q, queries, a), _off_plane(xyz, planes, first + q, queries, b))
        if off_2 < _REACH * _REACH * spacing_2:
            angles[query_order[first + q]] = math.acos(min(cos_ab, 1.0))


@kernel
def _off_plane(xyz, planes, query, queries, row):
    """Squared distance of a query to the plane at a sorted point."""
    off = 0.0
    for axis in range(3):
        off += planes[row, axis] * (queries[axis, query] - xyz[axis, row])
    return off * off
