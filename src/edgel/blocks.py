"""Which blocks of eight points lie near queries: what a search looks at.

Queries that lie together look at the tree together: a chunk gathers the blocks near all of its queries, and eight of
them pick those near themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from edgel.kdtree import NeighborIndex, node_start
from edgel.lanes import LANES, bits, larger, load, spread
from edgel.parallel import kernel, part

CHUNK = 128  # queries that look at the tree together
SLACK = 1.25  # squared reach over what the queries before needed
_NEAR = 2048  # most blocks near a chunk; queries that lie wider apart look at the tree by themselves
_FEW = 192  # most blocks near eight queries; such as lie wider apart are searched alone


class Tree(NamedTuple):
    """The arrays of a `NeighborIndex`, as kernels take them: the coordinates of each axis by themselves."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    order: np.ndarray
    boxes: np.ndarray
    blocks: np.ndarray


class Queries(NamedTuple):
    """Where neighbours are asked for, in an order in which consecutive ones lie together, and their rows."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    rows: np.ndarray


def tree_of(index: NeighborIndex) -> Tree:
    """Return the arrays of an index."""
    x, y, z = index.xyz
    return Tree(x, y, z, index.order, index.boxes, index.blocks)


def queries_of(index: NeighborIndex) -> Queries:
    """Return the sorted points of an index as queries."""
    x, y, z = index.xyz
    return Queries(x, y, z, index.order)


class Room(NamedTuple):
    """Where a search keeps what it has found.

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
    """

    near: np.ndarray
    near_boxes: np.ndarray
    found: np.ndarray
    squared: np.ndarray
    queries: np.ndarray
    limits: np.ndarray


@kernel
def make_room():
    """Make room for a search."""
    return _with_room_for(_FEW, np.empty(_NEAR, np.int64), aligned(6 * _NEAR))


@kernel
def aligned(size):
    """Room that begins with a cache line: every eight that lie in two take twice as long."""
    room = np.empty(size + LANES)
    skip = -(room.ctypes.data // room.itemsize) % LANES
    return room[skip : skip + size]


@kernel
def _with_room_for(found, near, near_boxes):
    squared = aligned(LANES * LANES * found)
    return Room(near, near_boxes, np.empty(found, np.int64), squared, np.empty(3 * LANES), np.full(LANES, np.inf))


@kernel
def larger_room(room):
    """Make room for four times as many blocks near eight queries, and keep those near the chunk."""
    return _with_room_for(4 * len(room.found), room.near, room.near_boxes)


@part
def _box_distance(boxes, node, low_x, low_y, low_z, high_x, high_y, high_z):
    """Squared distance between a node's box and another box."""
    dx = max(boxes[node, 0] - high_x, low_x - boxes[node, 3], 0.0)
    dy = max(boxes[node, 1] - high_y, low_y - boxes[node, 4], 0.0)
    dz = max(boxes[node, 2] - high_z, low_z - boxes[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@kernel
def walk(tree, low_x, low_y, low_z, high_x, high_y, high_z, reach, found):
    """List the blocks of the leaves within a squared reach of a box, ascending; -1 if they are too many."""
    boxes, num_points = tree.boxes, len(tree.order)
    leaves, count, depth = boxes.shape[0] // 2, 0, 1
    stack = np.empty(64, np.int64)
    stack[0] = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if _box_distance(boxes, node, low_x, low_y, low_z, high_x, high_y, high_z) > reach:
            continue
        if node < leaves:
            stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node
            depth += 2
            continue
        first = node_start(node - leaves, num_points, leaves)
        last = node_start(node - leaves + 1, num_points, leaves)
        for block in range(first // LANES, (last + LANES - 1) // LANES):
            if count == len(found):
                return -1
            found[count] = block
            count += 1
    return count


@kernel
def sure_reach(tree, low_x, low_y, low_z, high_x, high_y, high_z, k):
    """Squared distance within which a box has k points for sure: all of some node that lies near it."""
    boxes, num_points = tree.boxes, len(tree.order)
    leaves, node, nodes = boxes.shape[0] // 2, 1, 1
    while node < leaves:
        near = _box_distance(boxes, 2 * node, low_x, low_y, low_z, high_x, high_y, high_z)
        far = _box_distance(boxes, 2 * node + 1, low_x, low_y, low_z, high_x, high_y, high_z)
        child, nodes = 2 * node + (far < near), 2 * nodes
        place = child - nodes
        if node_start(place + 1, num_points, nodes) - node_start(place, num_points, nodes) < k:
            break
        node = child
    dx = max(boxes[node, 3] - low_x, high_x - boxes[node, 0])
    dy = max(boxes[node, 4] - low_y, high_y - boxes[node, 1])
    dz = max(boxes[node, 5] - low_z, high_z - boxes[node, 2])
    return dx * dx + dy * dy + dz * dz


@kernel
def _look_round(tree, queries, first, last, reach, room):
    """Gather the blocks near the queries first..last-1; returns how many, filled up to eights, or -1."""
    low_x, low_y, low_z = np.inf, np.inf, np.inf
    high_x, high_y, high_z = -np.inf, -np.inf, -np.inf
    for q in range(first, last):
        low_x, high_x = min(low_x, queries.x[q]), max(high_x, queries.x[q])
        low_y, high_y = min(low_y, queries.y[q]), max(high_y, queries.y[q])
        low_z, high_z = min(low_z, queries.z[q]), max(high_z, queries.z[q])
    near, boxes = room.near, room.near_boxes
    count = walk(tree, low_x, low_y, low_z, high_x, high_y, high_z, reach, near[: len(near) - LANES])
    if count < 0:
        return -1
    size = len(near)
    for i in range(count):
        for side in range(6):
            boxes[side * size + i] = tree.blocks[side, near[i]]
    whole = (count + LANES - 1) // LANES * LANES
    for i in range(count, whole):  # nowhere
        near[i] = 0
        for side in range(6):
            boxes[side * size + i] = np.inf if side < 3 else -np.inf
    return whole


@part
def pick(room, near, low_x, low_y, low_z, high_x, high_y, high_z, reach):
    """List those blocks near a chunk that are near a box in it, ascending; -1 if they are too many."""
    boxes, found, size, count = room.near_boxes, room.found, len(room.near), 0
    for i in range(0, near, LANES):
        dx = larger(larger(load(boxes, i) - high_x, low_x - load(boxes, 3 * size + i)), spread(0.0))
        dy = larger(larger(load(boxes, size + i) - high_y, low_y - load(boxes, 4 * size + i)), spread(0.0))
        dz = larger(larger(load(boxes, 2 * size + i) - high_z, low_z - load(boxes, 5 * size + i)), spread(0.0))
        inside = bits(dx * dx + dy * dy + dz * dz <= reach)
        if count + LANES > len(found):
            return -1
        for lane in range(LANES):
            found[count] = room.near[i + lane]  # written in any case: no branch to guess
            count += (inside >> lane) & 1
    return count


@kernel
def look_round(tree, queries, first, last, reach, room):
    """Gather the blocks near the queries first..last-1, which lie together, for `nearest_of_eight`.

    Returns
    -------
    near, near_reach
        How many they are, and the squared reach up to which they are all there are.
    """
    if not reach < np.inf:
        return 0, -1.0
    reach *= SLACK
    near = _look_round(tree, queries, first, last, reach, room)
    return (near, reach) if near >= 0 else (0, -1.0)
