"""Organized clouds of which a file lists only the valid points, each with its cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel.cloud import Cloud

_EMPTIEST = 20  # cells for each point: indices that leave more of a grid empty are some other numbers


def grid_of(row: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, tuple[int, int]] | None:
    """Return the point of each cell (-1: none), row by row, and the shape; None where indices (N,), N > 0, are no grid.

    Examples
    --------
    >>> grid_of(np.array([7, 8, 8]), np.array([1, 1, 2]))
    (array([ 0, -1,  1,  2]), (2, 2))
    """
    low = int(row.min()), int(column.min())
    shape = int(row.max()) - low[0] + 1, int(column.max()) - low[1] + 1
    if min(shape) < 2 or shape[0] * shape[1] > _EMPTIEST * len(row):
        return None
    index = np.full(shape[0] * shape[1], -1)
    index[(row - low[0]) * shape[1] + (column - low[1])] = np.arange(len(row))
    return (index, shape) if np.count_nonzero(index >= 0) == len(row) else None


def in_cells(cloud: Cloud, index: np.ndarray, shape: tuple[int, int]) -> Cloud:
    """Put points into the cells of a grid; the other cells become NaN (attributes that have no NaN: 0).

    Parameters
    ----------
    cloud : Cloud
        The points.
    index : (rows * columns,) int64
        Which of them each cell holds, row by row; -1 = none.
    shape : (int, int)
        Rows and columns.

    Examples
    --------
    >>> in_cells(Cloud(np.eye(3)), np.array([2, -1, 0, 1]), (2, 2)).xyz[:, 2].tolist()
    [1.0, nan, 0.0, 0.0]
    """
    filled = index >= 0
    xyz = np.full((len(index), 3), np.nan)
    xyz[filled] = cloud.xyz[index[filled]]
    attributes = {}
    for name, values in cloud.attributes.items():
        missing = np.nan if values.dtype.kind == "f" else 0
        attributes[name] = np.full((len(index), *values.shape[1:]), missing, values.dtype)
        attributes[name][filled] = values[index[filled]]
    return replace(cloud, xyz=xyz, attributes=attributes, shape=shape)
