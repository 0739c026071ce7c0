"""From points to a raster and back: the vertical projection of the paper (steps 1-3) and its inverse (step 8).

Rasters are ``[row, col]``; row 0 lies at the smallest y. The paper counts columns i and rows j from 1, the code from 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.grid import cell_of
from edgel._kernels.parallel import kernel, part, run_slices

_PARTS = 4  # of the points, drawn at once


@dataclass(frozen=True)
class PixelGrid:
    """Where the pixels of a vertical projection lie in the cloud's x and y.

    Attributes
    ----------
    width, height : int
        Number of columns (x) and rows (y) over the cloud's bounding box.
    lower, upper : (3,) float64
        Corners of the cloud's bounding box, in its unit.
    frame : int
        Further columns and rows of empty pixels on every side of the image.
    """

    width: int
    height: int
    lower: np.ndarray
    upper: np.ndarray
    frame: int = 0

    @property
    def pixel(self) -> tuple[float, float]:
        """Size of a pixel along x and y, in the cloud's unit."""
        extent = self.upper - self.lower
        return float(extent[0] / self.width), float(extent[1] / self.height)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper border of the image, its frame with it, in the cloud's unit."""
        across, along = self.frame * self.pixel[0], self.frame * self.pixel[1]
        (left, low, _), (right, high, _) = self.lower.tolist(), self.upper.tolist()
        return left - across, right + across, low - along, high + along

    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the x of all columns' corners (W,), the frame's too, and the y of all rows' (H,): eq. 18-19."""
        extent = self.upper - self.lower
        counts = (self.width, self.height)
        places = (np.arange(-self.frame, count + self.frame) for count in counts)
        across, along = (place * extent[axis] / counts[axis] + self.lower[axis] for axis, place in enumerate(places))
        return across, along

    def centres(self, rows: np.ndarray, cols: np.ndarray) -> np.ndarray:
        """Return x and y (M, 2) of the middle of pixels of the image."""
        places = np.column_stack([cols, rows]) - self.frame + 0.5
        return places * self.pixel + self.lower[:2]


@dataclass(frozen=True, eq=False)
class BackProjection:
    """The points that the edge pixels point at.

    Attributes
    ----------
    rows : (E,) int64
        Rows of the points, ascending, each once.
    strength : (E,) float64
        Mean of the magnitude over the edge pixels whose window holds the point.
    """

    rows: np.ndarray
    strength: np.ndarray


def pixel_coordinates(xyz: np.ndarray, grid: PixelGrid) -> np.ndarray:
    """Give each point its pixel (eq. 3-4), flat: ``row * width + col``, counted from 0.

    Cells are half-open; the points at xmax and ymax, which the equations put into column W + 1 and row H + 1, belong to
    the last ones.

    Parameters
    ----------
    xyz : (N, 3) float64
    grid : PixelGrid

    Returns
    -------
    (N,) int64
    """
    pixels = np.empty(len(xyz), np.int64)
    run_slices(_pixels, len(xyz), xyz, grid.lower, grid.upper, grid.width, grid.height, pixels, size=65536)
    return pixels


def grey_values(z: np.ndarray, lower: float, upper: float, gray_min: float) -> np.ndarray:
    """Map heights to grey (eq. 5): `gray_min` at the lowest, 255 at the highest; 255 everywhere if they are equal."""
    if upper == lower:
        return np.full(z.shape, 255.0)
    return gray_min + (255.0 - gray_min) * (z - lower) / (upper - lower)


