"""The points of the faces beside curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import knn
from edgel.curves._circle import RADIUS, along_of, offset_of

REACH = 4.5
"""Spacings: so far from a curve its faces are measured."""
BEYOND = 4.0
"""Spacings: so far past its ends is looked whether a curve goes on."""
_STEP = 1.5  # spacings between the stations where neighbours are asked for
_AROUND = 64  # points around each: all within REACH


@dataclass(frozen=True, eq=False)
class Beside:
    """Points of the cloud beside each curve, each once.

    Attributes
    ----------
    points : (G,) int64
        Points of the index.
    start : (K + 1,) int64
    """

    points: np.ndarray
    start: np.ndarray


def gather(
    index: NeighborIndex, xyz: np.ndarray, shapes: np.ndarray, ranges: np.ndarray, spacing: np.ndarray
) -> Beside:
    """Find the points (N, 3) of an index that are beside shapes (K, 13), over ranges (K, 2) along them."""
    count = len(shapes)
    low, high, _ = widened(shapes, ranges, spacing)
    number = np.maximum(np.ceil((high - low) / (_STEP * spacing)).astype(np.int64), 1)
    start = np.concatenate([[0], np.cumsum(number)])
    owner = np.repeat(np.arange(count), number)
    step = ((high - low) / number)[owner]
    along = low[owner] + (np.arange(start[-1]) - start[owner] + 0.5) * step
    places = on_shapes(shapes[owner], along)
    if not len(places):
        return Beside(np.empty(0, np.int64), np.zeros(1, np.int64))
    near = knn(index, places, min(_AROUND, len(index))).points
    kept = np.zeros(near.shape, np.bool_)
    run_slices(_keep, len(places), near, xyz, shapes, spacing, owner, along, step, kept, size=1024)
    counts = np.bincount(owner, kept.sum(axis=1), minlength=count).astype(np.int64)
    return Beside(near[kept], np.concatenate([[0], np.cumsum(counts)]))


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
def _keep(start, stop, near, xyz, shapes, spacing, owner, along, step, kept):
    """Mark the neighbours of each station that are beside it, and not beside the next one."""
    for q in range(start, stop):
        shape, h = shapes[owner[q]], spacing[owner[q]]
        around = 2.0 * np.pi * shape[RADIUS]
        for k in range(near.shape[1]):
            i = near[q, k]
            ahead = along_of(shape, xyz[i, 0], xyz[i, 1], xyz[i, 2]) - along[q]
            if around > 0.0:
                ahead -= around * np.floor(ahead / around + 0.5)
            inside = -0.5 * step[q] <= ahead < 0.5 * step[q]
            kept[q, k] = inside and offset_of(shape, xyz[i, 0], xyz[i, 1], xyz[i, 2]) < REACH * h
