"""Near and far sides of outlines found on the surface, where one direction shows nearly all of a cloud."""

from __future__ import annotations

import numpy as np

from edgel._neighbors.spacing import covered_area
from edgel._range_image.range_image import viewer_axes
from edgel.edges import EdgeKind

SHOWN = 0.97  # least share of the points that the direction has to show
_DEPTH = 3.0  # spacings behind the nearest point of its pixel within which a point still shows
_REACH = 2  # pixels: what is beside an outline lies as near as that
_GAP = 3.0  # spacings: least gap among the depths around an outline point
_MOST_PIXELS = 50  # for each point


def sides(xyz: np.ndarray, direction: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Tell what lies beside outline points, seen along a direction.

    Parameters
    ----------
    xyz : (N, 3) float64
        All the points.
    direction : (3,) float64
        In which the viewer looks.
    points : (M,) int64
        The outline points.

    Returns
    -------
    (M,) uint8
        `EdgeKind.OCCLUDED` beside something much nearer to the viewer, OCCLUDING beside something much farther,
        BOUNDARY beside neither, and for all where the direction leaves too many points hidden.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(20.0))
    >>> stair = np.c_[x.ravel(), y.ravel(), 10.0 * (x.ravel() < 15)]
    >>> middle = np.flatnonzero(y.ravel() == 10)
    >>> found = sides(stair, np.array([0.0, 0.0, -1.0]), middle[[0, 14, 15, 29]])
    >>> [EdgeKind(int(flag)).name for flag in found]
    ['BOUNDARY', 'OCCLUDING', 'OCCLUDED', 'BOUNDARY']
    """
    boundary = np.full(len(points), EdgeKind.BOUNDARY, np.uint8)
    right, down, forward = viewer_axes(direction, np.array([0.0, 0.0, 1.0]))
    centred = xyz - xyz.mean(axis=0)  # far from the origin the picture would lose its digits
    picture, depth = centred @ np.column_stack([right, down]), centred @ forward
    size = float(np.sqrt(covered_area(picture) / len(picture)))
    low = picture.min(axis=0)
    extent = np.ptp(picture, axis=0)
    if not size > 0 or (extent / size + 1).prod() > _MOST_PIXELS * len(xyz) + 10_000:
        return boundary
    col, row = (np.floor((picture - low) / size + 0.5).astype(np.int64) + _REACH).T
    nearest = np.full((row.max() + 1 + _REACH, col.max() + 1 + _REACH), np.inf)
    np.minimum.at(nearest, (row, col), depth)
    if np.mean(depth - nearest[row, col] <= _DEPTH * size) < SHOWN:
        return boundary
    row, col, own = row[points], col[points], depth[points]
    reach = range(-_REACH, _REACH + 1)
    around = np.column_stack([own, *(nearest[row + r, col + c] for r in reach for c in reach)])
    around = np.sort(np.where(np.isinf(around), own[:, None], around), axis=1)  # over a slope they follow each other
    gap, own = np.diff(around, axis=1), own[:, None]
    nearer = np.where(around[:, 1:] <= own, gap, 0).max(axis=1)
    farther = np.where(around[:, :-1] >= own, gap, 0).max(axis=1)
    far = np.where(nearer > _GAP * size, EdgeKind.OCCLUDED, EdgeKind.BOUNDARY)
    return np.where((farther > _GAP * size) & (farther > nearer), EdgeKind.OCCLUDING, far).astype(np.uint8)
