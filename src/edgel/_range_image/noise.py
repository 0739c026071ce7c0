"""The noise of a range image: how much there is around each cell, and whether neighbouring pixels share it."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.selection import quantile
from edgel._range_image.rays import Rays

CLEAN = 0.1  # spacings: noise below which it does not matter whose it is
WHITE = 0.9  # least of the noise that second differences of neighbours show: smoothed or rounded, they show less
ALIKE = 0.7  # or, in views of few cells, where structure is in most windows, least of those of pixels two apart
_FEW = 1000  # cells
_TILE = 16  # cells, over which the noise is estimated
_QUIET = 0.25  # of the windows there: most may lie on edges, and without edges all leave nearly the same
_PLACES = 1500
_LINES = 40  # rows or columns, at least, whose second differences are taken


def noise_level(left: np.ndarray) -> np.ndarray:
    """Lower quartile of what the smallest windows leave, over tiles; of 3 x 3 tiles the median."""
    tiles = tuple(-(-length // _TILE) for length in left.shape)
    level = np.empty(tiles)
    run_slices(_tile_levels, tiles[0], left, level, size=1)
    known = ~np.isnan(level)
    level = np.where(known, level, np.median(level[known]) if known.any() else 0.0)
    around = np.pad(level, 1, mode="edge")
    nine = [around[i : i + tiles[0], j : j + tiles[1]] for i in range(3) for j in range(3)]
    level = np.sort(nine, axis=0)[4]
    return level.repeat(_TILE, axis=0)[: left.shape[0]].repeat(_TILE, axis=1)[:, : left.shape[1]]


def is_white(rays: Rays, noise: np.ndarray, cell: tuple[int, int], *, median: float, num_seen: int) -> bool:
    """Whether the noise of neighbouring pixels is independent, or hardly any is there.

    Sensors that match windows, interpolate or round leave neighbours alike: their second differences, by the noise
    (I, J) around cells, are smaller than the sqrt(6) of independent noise, along some direction. `median` is the noise
    in spacings, `num_seen` the number of cells in which something is seen.
    """
    if not rays.gridded or median < CLEAN:
        return True
    for axis in (0, 1):
        if rays.apart[axis]:
            continue  # neighbours on other lines are too far
        image, level = np.moveaxis(rays.near, axis, 0), np.moveaxis(noise, axis, 0)
        lines = np.arange(0, image.shape[1], max(image.shape[1] // _LINES, 1))
        bend = np.abs(image[2:, lines] - 2 * image[1:-1, lines] + image[:-2, lines])
        rows = np.arange(1, len(image) - 1) // cell[axis]
        share = bend / level[np.ix_(rows, lines // cell[1 - axis])]
        share = share[np.isfinite(share)]
        if len(share) and np.median(share) / (0.6745 * np.sqrt(6.0)) < WHITE:
            apart = np.abs(image[4:, lines] - 2 * image[2:-2, lines] + image[:-4, lines])
            apart, bend = apart[np.isfinite(apart)], bend[np.isfinite(bend)]
            if num_seen > _FEW or not len(apart) or np.median(bend) < ALIKE * np.median(apart):
                return False
    return True


def even_places(shape: tuple[int, int]) -> np.ndarray:
    """Some `_PLACES` places (M, 2) of an image, evenly spread: where it is looked what chance does."""
    rows, cols = shape
    stride = max(int(np.sqrt(rows * cols / _PLACES)), 1)
    down, right = np.mgrid[stride // 2 : rows : stride, stride // 2 : cols : stride]
    return np.column_stack([down.ravel(), right.ravel()])


def spread(values: np.ndarray, quantile: float, normal: float) -> float:
    """Spread of what chance does, 1 or more, by a quantile of its magnitude and that of the normal distribution."""
    known = values[np.isfinite(values)]
    return max(float(np.quantile(known, quantile)) / normal, 1.0) if len(known) else 1.0


@kernel
def _tile_levels(start, stop, left, level):
    values = np.empty(_TILE * _TILE)
    for i in range(start, stop):
        for j in range(level.shape[1]):
            count = 0
            for row in range(i * _TILE, min((i + 1) * _TILE, left.shape[0])):
                for col in range(j * _TILE, min((j + 1) * _TILE, left.shape[1])):
                    if left[row, col] < np.inf:
                        values[count] = left[row, col]
                        count += 1
            level[i, j] = quantile(values, count, _QUIET) if count >= _TILE else np.nan
