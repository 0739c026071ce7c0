"""The points of the faces beside curves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import NeighborIndex, node_start
from edgel.curves._circle import RADIUS, along_of, offset_of

REACH = 4.5
"""Spacings: so far from a curve its faces are measured."""
BEYOND = 4.0
"""Spacings: so far past its ends is looked whether a curve goes on."""
_ROOM = 512  # points beside a curve, on average, that there is room for to begin with
_SLICE = 32


@dataclass(frozen=True, eq=False)
class Beside:
    """Points of the cloud beside each curve.

    Attributes
    ----------
    xyz : (G, 3) float64
        In the order of the tree, curve after curve.
    start : (K + 1,) int64
    """

    xyz: np.ndarray
    start: np.ndarray


def gather(index: NeighborIndex, shapes: np.ndarray, ranges: np.ndarray, spacing: np.ndarray) -> Beside:
    """Find the points of an index that are beside shapes (K, 13), over ranges (K, 2) along them."""
    count = len(shapes)
    low, high, whole = widened(shapes, ranges, spacing)
    middle, half = on_shapes(shapes, 0.5 * (low + high)), 0.5 * (high - low)
    half = np.where(whole, 2 * shapes[:, RADIUS], half)
    counts = np.zeros(count, np.int64)
    found: dict[int, np.ndarray] = {}

    def work(start: int, stop: int) -> None:
        room = _ROOM * _SLICE
        while start not in found:
            xyz = np.empty((room, 3))
            arguments = (index.xyz, index.boxes, shapes, middle, half, low, high, spacing, counts, xyz)
            number = _gather(start, stop, *arguments)
            if number <= room:
                found[start] = xyz[:number]
            room = number

    run_slices(work, count, size=_SLICE)
    parts = [found[start] for start in range(0, count, _SLICE)]
    return Beside(np.concatenate(parts or [np.empty((0, 3))]), np.concatenate([[0], np.cumsum(counts)]))


def widened(shapes: np.ndarray, ranges: np.ndarray, spacing: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return ranges with a margin, low and high, and which go all round."""
    low, high = ranges[:, 0] - BEYOND * spacing, ranges[:, 1] + BEYOND * spacing
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


@kernel
def _gather(start, stop, places, boxes, shapes, middle, half, low, high, spacing, counts, xyz):
    """Write the points beside some shapes as far as there is room, and return how many there are.

    The distance from a shape changes by no more than the way that one goes, so what is farther from it than its radius
    and the reach, as the balls around the nodes of the tree are, holds no point beside it.
    """
    stack = np.empty(128, np.int64)
    leaves, total, number = len(boxes) // 2, places.shape[1], 0
    for k in range(start, stop):
        shape, reach, begin = shapes[k], REACH * spacing[k], number
        around, depth = 2.0 * math.pi * shape[RADIUS], 1
        stack[0] = 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            x, y = 0.5 * (boxes[node, 0] + boxes[node, 3]), 0.5 * (boxes[node, 1] + boxes[node, 4])
            z = 0.5 * (boxes[node, 2] + boxes[node, 5])
            ball = 0.5 * math.sqrt(
                (boxes[node, 3] - boxes[node, 0]) ** 2
                + (boxes[node, 4] - boxes[node, 1]) ** 2
                + (boxes[node, 5] - boxes[node, 2]) ** 2
            )
            away = math.sqrt((x - middle[k, 0]) ** 2 + (y - middle[k, 1]) ** 2 + (z - middle[k, 2]) ** 2)
            if away > half[k] + reach + ball or offset_of(shape, x, y, z) > reach + ball:
                continue
            if node < leaves:
                stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node
                depth += 2
                continue
            for p in range(node_start(node - leaves, total, leaves), node_start(node - leaves + 1, total, leaves)):
                x, y, z = places[0, p], places[1, p], places[2, p]
                if offset_of(shape, x, y, z) >= reach:
                    continue
                along = along_of(shape, x, y, z)
                if around > 0.0:
                    along -= around * math.floor((along - low[k]) / around)
                if low[k] <= along <= high[k]:
                    if number < len(xyz):
                        xyz[number, 0], xyz[number, 1], xyz[number, 2] = x, y, z
                    number += 1
        counts[k] = number - begin
    return number
