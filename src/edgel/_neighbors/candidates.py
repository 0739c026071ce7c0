"""Candidates of a search: which blocks of eight points lie near queries.

Queries that lie together look at the tree together: a chunk gathers the blocks near all of its queries, and eight of
them select_blocks those near themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from edgel._kernels.parallel import part, routine
from edgel._kernels.rows import aligned
from edgel._kernels.simd import LANES, bits, larger, load, spread
from edgel._neighbors.kdtree import node_start

CHUNK = 128  # queries that look at the tree together
SLACK = 1.25  # squared reach over what the queries before needed
_NEAR = 2048  # most blocks near a chunk; queries that lie wider apart look at the tree by themselves
_FEW = 192  # most blocks near eight queries; such as lie wider apart are searched alone


class Scratch(NamedTuple):
    """The scratch buffers of a search.

    Attributes
    ----------
    near, near_boxes : (M,) int64, (6 M,) float64
        Blocks near a chunk, and their boxes, a row each of lower x, y, z, upper x, y, z.
    found : (M,) int64
        Blocks near eight queries, ascending.
    squared : (64 M,) float64
        Squared distances of each point of those blocks from the eight queries.
    queries : (24,) float64
        x, y, z of the eight queries.
    limits : (8,) float64
        Squared distance up to which points are among the k nearest of each.
    ends : (8,) float64
        Squared distance up to which at least k points lie.
    """

    near: np.ndarray
    near_boxes: np.ndarray
    found: np.ndarray
    squared: np.ndarray
    queries: np.ndarray
    limits: np.ndarray
    ends: np.ndarray


@routine
def make_scratch():
    """Make the scratch buffers of a search."""
    return _scratch_for(_FEW, np.empty(_NEAR, np.int64), aligned(6 * _NEAR))


@routine
def _scratch_for(found, near, near_boxes):
    squared = aligned(LANES * LANES * found)
    return Scratch(
        near,
        near_boxes,
        np.empty(found, np.int64),
        squared,
        np.empty(3 * LANES),
        np.full(LANES, np.inf),
        np.empty(LANES),
    )


@routine
def larger_scratch(scratch):
    """Make buffers for four times as many blocks near eight queries, and keep those near the chunk."""
    return _scratch_for(4 * len(scratch.found), scratch.near, scratch.near_boxes)


@part
def _box_distance(boxes, node, low_x, low_y, low_z, high_x, high_y, high_z):
    """Squared distance between a node's box and another box."""
    dx = max(boxes[node, 0] - high_x, low_x - boxes[node, 3], 0.0)
    dy = max(boxes[node, 1] - high_y, low_y - boxes[node, 4], 0.0)
    dz = max(boxes[node, 2] - high_z, low_z - boxes[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@part
def _same_place(boxes, node, other):
    """Whether two nodes begin at the same place."""
    return boxes[node, 0] == boxes[other, 0] and boxes[node, 1] == boxes[other, 1] and boxes[node, 2] == boxes[other, 2]


@routine
def traverse(tree, low_x, low_y, low_z, high_x, high_y, high_z, reach, k, found):
    """List the blocks of the leaves within a squared reach of a box, ascending; -1 if they are too many.

    Of leaves that lie at one place only the first with k points are listed: sensors put all that they do not see at the
    origin, and no query needs more of them.
    """
    boxes, num_points = tree.boxes, len(tree.order)
    leaves, count, depth = boxes.shape[0] // 2, 0, 1
    stack = np.empty(64, np.int64)
    stack[0], spot, at_spot = 1, 0, 0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if _box_distance(boxes, node, low_x, low_y, low_z, high_x, high_y, high_z) > reach:
            continue
        one_place = (
            boxes[node, 0] == boxes[node, 3] and boxes[node, 1] == boxes[node, 4] and boxes[node, 2] == boxes[node, 5]
        )
        if one_place and at_spot >= k and _same_place(boxes, node, spot):
            continue
        if node < leaves:
            stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node
            depth += 2
            continue
        first = node_start(node - leaves, num_points, leaves)
        last = node_start(node - leaves + 1, num_points, leaves)
        if one_place:
            at_spot = last - first + (at_spot if _same_place(boxes, node, spot) else 0)
            spot = node
        for block in range(first // LANES, (last + LANES - 1) // LANES):
            if count == len(found):
                return -1
            found[count] = block
            count += 1
    return count


@routine
def kth_distance(tree, qx, qy, qz, k):
    """Squared distance of the k-th nearest point of one query: each time the nearer child of a node first."""
    x, y, z, boxes, num_points = tree.x, tree.y, tree.z, tree.boxes, len(tree.order)
    leaves, depth, best = boxes.shape[0] // 2, 1, np.full(k, np.inf)
    stack, reaches = np.empty(64, np.int64), np.empty(64)
    stack[0], reaches[0] = 1, 0.0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if reaches[depth] >= best[k - 1]:
            continue
        if node < leaves:
            near, far = 2 * node, 2 * node + 1
            near_d = _box_distance(boxes, near, qx, qy, qz, qx, qy, qz)
            far_d = _box_distance(boxes, far, qx, qy, qz, qx, qy, qz)
            if far_d < near_d:
                near, far, near_d, far_d = far, near, far_d, near_d
            stack[depth], reaches[depth] = far, far_d
            stack[depth + 1], reaches[depth + 1] = near, near_d
            depth += 2
            continue
        for p in range(
            node_start(node - leaves, num_points, leaves), node_start(node - leaves + 1, num_points, leaves)
        ):
            dx, dy, dz = x[p] - qx, y[p] - qy, z[p] - qz
            d, slot = dx * dx + dy * dy + dz * dz, k - 1
            if d >= best[slot]:
                continue
            while slot > 0 and d < best[slot - 1]:
                best[slot] = best[slot - 1]
                slot -= 1
            best[slot] = d
    return best[k - 1]


@routine
def _gather_blocks(tree, queries, first, last, reach, k, scratch):
    """Gather the blocks near the queries first..last-1; returns how many, filled up to eights, or -1."""
    low_x, low_y, low_z = np.inf, np.inf, np.inf
    high_x, high_y, high_z = -np.inf, -np.inf, -np.inf
    x, y, z = queries.x, queries.y, queries.z
    for q in range(first, last):
        low_x, high_x = min(low_x, x[q]), max(high_x, x[q])
        low_y, high_y = min(low_y, y[q]), max(high_y, y[q])
        low_z, high_z = min(low_z, z[q]), max(high_z, z[q])
    near, boxes, blocks = scratch.near, scratch.near_boxes, tree.blocks
    count = traverse(tree, low_x, low_y, low_z, high_x, high_y, high_z, reach, k, near[: len(near) - LANES])
    if count < 0:
        return -1
    size = len(near)
    for i in range(count):
        for side in range(6):
            boxes[side * size + i] = blocks[side, near[i]]
    whole = (count + LANES - 1) // LANES * LANES
    for i in range(count, whole):  # nowhere
        near[i] = 0
        for side in range(6):
            boxes[side * size + i] = np.inf if side < 3 else -np.inf
    return whole


@part
def select_blocks(scratch, near, low_x, low_y, low_z, high_x, high_y, high_z, reach):
    """List those blocks near a chunk that are near a box in it, ascending; -1 if they are too many."""
    boxes, blocks, found, size, count = scratch.near_boxes, scratch.near, scratch.found, len(scratch.near), 0
    for i in range(0, near, LANES):
        dx = larger(larger(load(boxes, i) - high_x, low_x - load(boxes, 3 * size + i)), spread(0.0))
        dy = larger(larger(load(boxes, size + i) - high_y, low_y - load(boxes, 4 * size + i)), spread(0.0))
        dz = larger(larger(load(boxes, 2 * size + i) - high_z, low_z - load(boxes, 5 * size + i)), spread(0.0))
        inside = bits(dx * dx + dy * dy + dz * dz <= reach)
        if count + LANES > len(found):
            return -1
        for lane in range(LANES):
            found[count] = blocks[i + lane]  # written in any case: no branch to guess
            count += (inside >> lane) & 1
    return count


@routine
def gather_blocks(tree, queries, first, last, reach, k, scratch):
    """Gather the blocks near the queries first..last-1, which lie together, for `nearest_of_eight`.

    Returns
    -------
    near, near_reach
        How many they are, and the squared reach up to which they are all there are.
    """
    if not reach < np.inf:
        return 0, -1.0
    reach *= SLACK
    near = _gather_blocks(tree, queries, first, last, reach, k, scratch)
    return (near, reach) if near >= 0 else (0, -1.0)
