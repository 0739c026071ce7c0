"""Which edge points belong to which shape, once shapes are measured: each takes what lies on it, the surest first."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel.curves._circle import offset_of, tangent_of
from edgel.curves._smooth import Smoothed

ASIDE = 1.2
"""Spacings: farther from a shape lies no edge point of it."""
_ALIKE = 0.7  # cosine between the tangent of an edge point and that of the shape
_OWN = 0.2  # of a shape's points: with more of them on a surer one it is no shape of its own
_FEWEST = 3
_DEVIATIONS, _NEAR = 4.0, 0.3  # of its own points, and spacings: a shape takes others so far from it
_WORSE, _LEAST_WORSE = 3.0, 0.05
"""Of its own points' deviations, and spacings: a shape takes from another what it explains so much worse, at most."""


def claim(
    shapes: np.ndarray,
    order: np.ndarray,
    both: np.ndarray,
    rows: tuple[np.ndarray, np.ndarray],
    smoothed: Smoothed,
    spacing: np.ndarray,
    owner: np.ndarray,
) -> None:
    """Write which shape owns each edge point (E,), -1 for none; those that are owned stay so.

    Shapes (K, 13) take part in the given order, with the edge points each begins from: as rows, and where each shape's
    begin. From a shape which two faces confirm, `both` (K,), others take only what they explain as well.
    """
    arrays = (smoothed.position, smoothed.tangent, smoothed.neighbors)
    home = np.full(len(owner), np.inf)
    _flood(order, shapes, both, *rows, *arrays, spacing, home, owner)


@kernel
def _flood(order, shapes, both, rows, first, position, tangent, neighbors, spacing, home, owner):
    stack = np.empty(len(owner), np.int64)
    for k in order:
        for i in rows[first[k] : first[k + 1]] if both[k] else rows[:0]:
            home[i] = min(home[i], offset_of(shapes[k], position[i, 0], position[i, 1], position[i, 2]) / spacing[i])
    for k in order:
        shape = shapes[k]
        own = rows[first[k] : first[k + 1]]
        height = 0
        square = 0.0
        for i in own:
            square += (offset_of(shape, position[i, 0], position[i, 1], position[i, 2]) / spacing[i]) ** 2
        deviation = math.sqrt(square / len(own))
        near, worse = min(max(_DEVIATIONS * deviation, _NEAR), ASIDE), max(_WORSE * deviation, _LEAST_WORSE)
        for i in own:
            if owner[i] < 0 and _belongs(shape, i, position, tangent, spacing, 1.3 * ASIDE):
                stack[height] = i
                height += 1
        if height < max(_FEWEST, _OWN * len(own)):
            continue
        for q in range(height):
            owner[stack[q]] = k
        while height > 0:
            height -= 1
            for j in neighbors[stack[height]]:
                if owner[j] < 0 and _belongs(shape, j, position, tangent, spacing, min(near, home[j] + worse)):
                    owner[j] = k
                    stack[height] = j
                    height += 1


@routine
def _belongs(shape, i, position, tangent, spacing, margin):
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    if offset_of(shape, x, y, z) > margin * spacing[i]:
        return False
    u, v, w = tangent_of(shape, x, y, z)
    return abs(u * tangent[i, 0] + v * tangent[i, 1] + w * tangent[i, 2]) > _ALIKE
