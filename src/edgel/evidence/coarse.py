"""A first look at handfuls of neighbouring points.

Where a handful and those around it lie on one smooth surface, no point of it needs neighbours of its own. The handfuls
are the leaves of the k-d tree: a dozen times fewer than points, so the look costs next to nothing and spares most of a
large cloud the rest.
"""

from __future__ import annotations

import math

import numpy as np

from edgel.evidence.scales import add_moments
from edgel.kdtree import NeighborIndex, build_index, node_start
from edgel.neighbors import visit_neighbors
from edgel.normals import smallest_eigenpair
from edgel.parallel import kernel, run_slices

PLANAR = 0.01  # surface variation whose planarity is 1 / e
GROUPS = (1, 4, 8, 12)  # leaves of each group that a plane is fitted to: the leaf and those nearest to it
NUM_FEATURES = 4 * len(GROUPS) + 4


def look(index: NeighborIndex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Describe each leaf of an index.

    Returns
    -------
    (L, NUM_FEATURES) float32
        Features.
    (L, 4) float64
        Normal and planarity of its plane.
    (L, 12) int32
        The leaves nearest to it, itself first; fewer where there are not as many.
    """
    leaves = len(index.boxes) // 2
    sums, planes = np.empty((leaves, 13)), np.empty((leaves, 7))
    run_slices(_sum, leaves, index.xyz, leaves, sums, planes, size=1024)
    features = np.zeros((leaves, NUM_FEATURES), np.float32)
    middles = build_index(np.ascontiguousarray(sums[:, 10:]))
    k = min(GROUPS[-1], leaves)
    nearest = np.empty((leaves, k), np.int32)
    visit_neighbors(_describe, middles, middles, k, middles.order, sums, planes, np.array(GROUPS), features, nearest)
    planes = np.column_stack([planes[:, :3], np.exp(-planes[:, 6] / PLANAR)])
    return features, planes, nearest


@kernel
def _sum(start, stop, xyz, leaves, sums, planes):
    """Moments of each leaf about its own middle, and its plane."""
    vectors = np.empty((3, 64))
    for leaf in range(start, stop):
        first, last = node_start(leaf, xyz.shape[1], leaves), node_start(leaf + 1, xyz.shape[1], leaves)
        count, out = last - first, sums[leaf]
        for axis in range(3):
            middle = 0.0
            for p in range(first, last):
                middle += xyz[axis, p] - xyz[axis, first]
            out[10 + axis] = xyz[axis, first] + middle / count
            for p in range(first, last):
                vectors[axis, p - first] = xyz[axis, p] - out[10 + axis]
        out[:10] = 0.0
        out[0] = count
        add_moments(vectors, 0, count, out[1:])
        plane = planes[leaf]
        left = _plane_of(out, plane)
        plane[6] = left / max(out[4] + out[7] + out[9], 1e-300)


@kernel
def _describe(first, places, squared, queries, query_order, xyz, order, sums, planes, groups, features, nearest):
    """For each group the variation, how far the leaf's middle lies off its plane, and its size; then the normals."""
    whole, plane = np.empty(10), np.empty(6)
    for q in range(places.shape[0]):
        leaf = query_order[first + q]
        own, out, done = planes[leaf], features[leaf], 0
        for i in range(places.shape[1]):
            nearest[leaf, i] = order[places[q, i]]
        whole[:] = 0.0
        size = math.sqrt(max(sums[leaf, 4] + sums[leaf, 7] + sums[leaf, 9], 0.0) / sums[leaf, 0])
        for g in range(len(groups)):
            count = min(groups[g], places.shape[1])
            for i in range(done, count):
                _add(sums[order[places[q, i]]], sums[leaf], whole)
            done = count
            left = _plane_of(whole, plane)
            cx, cy, cz = plane[3], plane[4], plane[5]
            n = whole[0]
            trace = whole[4] + whole[7] + whole[9] - n * (cx * cx + cy * cy + cz * cz)
            off = plane[0] * cx + plane[1] * cy + plane[2] * cz
            out[4 * g] = math.log(left / max(trace, 1e-300) + 1e-6)
            out[4 * g + 1] = abs(off) / max(size, 1e-300)
            out[4 * g + 2] = math.sqrt(max(cx * cx + cy * cy + cz * cz - off * off, 0.0)) / max(size, 1e-300)
            out[4 * g + 3] = math.sqrt(max(trace, 0.0) / n) / max(size, 1e-300)
        turn, bent, unlike = 0.0, 0.0, 0.0
        for i in range(1, places.shape[1]):
            other = planes[order[places[q, i]]]
            cosine = abs(own[0] * other[0] + own[1] * other[1] + own[2] * other[2])
            flat = math.exp(-min(max(own[6], other[6]) / PLANAR, 50.0))
            turn = max(turn, flat * (1.0 - cosine))
            unlike = max(unlike, 1.0 - cosine)
            bent = max(bent, other[6])
        at = 4 * len(groups)
        out[at], out[at + 1], out[at + 2] = math.log(turn + 1e-6), math.log(unlike + 1e-6), math.log(bent + 1e-6)
        out[at + 3] = sums[leaf, 0]


@kernel
def _plane_of(s, plane):
    """Fit a plane to points of moments `s` (10,): normal and centroid into `plane` (6,); returns the squares left."""
    n = s[0]
    mx, my, mz = s[1] / n, s[2] / n, s[3] / n
    smallest, _, nx, ny, nz = smallest_eigenpair(
        s[4] - s[1] * mx, s[5] - s[1] * my, s[6] - s[1] * mz, s[7] - s[2] * my, s[8] - s[2] * mz, s[9] - s[3] * mz
    )
    plane[0], plane[1], plane[2], plane[3], plane[4], plane[5] = nx, ny, nz, mx, my, mz
    return max(smallest, 0.0)


@kernel
def _add(sums, about, whole):
    """Add a leaf's moments to `whole`, moved to the middle of the leaf `about`."""
    n = sums[0]
    x, y, z = sums[10] - about[10], sums[11] - about[11], sums[12] - about[12]
    whole[0] += n
    whole[1] += n * x
    whole[2] += n * y
    whole[3] += n * z
    whole[4] += sums[4] + n * x * x
    whole[5] += sums[5] + n * x * y
    whole[6] += sums[6] + n * x * z
    whole[7] += sums[7] + n * y * y
    whole[8] += sums[8] + n * y * z
    whole[9] += sums[9] + n * z * z
