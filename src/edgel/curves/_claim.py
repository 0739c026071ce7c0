"""Which edge points belong to which shape, once shapes are measured: each takes what lies on it, the surest first."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel.curves._circle import offset_of, tangent_of
from edgel.curves._smooth import Smoothed

ASIDE = 0.7
"""Spacings: farther from a shape lies no edge point of it."""
_ALIKE = 0.7  # cosine between the tangent of an edge point and that of the shape
_OWN = 0.5  # of a shape's points: with more of them on a surer one it is no shape of its own
_FEWEST = 3


def claim(
    shapes: np.ndarray,
    order: np.ndarray,
    rows: tuple[np.ndarray, np.ndarray],
    smoothed: Smoothed,
    spacing: np.ndarray,
    owner: np.ndarray,
) -> None:
    """Write which shape owns each edge point (E,), -1 for none; those that are owned stay so.

    Shapes (K, 13) take part in the given order, with the edge points each begins from: as rows, and where each shape's
    begin.
    """
    arrays = (smoothed.position, smoothed.tangent, smoothed.neighbors)
    _flood(order, shapes, *rows, *arrays, spacing, owner)


@kernel
def _flood(order, shapes, rows, first, position, tangent, neighbors, spacing, owner):
    stack = np.empty(len(owner), np.int64)
    for k in order:
        shape = shapes[k]
        own = rows[first[k] : first[k + 1]]
        height = 0
        for i in own:
            if owner[i] < 0 and _belongs(shape, i, position, tangent, spacing, 1.3):
                stack[height] = i
                height += 1
        if height < max(_FEWEST, _OWN * len(own)):
            continue
        for q in range(height):
            owner[stack[q]] = k
        while height > 0:
            height -= 1
            for j in neighbors[stack[height]]:
                if owner[j] < 0 and _belongs(shape, j, position, tangent, spacing, 1.0):
                    owner[j] = k
                    stack[height] = j
                    height += 1


@routine
def _belongs(shape, i, position, tangent, spacing, margin):
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    if offset_of(shape, x, y, z) > margin * ASIDE * spacing[i]:
        return False
    u, v, w = tangent_of(shape, x, y, z)
    return abs(u * tangent[i, 0] + v * tangent[i, 1] + w * tangent[i, 2]) > _ALIKE
