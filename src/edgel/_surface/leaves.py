"""Leaves of an octree: the first screening, by handfuls of neighbouring points.

Where a leaf and those around it lie on one smooth surface, no point of it needs neighbours of its own. Leaves are a
dozen times fewer than points, so screening them costs next to nothing and spares most of a large cloud the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._kernels.moments import move_moments, plane_of_moments
from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.octree import BITS, Octree, build_octree, step_within
from edgel._neighbors.queries import every_point

PLANAR = 0.01  # surface variation whose planarity is 1 / e
SPANNING = 5  # points that a leaf has at least if its plane says anything
GROUPS = (1, 4, 8, 12)  # leaves of each group that a plane is fitted to: the leaf and those nearest to it

VARIATION, OFF_PLANE, OFF_CENTRE, SIZE = range(4)
OF_GROUP = {
    "variation": "log of the surface variation of the group",
    "off_plane": "distance of the leaf's centroid from the group's plane, in sizes of the leaf",
    "off_centre": "distance of the leaf's centroid from the group's along the plane, in the same",
    "size": "size of the group (root of the summed variance), in the same",
}
TURN, UNLIKE, BENT, COUNT = range(4 * len(GROUPS), 4 * len(GROUPS) + 4)
OF_LEAF = {
    "turn": "log of the largest 1 - cos of the angle to the plane of another leaf, weighed by planarity",
    "unlike": "the same, not weighed",
    "bent": "log of the largest surface variation of the other leaves",
    "count": "points in the leaf",
}
NUM_FEATURES = len(GROUPS) * len(OF_GROUP) + len(OF_LEAF)

# Columns of the sums of each leaf, after the moments about its centroid, and of its plane, after normal and centroid.
_CENTROID, _SUMS = 10, 13
_VARIATION, _PLANE = 6, 7
_MOST_SIZES = 1e3  # sizes of a leaf that are told apart: one point has none


@dataclass(frozen=True, eq=False)
class Leaves:
    """What is known of the leaves of an octree.

    Attributes
    ----------
    octree : Octree
    features : (L, NUM_FEATURES) float32
    planes : (L, 4) float64
        Normal and planarity of the plane fitted to each; planarity 0 of leaves with fewer than `SPANNING` points.
    nearest : (L, 12) int32
        The leaves nearest to each by their centroids, itself first; fewer where there are not as many.
    centroids : (L, 3) float64
    radii : (L,) float64
        How far the centroid of the farthest of `nearest` lies from its own; infinite where there are fewer than 12.
    """

    octree: Octree
    features: np.ndarray
    planes: np.ndarray
    nearest: np.ndarray
    centroids: np.ndarray
    radii: np.ndarray


def describe_leaves(index: NeighborIndex, size: float) -> Leaves:
    """Fit planes to each leaf of an octree with top cells of some size, and to groups of leaves around it."""
    octree = build_octree(index, size)
    leaves = len(octree.starts) - 1
    sums, planes = np.empty((leaves, _SUMS)), np.empty((leaves, _PLANE))
    run_slices(_sum, leaves, index.xyz, octree.places, octree.starts, size, sums, planes, size=1024)
    features = np.zeros((leaves, NUM_FEATURES), np.float32)
    centroids = build_index(np.ascontiguousarray(sums[:, _CENTROID:]))
    k = min(GROUPS[-1], leaves)
    nearest, radii = np.empty((leaves, k), np.int32), np.empty(leaves)
    arguments = (centroids.order, sums, planes, np.array(GROUPS), features, nearest, radii)
    visit_neighbors(_describe, every_point(centroids), centroids, k, *arguments)
    planarity = np.where(planes[:, _VARIATION] >= 0, np.exp(-planes[:, _VARIATION] / PLANAR), 0.0)
    planes = np.column_stack([planes[:, :3], planarity])
    return Leaves(octree, features, planes, nearest, sums[:, _CENTROID:], radii)


@kernel
def _sum(start, stop, xyz, places, starts, size, sums, planes):
    """Moments of each leaf about its own centroid, the centroid, and the leaf's plane.

    Added up in whole steps of a cell: so they do not depend on the order, which is not the same in a part of a cloud.
    """
    low, steps = np.empty(3, np.int64), np.empty(3, np.int64)
    first, second = np.empty(3, np.int64), np.empty(6, np.int64)
    step = size / 2.0**BITS
    for leaf in range(start, stop):
        out, count = sums[leaf], starts[leaf + 1] - starts[leaf]
        low[:], first[:], second[:] = 1 << BITS, 0, 0
        for i in range(starts[leaf], starts[leaf + 1]):
            for axis in range(3):
                low[axis] = min(low[axis], step_within(xyz[axis, places[i]], size))
        for i in range(starts[leaf], starts[leaf + 1]):
            for axis in range(3):
                steps[axis] = step_within(xyz[axis, places[i]], size) - low[axis]
                first[axis] += steps[axis]
            at = 0
            for a in range(3):
                for b in range(a, 3):
                    second[at] += steps[a] * steps[b]
                    at += 1
        out[:_CENTROID] = 0.0
        out[0] = count
        at = 0
        for a in range(3):
            corner = np.floor(xyz[a, places[starts[leaf]]] / size) * size
            out[_CENTROID + a] = corner + (low[a] + first[a] / count) * step
            for b in range(a, 3):
                out[4 + at] = (second[at] - first[a] * (first[b] / count)) * step * step
                at += 1
        plane = planes[leaf]
        left = plane_of_moments(out, plane)
        plane[_VARIATION] = left / max(out[4] + out[7] + out[9], 1e-300) if count >= SPANNING else -1.0


@kernel
def _describe(first, places, squared, queries, targets, xyz, order, sums, planes, groups, features, nearest, radii):
    """Write `OF_GROUP` of each group, then `OF_LEAF`."""
    whole, plane = np.empty(10), np.empty(6)
    for q in range(places.shape[0]):
        leaf = targets[first + q]
        own, out, done = planes[leaf], features[leaf], 0
        radii[leaf] = math.sqrt(squared[q, places.shape[1] - 1]) if places.shape[1] == groups[-1] else np.inf
        for i in range(places.shape[1]):
            nearest[leaf, i] = order[places[q, i]]
        whole[:] = 0.0
        size = math.sqrt(max(sums[leaf, 4] + sums[leaf, 7] + sums[leaf, 9], 0.0) / sums[leaf, 0])
        for g in range(len(groups)):
            count = min(groups[g], places.shape[1])
            for i in range(done, count):
                other = sums[order[places[q, i]]]
                x, y, z = other[10] - sums[leaf, 10], other[11] - sums[leaf, 11], other[12] - sums[leaf, 12]
                move_moments(other, x, y, z, whole)
            done = count
            left = plane_of_moments(whole, plane)
            cx, cy, cz = plane[3], plane[4], plane[5]
            n = whole[0]
            trace = whole[4] + whole[7] + whole[9] - n * (cx * cx + cy * cy + cz * cz)
            off = plane[0] * cx + plane[1] * cy + plane[2] * cz
            of_group = out[4 * g : 4 * g + 4]
            of_group[VARIATION] = math.log(left / max(trace, 1e-300) + 1e-6)
            of_group[OFF_PLANE] = min(abs(off) / max(size, 1e-300), _MOST_SIZES)
            aside = math.sqrt(max(cx * cx + cy * cy + cz * cz - off * off, 0.0))
            of_group[OFF_CENTRE] = min(aside / max(size, 1e-300), _MOST_SIZES)
            of_group[SIZE] = min(math.sqrt(max(trace, 0.0) / n) / max(size, 1e-300), _MOST_SIZES)
        turn, bent, unlike = 0.0, 0.0, 0.0
        for i in range(1, places.shape[1]):
            other = planes[order[places[q, i]]]
            if other[_VARIATION] < 0.0:  # too few points: no plane
                continue
            cosine = abs(own[0] * other[0] + own[1] * other[1] + own[2] * other[2])
            flat = math.exp(-min(max(own[_VARIATION], other[_VARIATION]) / PLANAR, 50.0))
            turn = max(turn, flat * (1.0 - cosine))
            unlike = max(unlike, 1.0 - cosine)
            bent = max(bent, other[_VARIATION])
        if own[_VARIATION] < 0.0:
            turn, unlike = 1.0, 1.0
        out[TURN], out[UNLIKE], out[BENT] = math.log(turn + 1e-6), math.log(unlike + 1e-6), math.log(bent + 1e-6)
        out[COUNT] = sums[leaf, 0]
