"""How far apart points lie: five estimators, each for what its callers know.

They agree on evenly sampled surfaces, and differ in cost and in what they are robust to; docs/decisions.md says which
could become one where answers may change.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from edgel._kernels.grid import cell_of
from edgel._kernels.parallel import kernel, routine, run_slices
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import at_places
from edgel.cloud import check_points

DISC = 16  # nearest neighbours, the point among them, whose disc tells the area that a point stands for
SAMPLE = 4_000  # points that the spacing of a cloud is measured at
_OCTAVE = 0.25  # of its logarithm, to which it is rounded: no answer shall hang on which points were sampled
_SAMPLE = 20_000  # points whose nearest neighbours are looked for
_CELLS = 2**24  # along an axis, at most, unless there are more points
_PER_CELL = 8  # points in a cell, so that covered area is counted well


@routine
def disc_spacing(squared):
    """Root of the area a point stands for, from the disc that its 16 nearest fill; takes their squared distances."""
    k = min(len(squared), DISC)
    return math.sqrt(math.pi * squared[k - 1] / k)


def median_spacing(points: Any) -> float:
    """Return the median distance of points to their nearest neighbour, in the cloud's unit; of many points a sample.

    Points at the very place of another do not count; 0 where all are.

    Examples
    --------
    >>> import numpy as np
    >>> x, y = np.meshgrid(np.arange(10.0), np.arange(10.0))
    >>> median_spacing(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()])
    1.0
    """
    index = build_index(check_points(points).xyz)
    nearest = knn(index, at_places(index, index.evenly_sampled(_SAMPLE)), 2).distances[:, 1]
    nearest = nearest[nearest > 0]
    return float(np.median(nearest)) if len(nearest) else 0.0


def cloud_spacing(index: NeighborIndex) -> float:
    """Measure the median, over the cloud, of the root of the area that a point stands for, rounded to a fifth."""
    return rounded_spacing(disc_radii(index, index.sampled(SAMPLE)))


def disc_radii(index: NeighborIndex, places: np.ndarray) -> np.ndarray:
    """Return the root (M,) of the area that the points at some places (M,), ascending, stand for."""
    k = min(DISC, len(index))
    return np.sqrt(np.pi * knn(index, at_places(index, places), k).distances[:, -1] ** 2 / k)


def rounded_spacing(spacing: np.ndarray) -> float:
    """Take the median of what `disc_radii` says of the sampled places of a cloud, in any order, rounded to a fifth."""
    return float(2.0 ** (round(np.log2(max(float(np.median(spacing)), 1e-300)) / _OCTAVE) * _OCTAVE))


def occupied_spacing(xyz: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """Estimate the spacing of points (N, 3) seen along Z: the root of the covered area per point, in the cloud's unit.

    The covered area is counted in square cells of about 8 points each, in one pass; `lower` and `upper` (3,) are the
    corners of the points' bounding box.
    """
    extent = upper[:2] - lower[:2]
    # Of a cloud that is all but a line, the cells along it would be more than memory holds.
    cell = float(np.sqrt(_PER_CELL / len(xyz)) * np.sqrt(extent).prod())  # a product of extents may be below 1e-308
    cell = max(cell, float(extent.max()) / max(len(xyz), _CELLS))
    width, height = (max(int(np.ceil(length / cell)), 1) for length in extent)
    occupied = np.zeros(width * height, np.bool_)
    run_slices(_occupied, len(xyz), xyz, lower, upper, width, height, occupied, size=65536)
    area = float(extent[0] / width) * float(extent[1] / height)
    return float(np.sqrt(np.count_nonzero(occupied) * area / len(xyz)))


@kernel
def _occupied(start, stop, xyz, lower, upper, width, height, occupied):
    for p in range(start, stop):
        occupied[cell_of(xyz, p, lower, upper, width, height)] = True  # whoever comes first: the same is written


def covered_area(picture: np.ndarray) -> float:
    """Return the area of an image that points (N, 2) cover, in square cells of about 8 points."""
    low, extent = picture.min(axis=0), np.ptp(picture, axis=0)
    area = float(extent.prod()) or float(extent.max()) ** 2 / len(picture)
    for _ in range(4):  # a cloud that covers little of its box has more points in a cell, so cells may shrink
        cell = np.sqrt(_PER_CELL * area / len(picture))
        column, row = (np.floor((picture[:, axis] - low[axis]) / cell).astype(np.int64) for axis in (0, 1))
        counts = np.unique(row * (column.max() + 1) + column, return_counts=True)[1]
        area = float(len(counts) * cell**2)
        # Cells on the rim are only half full.
        area *= float(np.mean(np.minimum(counts / np.median(counts), 1.0)))
    return area


def pixel_spacing(x: np.ndarray, y: np.ndarray, width: int, height: int) -> float:
    """Return the spacing of points in a picture, in its pixels: the root of the covered area per point.

    Takes columns and rows (N,) float64 of the points, which lie inside it, and its size.
    """
    cell = max(np.sqrt(float(_PER_CELL) * width * height / len(x)), 1.0)
    cells = np.floor(y / cell) * np.ceil(width / cell) + np.floor(x / cell)
    occupied = np.count_nonzero(np.bincount(cells.astype(np.int64)))
    return float(np.sqrt(occupied * cell**2 / len(x)))
