"""The k nearest in a metric of the query's own, which stretches one direction: along a scan line.

A stretch is a vector t: what lies along it counts 1 + |t| times as far. In the stretched space points along a line lie
as far apart as the lines, so that neighbours lie all round a point, as on an evenly sampled surface.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel._neighbors.kdtree import node_start
from edgel._neighbors.search import first_of

_DEPTH = 64  # of a tree, at most
_ROUNDING = 1.0 - 1e-9  # bounds of boxes are computed otherwise than distances


@kernel
def list_stretched(start, stop, queries, tree, places, squared):
    """List the k nearest of those of the queries start..stop-1, (6, M), whose stretch (the last rows) is not 0.

    Nearest first, ties by coordinates; `squared` are distances in the stretched space.
    """
    stack, reaches = np.empty(_DEPTH, np.int64), np.empty(_DEPTH)
    for q in range(start, stop):
        tx, ty, tz = queries[3, q], queries[4, q], queries[5, q]
        if tx != 0.0 or ty != 0.0 or tz != 0.0:
            point = (queries[0, q], queries[1, q], queries[2, q])
            _nearest(tree, point, (tx, ty, tz), stack, reaches, places[q - start], squared[q - start])


@routine
def _nearest(tree, point, stretch, stack, reaches, places, squared):
    """Search the tree, the nearer child of a node first."""
    x, y, z, order, boxes, num_points = tree.x, tree.y, tree.z, tree.order, tree.boxes, len(tree.order)
    qx, qy, qz = point
    length = math.sqrt(stretch[0] ** 2 + stretch[1] ** 2 + stretch[2] ** 2)
    ux, uy, uz, more = stretch[0] / length, stretch[1] / length, stretch[2] / length, length * (length + 2.0)
    leaves, depth, last = boxes.shape[0] // 2, 1, len(places) - 1
    squared[:], places[:] = np.inf, 0
    stack[0], reaches[0] = 1, 0.0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if reaches[depth] > squared[last]:
            continue
        if node < leaves:
            near, far = 2 * node, 2 * node + 1
            near_d = _least(boxes[near], qx, qy, qz, ux, uy, uz, more)
            far_d = _least(boxes[far], qx, qy, qz, ux, uy, uz, more)
            if far_d < near_d:
                near, far, near_d, far_d = far, near, far_d, near_d
            stack[depth], reaches[depth] = far, far_d
            stack[depth + 1], reaches[depth + 1] = near, near_d
            depth += 2
            continue
        first = node_start(node - leaves, num_points, leaves)
        for p in range(first, node_start(node - leaves + 1, num_points, leaves)):
            dx, dy, dz = x[p] - qx, y[p] - qy, z[p] - qz
            along = dx * ux + dy * uy + dz * uz
            d, slot = dx * dx + dy * dy + dz * dz + more * along * along, last
            if not (d < squared[last] or (d == squared[last] and first_of(x, y, z, order, p, places[last]))):
                continue
            while slot > 0 and (
                d < squared[slot - 1] or (d == squared[slot - 1] and first_of(x, y, z, order, p, places[slot - 1]))
            ):
                squared[slot], places[slot] = squared[slot - 1], places[slot - 1]
                slot -= 1
            squared[slot], places[slot] = d, p


@routine
def _least(box, qx, qy, qz, ux, uy, uz, more):
    """Bound the squared stretched distance of a box from below: the least distance, and the least along the stretch."""
    dx, dy, dz = (
        max(box[0] - qx, qx - box[3], 0.0),
        max(box[1] - qy, qy - box[4], 0.0),
        max(box[2] - qz, qz - box[5], 0.0),
    )
    mx, my, mz = 0.5 * (box[0] + box[3]) - qx, 0.5 * (box[1] + box[4]) - qy, 0.5 * (box[2] + box[5]) - qz
    wide = abs(ux) * (box[3] - box[0]) + abs(uy) * (box[4] - box[1]) + abs(uz) * (box[5] - box[2])
    along = max(abs(mx * ux + my * uy + mz * uz) - 0.5 * wide, 0.0)
    return (dx * dx + dy * dy + dz * dz + more * along * along) * _ROUNDING
