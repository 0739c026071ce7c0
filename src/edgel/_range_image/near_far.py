"""Near and far sides of outlines found on the surface, where one direction shows nearly all of a cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.spacing import covered_area
from edgel._range_image.range_image import viewer_axes
from edgel.edges import EdgeKind

SHOWN = 0.97  # least share of the points that the direction has to show
DEPTH = 3.0  # spacings behind the nearest point of its pixel within which a point still shows
_REACH = 2  # pixels: what is beside an outline lies as near as that
_GAP = 3.0  # spacings: least gap among the depths around an outline point
_FAR = 2 * _REACH + 1  # least number of depths beyond the gap
_STEPS = 2  # in which the size of a pixel doubles
_MOST_PIXELS = 50  # for each point


def sides(xyz: np.ndarray, direction: np.ndarray, points: np.ndarray, size: float) -> np.ndarray:
    """Tell what lies beside outline points, seen along a direction.

    Parameters
    ----------
    xyz : (N, 3) float64
        All the points.
    direction : (3,) float64
        In which the viewer looks.
    points : (M,) int64
        The outline points.
    size : float
        Of a pixel: see `pixel_size`.

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
    >>> found = sides(stair, np.array([0.0, 0.0, -1.0]), middle[[0, 14, 15, 29]], 1.0)
    >>> [EdgeKind(int(flag)).name for flag in found]
    ['BOUNDARY', 'OCCLUDING', 'OCCLUDED', 'BOUNDARY']
    """
    raster = _rastered(xyz, direction, size)
    if raster is None or raster.shown.mean() < SHOWN:
        return np.full(len(points), EdgeKind.BOUNDARY, np.uint8)
    return sides_in(raster, points)


def sides_in(raster: Raster, points: np.ndarray) -> np.ndarray:
    """Tell what lies beside outline points (M,) in a picture, (M,) uint8: see `sides`."""
    nearest, size = raster.nearest, raster.size
    row, col, own = raster.row[points], raster.col[points], raster.depth[points]
    reach = range(-_REACH, _REACH + 1)
    around = np.column_stack([own, *(nearest[row + r, col + c] for r in reach for c in reach)])
    around = np.sort(around, axis=1)  # over a slope depths follow each other
    filled = np.isfinite(around)
    gap = np.where(filled[:, 1:], np.diff(np.where(filled, around, 0), axis=1), 0)
    # A rim that bends away from the viewer leaves gaps too, before a few pixels and then nothing.
    gap[filled[:, 1:][:, ::-1].cumsum(axis=1)[:, ::-1] < _FAR] = 0
    own = own[:, None]
    nearer = np.where(around[:, 1:] <= own, gap, 0).max(axis=1)
    farther = np.where(around[:, :-1] >= own, gap, 0).max(axis=1)
    far = np.where(nearer > _GAP * size, EdgeKind.OCCLUDED, EdgeKind.BOUNDARY)
    return np.where((farther > _GAP * size) & (farther > nearer), EdgeKind.OCCLUDING, far).astype(np.uint8)


def explaining_direction(sample: np.ndarray, directions: list[np.ndarray]) -> np.ndarray | None:
    """Return the first direction that shows nearly all of a sample (M, 3) of a cloud's points, None if none does."""
    for direction in directions:
        raster = _rastered(sample, direction, _size_of(sample, direction))
        if raster is not None and raster.shown.mean() >= SHOWN:
            return direction
    return None


@dataclass(frozen=True, eq=False)
class Raster:
    """Points seen along a direction."""

    row: np.ndarray  # (N,) int64, of the pixel of each point
    col: np.ndarray
    depth: np.ndarray  # (N,) float64
    nearest: np.ndarray  # (H, W) float64: least depth in each pixel, inf where it is empty
    size: float  # of a pixel

    @property
    def shown(self) -> np.ndarray:
        """Whether each point (N,) lies in the layer nearest to the viewer."""
        return self.depth - self.nearest[self.row, self.col] <= DEPTH * self.size


def pixel_size(spacing: float) -> float:
    """Return the size of a pixel for points some spacing apart, in whole steps: what is far away must not matter."""
    return 2.0 ** (round(_STEPS * np.log2(spacing)) / _STEPS) if spacing > 0 else 0.0


def _size_of(sample: np.ndarray, direction: np.ndarray) -> float:
    """Return the size of a pixel that holds one of the points (M, 3) of a sample, where any are."""
    right, down, _ = viewer_axes(direction, np.array([0.0, 0.0, 1.0]))
    return pixel_size(float(np.sqrt(covered_area(sample @ np.column_stack([right, down])) / len(sample))))


def spreads_thin(extent: np.ndarray, size: float, count: int) -> bool:
    """Whether a picture of some extent (2,) has too many pixels for so many points."""
    return not size > 0 or (extent / size + 1).prod() > _MOST_PIXELS * count + 10_000


def _rastered(xyz: np.ndarray, direction: np.ndarray, size: float) -> Raster | None:
    """Project points along a direction; None if they spread too thin."""
    right, down, forward = viewer_axes(direction, np.array([0.0, 0.0, 1.0]))
    picture, depth = xyz @ np.column_stack([right, down]), xyz @ forward
    return None if spreads_thin(np.ptp(picture, axis=0), size, len(xyz)) else raster(picture, depth, size)


def raster(picture: np.ndarray, depth: np.ndarray, size: float) -> Raster:
    """Put points with places (N, 2) in a picture and depths (N,) into its pixels, which have fixed corners."""
    pixel = np.floor(picture / size + 0.5)
    col, row = (pixel - pixel.min(axis=0) + _REACH).astype(np.int64).T
    nearest = np.full((row.max() + 1 + _REACH, col.max() + 1 + _REACH), np.inf)
    np.minimum.at(nearest, (row, col), depth)
    return Raster(row, col, depth, nearest, size)
