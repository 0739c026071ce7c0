"""What a sensor saw in each direction: whether something would stand in the way of what it measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn

_PIXEL = 1.6  # distances between neighbouring rays, side of a cell: no holes where the sensor saw something
_LARGEST = 4096  # cells along a side
_SAMPLE = 2000


class Sight(NamedTuple):
    """Nearest and farthest range by direction, on an octahedron's net (Meyer et al. 2010); made by `build_sight`.

    Attributes
    ----------
    near, far : (S, S) float32
        Ranges, in the cloud's unit, the nearest of a cell and those around it; infinite and 0 where nothing returned,
        and (1, 1) if no sensor is known.
    eye : (3,) float64
        Where the sensor stood.
    """

    near: np.ndarray
    far: np.ndarray
    eye: np.ndarray


def no_sight() -> Sight:
    """Return what is seen where no sensor is known: nothing, so that nothing stands in the way."""
    return Sight(np.full((1, 1), np.inf, np.float32), np.zeros((1, 1), np.float32), np.zeros(3))


def build_sight(xyz: np.ndarray, eye: np.ndarray) -> Sight:
    """Note the ranges of points (N, 3) as seen from a sensor's place (3,)."""
    away = xyz - eye
    ranges = np.sqrt((away**2).sum(axis=1))
    away, ranges = away[ranges > 0], ranges[ranges > 0]
    directions = away / ranges[:, None]
    index = build_index(directions)
    sample = index.evenly_sampled(_SAMPLE)
    # Across a sensor's lines, which may lie farther apart than the shots along them, gaps are no returns.
    apart = float(np.median(knn(index, index.at(sample), min(4, len(index))).distances[:, -1]))
    side = int(np.clip(3.54 / (_PIXEL * max(apart, 1e-9)), 16, _LARGEST))  # 4 cells' areas tile the sphere's 4 pi
    near, far = np.full((side, side), np.inf, np.float32), np.zeros((side, side), np.float32)
    _note(directions, ranges, near, far)
    return Sight(near, far, np.asarray(eye, np.float64))


@routine
def _pixel(side, x, y, z):
    """Row and column of a direction, of any length, on the octahedron's net."""
    total = abs(x) + abs(y) + abs(z)
    u, v = x / total, y / total
    if z < 0.0:
        u, v = (1.0 - abs(v)) * (1.0 if u >= 0.0 else -1.0), (1.0 - abs(u)) * (1.0 if v >= 0.0 else -1.0)
    row = min(max(int((0.5 * v + 0.5) * side), 0), side - 1)
    return row, min(max(int((0.5 * u + 0.5) * side), 0), side - 1)


@kernel
def _note(directions, ranges, near, far):
    last = near.shape[0] - 1
    for p in range(len(ranges)):
        row, column = _pixel(near.shape[0], directions[p, 0], directions[p, 1], directions[p, 2])
        far[row, column] = max(far[row, column], ranges[p])
        for r in range(max(row - 1, 0), min(row + 1, last) + 1):  # a ray beside an outline may have passed it
            for c in range(max(column - 1, 0), min(column + 1, last) + 1):
                near[r, c] = min(near[r, c], ranges[p])


@kernel
def look(sight, x, y, z, tolerance):
    """Say what a sensor makes of a place: -1 it looked through it, 1 it stands behind what was seen, 2 unknown, else 0.

    Where it saw nothing nothing is known: surfaces that return no light are not empty space.
    """
    dx, dy, dz = x - sight.eye[0], y - sight.eye[1], z - sight.eye[2]
    away = np.sqrt(dx * dx + dy * dy + dz * dz)
    if away == 0.0:
        return 2
    row, column = _pixel(sight.near.shape[0], dx, dy, dz)
    if sight.far[row, column] == 0.0:
        return 2
    if away < sight.near[row, column] - tolerance:
        return -1
    return 1 if away > sight.far[row, column] + tolerance else 0
