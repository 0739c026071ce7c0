"""Thinning: fewer points of a cloud, evenly spaced."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel.cloud import check_points

_MOST_CELLS = 2.0**52  # that a float64 tells apart


def thin(points: Any, size: float) -> np.ndarray:
    """Choose one point of each voxel: the one nearest to its middle.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
    size : float
        Side of a voxel, in the cloud's unit, above 0; the voxels begin at the cloud's smallest coordinates.

    Returns
    -------
    (M,) int64
        Rows of the input, ascending. Which places are chosen does not depend on the order of the points.

    Raises
    ------
    TypeError, ValueError
        If `points` carries fewer than 3 finite points, or the size is not above 0.

    Examples
    --------
    >>> import numpy as np
    >>> thin(np.array([[0.0, 0, 0], [0.4, 0, 0], [2.5, 0, 0], [3.0, 3.0, 0]]), 1.0)
    array([1, 2, 3])
    """
    if not (np.isfinite(size) and size > 0):
        raise ValueError(f"size: expected a length above 0, in the cloud's unit, got {size}")
    checked = check_points(points)
    xyz = checked.xyz
    place = (xyz - xyz.min(axis=0)) / size
    cell = np.floor(place)
    voxel = number_voxels(cell)
    away = ((place - cell - 0.5) ** 2).sum(axis=1)
    least = np.full(voxel.max() + 1, np.inf)
    np.minimum.at(least, voxel, away)
    best = np.flatnonzero(away <= least[voxel])
    shared = np.bincount(voxel[best])[voxel[best]] > 1
    alone, tied = best[~shared], best[shared]
    order = tied[np.lexsort((tied, xyz[tied, 2], xyz[tied, 1], xyz[tied, 0], voxel[tied]))]
    _, first = np.unique(voxel[order], return_index=True)
    return checked.rows[np.sort(np.concatenate([alone, order[first]]))]


def number_voxels(cell: np.ndarray) -> np.ndarray:
    """Number the voxels that are occupied, of each point's cell along the axes (N, 3), at least 0; (N,) int64."""
    counts = cell.max(axis=0) + 1
    if counts.prod() < _MOST_CELLS:
        along = cell @ np.array([counts[1] * counts[2], counts[2], 1.0])
    else:  # numbered anew axis by axis, so that the numbers stay small
        along = np.zeros(len(cell), np.int64)
        for axis in range(3):
            _, places = np.unique(cell[:, axis], return_inverse=True)
            _, along = np.unique(along * (places.max() + 1) + places, return_inverse=True)
    return np.unique(along, return_inverse=True)[1]


def thin_to(xyz: np.ndarray, number: int, spacing: float) -> np.ndarray:
    """Choose at most this many of the points (N, 3), all finite, that lie evenly: one a voxel, as small as will do.

    Examples
    --------
    >>> import numpy as np
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    >>> len(thin_to(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()], 225, 1.0))
    225
    """
    rows = np.arange(len(xyz))
    size = (spacing or 1.0) * float(np.sqrt(len(rows) / number))
    while len(rows) > number:
        rows = rows[thin(xyz[rows], size)]
        size *= max(float(np.sqrt(len(rows) / number)), 1.05)
    return rows
