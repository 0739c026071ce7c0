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
_FEWEST_SEEN = 100  # pixels that tell where a frame's rays run
_OFF_RAY = 0.3  # pixels by which nearly all of them may miss those of a pinhole camera


class Sight(NamedTuple):
    """Nearest and farthest range by direction, on an octahedron's net (Meyer et al. 2010); made by `build_sight`.

    Attributes
    ----------
    near, far : (S, S) float32
        Ranges, in the cloud's unit, the nearest of a cell and those around it; infinite and 0 where nothing returned,
        `far` -1 where it is known that the sensor looked and got nothing, and (1, 1) if no sensor is known.
    eye : (3,) float64
        Where the sensor stood.
    """

    near: np.ndarray
    far: np.ndarray
    eye: np.ndarray


def no_sight() -> Sight:
    """Return what is seen where no sensor is known: nothing, so that nothing stands in the way."""
    return Sight(np.full((1, 1), np.inf, np.float32), np.zeros((1, 1), np.float32), np.zeros(3))


def build_sight(xyz: np.ndarray, eye: np.ndarray, empty: np.ndarray | None = None) -> Sight:
    """Note the ranges of points (N, 3) as seen from a sensor's place (3,), and rays (K, 3) on which it got nothing."""
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
    if empty is not None:
        _note_empty(empty, near, far)
    return Sight(near, far, np.asarray(eye, np.float64))


def empty_rays(xyz: np.ndarray, shape: tuple[int, ...] | None, seen: np.ndarray, eye: np.ndarray) -> np.ndarray | None:
    """Return the rays (K, 3), from a sensor's place (3,), of those pixels of a frame on which it got nothing.

    The homography that takes pixels to rays is that of a pinhole camera, fitted to the pixels that saw something (the
    direct linear transform, Hartley and Zisserman 2004, 4.1). None where the cloud (H * W, 3) is no such frame.

    Parameters
    ----------
    xyz : (H * W, 3) float64
    shape : (H, W), or None of a list
    seen : (N,) int64
        Rows of the pixels that saw something.
    eye : (3,) float64
    """
    if shape is None or min(shape) < 2 or len(seen) < _FEWEST_SEEN:
        return None
    row, column = np.divmod(np.arange(len(xyz)), shape[1])
    half = np.array([shape[1], shape[0]]) / 2
    pixels = np.column_stack([column / half[0] - 1, row / half[1] - 1, np.ones(len(xyz))])
    some = seen[np.linspace(0, len(seen) - 1, min(_SAMPLE, len(seen))).astype(np.int64)]
    rays, asked = xyz[some] - eye, pixels[some]
    rays = rays / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-300)
    x, y, z = rays.T[:, :, None] * asked  # a pixel's ray and that of the camera have no cross product
    none = np.zeros_like(x)
    equations = np.concatenate([np.hstack([none, -z, y]), np.hstack([z, none, -x]), np.hstack([-y, x, none])])
    values, vectors = np.linalg.eigh(equations.T @ equations)
    camera = vectors[:, 0].reshape(3, 3)
    if not values[1] > 1e-12 * values[-1] or not np.linalg.cond(camera) < 1e12:
        return None
    camera *= np.sign(((asked @ camera.T) * rays).sum())
    back = rays @ np.linalg.inv(camera).T
    off = np.linalg.norm((back[:, :2] / back[:, 2:] - asked[:, :2]) * half, axis=1)
    if not np.quantile(off, 0.95) < _OFF_RAY:
        return None
    empty = np.ones(len(xyz), bool)
    empty[seen] = False
    return pixels[empty] @ camera.T


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
def _note_empty(directions, near, far):
    for p in range(len(directions)):
        row, column = _pixel(near.shape[0], directions[p, 0], directions[p, 1], directions[p, 2])
        if near[row, column] == np.inf:  # nothing beside it, either
            far[row, column] = -1.0


@kernel
def look(sight, x, y, z, tolerance):
    """Say what a sensor makes of a place: -1 it looked through it, 1 it stands behind what was seen, else 0.

    Where it got nothing it is 2, and 3 if it is known to have looked: what returns no light is not empty space.
    """
    dx, dy, dz = x - sight.eye[0], y - sight.eye[1], z - sight.eye[2]
    away = np.sqrt(dx * dx + dy * dy + dz * dz)
    if away == 0.0:
        return 2
    row, column = _pixel(sight.near.shape[0], dx, dy, dz)
    if sight.far[row, column] <= 0.0:
        return 2 if sight.far[row, column] == 0.0 else 3
    if away < sight.near[row, column] - tolerance:
        return -1
    return 1 if away > sight.far[row, column] + tolerance else 0
