"""Organized clouds of which a file lists only the valid points, each with its cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel.cloud import Cloud


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
