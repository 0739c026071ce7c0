"""The points of the cloud beside curves."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import routine
from edgel._neighbors.kdtree import node_start
from edgel.curves._circle import RADIUS, along_of, offset_of

BEYOND = 4.0
"""Spacings: so far past its ends is looked whether a curve goes on."""


def widened(
    shapes: np.ndarray, ranges: np.ndarray, spacing: np.ndarray, share: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return ranges with a margin, at least a share of their length, low and high, and which go all round."""
    margin = np.maximum(BEYOND * spacing, share * (ranges[:, 1] - ranges[:, 0]))
    low, high = ranges[:, 0] - margin, ranges[:, 1] + margin
    round_ = 2 * np.pi * shapes[:, RADIUS]
    whole = (round_ > 0) & ((ranges[:, 1] - ranges[:, 0] > 0.3 * round_) | (high - low >= round_))
    middle = 0.5 * (low + high)
    return np.where(whole, middle - 0.5 * round_, low), np.where(whole, middle + 0.5 * round_, high), whole


def on_shapes(shapes: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Return the places (N, 3) of shapes (N, 13) so far along (N,)."""
    origin, u, v, w = shapes[:, :3], shapes[:, 3:6], shapes[:, 6:9], shapes[:, 9:12]
    radius = shapes[:, RADIUS : RADIUS + 1]
    is_line = radius == 0
    turn = along[:, None] / np.where(is_line, 1.0, radius)
    return origin + np.where(is_line, along[:, None] * w, radius * (np.cos(turn) * u + np.sin(turn) * v))


@routine
def gather(places, boxes, shape, low, high, reach, near):
    """Write the points of a tree beside a shape, from `low` to `high` along it, as far as `near` (G, 3) has room.

    Returns how many there are. The distance from a shape changes by no more than the way that one goes, so what is
    farther from it than its radius and the reach, as the balls around the nodes of the tree are, holds none of them.
    """
    stack = np.empty(128, np.int64)
    leaves, total, number, depth = len(boxes) // 2, places.shape[1], 0, 1
    radius, middle = shape[RADIUS], 0.5 * (low + high)
    around, half = 2.0 * math.pi * radius, min(0.5 * (high - low), 2.0 * radius if radius > 0.0 else math.inf)
    u, v, w = (radius * math.cos(middle / radius), radius * math.sin(middle / radius), 0.0)
    if radius == 0.0:
        u, v, w = 0.0, 0.0, middle
    mx = shape[0] + u * shape[3] + v * shape[6] + w * shape[9]
    my = shape[1] + u * shape[4] + v * shape[7] + w * shape[10]
    mz = shape[2] + u * shape[5] + v * shape[8] + w * shape[11]
    stack[0] = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        x, y = 0.5 * (boxes[node, 0] + boxes[node, 3]), 0.5 * (boxes[node, 1] + boxes[node, 4])
        z = 0.5 * (boxes[node, 2] + boxes[node, 5])
        dx, dy, dz = boxes[node, 3] - x, boxes[node, 4] - y, boxes[node, 5] - z
        far = reach + math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = x - mx, y - my, z - mz
        if dx * dx + dy * dy + dz * dz > (half + far) ** 2 or offset_of(shape, x, y, z) > far:
            continue
        if node < leaves:
            stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node
            depth += 2
            continue
        for p in range(node_start(node - leaves, total, leaves), node_start(node - leaves + 1, total, leaves)):
            x, y, z = places[0, p], places[1, p], places[2, p]
            if offset_of(shape, x, y, z) > reach:
                continue
            along = along_of(shape, x, y, z)
            if radius > 0.0:
                along -= around * math.floor((along - low) / around)
            if low <= along <= high:
                if number < len(near):
                    near[number, 0], near[number, 1], near[number, 2] = x, y, z
                number += 1
    return number


@routine
def gather_all(places, boxes, shape, low, high, reach, near):
    """Gather all points beside a shape into `near`, a larger one where it has no room; return it, and how many."""
    number = gather(places, boxes, shape, low, high, reach, near)
    if number > len(near):
        near = np.empty((2 * number, 3))
        gather(places, boxes, shape, low, high, reach, near)
    return near, number