def project(xyz: np.ndarray, grid: PixelGrid) -> np.ndarray:
    """Project points vertically (eq. 1-2) and keep in each pixel the height nearest the viewer, the highest z.

    Returns
    -------
    (H, W) float64
        NaN where no point falls.
    """
    pixels = grid.height * grid.width
    # Each part of the points has an image of its own, so that they are drawn at once, where images are the smaller.
    parts = _PARTS if _PARTS * pixels < len(xyz) else 1
    size = -(-len(xyz) // parts)
    images = np.full((parts, pixels), -np.inf)
    run_slices(_highest, len(xyz), size, xyz, grid.lower, grid.upper, grid.width, grid.height, images, size=size)
    highest = images.max(axis=0)
    highest[np.isneginf(highest)] = np.nan
    return highest.reshape(grid.height, grid.width)


def grey_image(depth: np.ndarray, grid: PixelGrid, gray_min: float) -> np.ndarray:
    """Paint the grey value of each pixel's height (eq. 6), 0 where no point falls; (H, W) float64."""
    return np.nan_to_num(grey_values(depth, float(grid.lower[2]), float(grid.upper[2]), gray_min))


def back_project(
    xyz: np.ndarray, grid: PixelGrid, edges: np.ndarray, magnitude: np.ndarray, tolerance: float
) -> BackProjection:
    """Find the points of the edge pixels (eq. 18-19 and the paper's Code 1, corrected).

    A point belongs to pixel (i, j) when ``|x - x_i| < tolerance`` and ``|y - y_j| < tolerance``, where ``x_i, y_j`` is
    the pixel's corner of eq. 18-19. Code 1 goes through all points for every edge pixel and lists a point again for
    every window that holds it; here the pixels are counted for every point, in O(points + pixels), each point once.

    Parameters
    ----------
    xyz : (N, 3) float64
    grid : PixelGrid
    edges : (H, W) bool
        The frame of the grid with it.
    magnitude : (H, W) float64
    tolerance : float
        Half the side of the window, in the cloud's unit.
    """
    counts = _summed(edges.astype(np.int64))
    totals = _summed(np.where(edges, magnitude, 0.0))
    # Most pixels lie so far from all edges that no point in them can be near one: two more pixels than the tolerance,
    # one since a point lies right of its pixel's corner, one for rounding.
    frame = slice(grid.frame, -grid.frame or None)
    close = _grown(edges, *(int(min(tolerance / side, 1e6)) + 2 for side in grid.pixel))[frame, frame]
    rows = _in_any(xyz, grid, close)
    strength, scales = np.empty(len(rows)), tuple(1.0 / side for side in grid.pixel)
    run_slices(
        _window_means, len(rows), xyz, rows, *grid.corners(), scales, counts, totals, tolerance, strength, size=8192
    )
    hit = strength >= 0
    return BackProjection(rows[hit], strength[hit])


def points_near(xyz: np.ndarray, grid: PixelGrid, rows: np.ndarray, distance: float) -> np.ndarray:
    """Find all points that may lie within a distance of some of them in the projection, and so in space.

    Parameters
    ----------
    xyz : (N, 3) float64
    grid : PixelGrid
    rows : (M,) int64
    distance : float
        In the cloud's unit. Points farther away may be found too, as far as the next pixel.

    Returns
    -------
    (K,) int64
        Rows, ascending.
    """
    pixels = np.zeros(grid.height * grid.width, np.bool_)
    pixels[pixel_coordinates(xyz[rows], grid)] = True
    across, along = (int(min(distance / side * (1 + 1e-9), 1e6)) + 1 for side in grid.pixel)
    return _in_any(xyz, grid, _grown(pixels.reshape(grid.height, grid.width), across, along))


def _in_any(xyz: np.ndarray, grid: PixelGrid, pixels: np.ndarray) -> np.ndarray:
    """Find the points in any pixel that is set (H, W); their rows, ascending."""
    found, at = np.empty(len(xyz), np.bool_), (grid.lower, grid.upper, grid.width, grid.height)
    run_slices(_in_pixels, len(xyz), xyz, *at, np.ascontiguousarray(pixels).ravel(), found, size=65536)
    return np.flatnonzero(found)


def _grown(pixels: np.ndarray, across: int, along: int) -> np.ndarray:
    """Set all pixels of an (H, W) mask within so many columns and rows of one that is set."""
    height, width = pixels.shape
    across, along = min(across, width), min(along, height)
    counts = _summed(np.pad(pixels, ((along, along), (across, across))).astype(np.int64))
    tall, wide = 2 * along + 1, 2 * across + 1
    return counts[tall:, wide:] - counts[:-tall, wide:] > counts[tall:, :-wide] - counts[:-tall, :-wide]


def _summed(values: np.ndarray) -> np.ndarray:
    """Summed-area table with a leading row and column of zeros: any window's sum from four of its entries."""
    sums = np.zeros((values.shape[0] + 1, values.shape[1] + 1), values.dtype)
    inner = sums[1:, 1:]
    np.cumsum(values, axis=0, out=inner)
    np.cumsum(inner, axis=1, out=inner)
    return sums


@kernel
def _pixels(start, stop, xyz, lower, upper, width, height, pixels):
    for p in range(start, stop):
        pixels[p] = cell_of(xyz, p, lower, upper, width, height)


@kernel
def _in_pixels(start, stop, xyz, lower, upper, width, height, pixels, found):
    for p in range(start, stop):
        found[p] = pixels[cell_of(xyz, p, lower, upper, width, height)]


@kernel
def _highest(start, stop, size, xyz, lower, upper, width, height, images):
    highest = images[start // size]
    for p in range(start, stop):
        pixel = cell_of(xyz, p, lower, upper, width, height)
        highest[pixel] = max(highest[pixel], xyz[p, 2])  # a branch, often guessed wrong, took three times as long


@part
def _clamped(number, most):
    """Return a number as a whole one from 0 to `most`, 0 where it is none: beyond int64 the cast would be anything."""
    if not number > 0.0:
        return 0
    return int(number) if number < most else most


@part
def _window(value, corners, scale, tolerance):
    """First and one past the last of the pixels of an axis whose corner is nearer than the tolerance."""
    end = len(corners) - 1
    first = _clamped((value - tolerance - corners[0]) * scale, end)
    last = min(_clamped((value + tolerance - corners[0]) * scale, end) + 1, end)
    # The product only guesses; whether a corner counts is decided by the very comparison of Code 1.
    while first <= last and not abs(value - corners[first]) < tolerance:
        first += 1
    while last >= first and not abs(value - corners[last]) < tolerance:
        last -= 1
    return first, last + 1


@kernel
def _window_means(start, stop, xyz, rows, across, along, scales, counts, totals, tolerance, means):
    right_scale, up_scale = scales
    for i in range(start, stop):
        left, right = _window(xyz[rows[i], 0], across, right_scale, tolerance)
        low, high = _window(xyz[rows[i], 1], along, up_scale, tolerance)
        count = counts[high, right] - counts[low, right] - counts[high, left] + counts[low, left]
        if count > 0:
            total = totals[high, right] - totals[low, right] - totals[high, left] + totals[low, left]
            means[i] = max(total, 0.0) / count
        else:
            means[i] = -1.0
