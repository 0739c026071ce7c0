"""Facets: a plane in windows of several sizes around every cell of a range image, by summed-area tables.

The facet model of Haralick (1984, doi:10.1109/TPAMI.1984.4767475). A cell is a few pixels; tables of the sums of the
regression's products (Crow 1984, doi:10.1145/800031.808600) give any window at the same cost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel._range_image.noise import is_white, noise_level
from edgel._range_image.rays import Rays

HALVES = np.array([1, 3, 5])
"""Half sizes of the windows, in cells: they are 2 h + 1 cells wide."""
CELL = 2  # pixels along each side
FULL = 0.6  # least share of a window that has to be seen
FINEST = 0.01  # spacings: least noise; below, float32 rounds
_USUAL = 0.25  # of the larger windows: of a view full of parts, most lie on edges
_BAND = 48  # rows of cells
_SUMS = 11  # q q^T (6), q near (3), near near, number


@dataclass(frozen=True, eq=False)
class Facets:
    """Planes in windows around the cells of a range image.

    Attributes
    ----------
    ray : (4, I, J) float32
        Mean ray of what is seen in each cell, and its mean `near`; 0 where nothing is.
    plane : (S, 4, I, J) float32
        For each of `HALVES` the plane m, and the root mean square of what it leaves; infinite where too little is seen.
    noise : (I, J) float32
        Standard deviation of `near` around each cell, from the smallest windows.
    ratio : (S,) float64
        By how much more larger windows leave, in the lower quartile: low-frequency noise.
    cell : (int, int)
        Rows and columns of pixels of a cell.
    stretch : float
        Height of a pixel over its width.
    median_noise : float
        Median of the noise, in spacings.
    white : bool
        Whether the noise of neighbouring pixels is independent, or hardly any is there.
    """

    ray: np.ndarray
    plane: np.ndarray
    noise: np.ndarray
    ratio: np.ndarray
    cell: tuple[int, int]
    stretch: float
    median_noise: float
    white: bool


def fit_facets(rays: Rays) -> Facets:
    """Fit planes in windows of `HALVES` around every cell."""
    stretch = rays.pitch[0] / rays.pitch[1]
    # Lines of a spinning sensor lie farther apart than its shots: cells are as wide as they are high.
    cell = (CELL, CELL) if 0.67 < stretch < 1.5 else _stretched(stretch)
    shape = (-(-rays.near.shape[0] // cell[0]), -(-rays.near.shape[1] // cell[1]))
    ray, plane = np.empty((4, *shape), np.float32), np.empty((len(HALVES), 4, *shape), np.float32)
    run_slices(_fit, shape[0], rays.ray, rays.near, cell, HALVES, FULL, ray, plane, size=_BAND)
    seen = ray[3 if rays.central else 2] > 0
    spacing = rays.spacing(np.where(seen, ray[3], np.nan))
    noise = np.fmax(noise_level(plane[0, 3]), FINEST * spacing).astype(np.float32)
    few = np.zeros(shape, bool)
    few[::2, ::2] = seen[::2, ::2]
    median = float(np.median(noise[few] / spacing[few])) if few.any() else 0.0
    ratio = [1.0]
    for left in plane[1:, 3]:
        fitted = few & np.isfinite(left)
        ratio.append(max(float(np.quantile(left[fitted] / noise[fitted], _USUAL)), 1.0) if fitted.any() else 1.0)
    white = is_white(rays, noise, cell, median=median, num_seen=int(np.count_nonzero(seen)))
    return Facets(ray, plane, noise, np.array(ratio), cell, stretch, median, white)


def _stretched(stretch: float) -> tuple[int, int]:
    return (1, int(np.clip(round(stretch), 1, 8))) if stretch > 1 else (int(np.clip(round(1 / stretch), 1, 8)), 1)


@kernel
def _fit(start, stop, rays, near, cell, halves, full, ray, plane):
    """Fit the windows around some rows of cells, from a table of sums of these rows and those within reach."""
    reach = 0
    for half in halves:
        reach = max(reach, half)
    rows, cols = ray.shape[1], ray.shape[2]
    first, last = max(start - reach, 0), min(stop + reach, rows)
    # Columns on either side repeat the table's rim, so that no window has to be cut off.
    table = np.zeros((_SUMS, last - first + 1, cols + 1 + 2 * reach))
    for i in range(first, last):
        _sum_row(i, rays, near, cell, ray, i >= start and i < stop, table, i - first + 1, reach)
    box, fitted = np.empty((_SUMS, cols)), np.empty((4, cols), np.float32)
    for s in range(len(halves)):
        half = halves[s]
        least = full * (2 * half + 1) ** 2 * cell[0] * cell[1]
        for i in range(start, stop):
            top, bottom = max(i - half, first) - first, min(i + half + 1, last) - first
            for k in range(_SUMS):
                for j in range(cols):
                    a, b = j + reach - half, j + reach + half + 1
                    box[k, j] = table[k, bottom, b] - table[k, top, b] - table[k, bottom, a] + table[k, top, a]
            _regress(box, least, fitted)
            for k in range(4):
                for j in range(cols):
                    plane[s, k, i, j] = fitted[k, j]


@routine
def _sum_row(i, rays, near, cell, ray, own, table, row, reach):
    """Add a row of cells to the table; where it is the caller's own, note the mean rays."""
    height, width = near.shape
    cols = ray.shape[2]
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = s9 = s10 = 0.0
    for j in range(cols):
        sx = sy = sz = sd = 0.0
        n = 0.0
        for r in range(i * cell[0], min((i + 1) * cell[0], height)):
            for c in range(j * cell[1], min((j + 1) * cell[1], width)):
                d = np.float64(near[r, c])
                if d != d:
                    continue
                x, y, z = np.float64(rays[r, c, 0]), np.float64(rays[r, c, 1]), np.float64(rays[r, c, 2])
                s0 += x * x
                s1 += x * y
                s2 += x * z
                s3 += y * y
                s4 += y * z
                s5 += z * z
                s6 += x * d
                s7 += y * d
                s8 += z * d
                s9 += d * d
                n += 1.0
                sx += x
                sy += y
                sz += z
                sd += d
        s10 += n
        if own:
            scale = 1.0 / n if n > 0 else 0.0
            ray[0, i, j], ray[1, i, j], ray[2, i, j], ray[3, i, j] = sx * scale, sy * scale, sz * scale, sd * scale
        at = j + reach + 1
        table[0, row, at] = table[0, row - 1, at] + s0
        table[1, row, at] = table[1, row - 1, at] + s1
        table[2, row, at] = table[2, row - 1, at] + s2
        table[3, row, at] = table[3, row - 1, at] + s3
        table[4, row, at] = table[4, row - 1, at] + s4
        table[5, row, at] = table[5, row - 1, at] + s5
        table[6, row, at] = table[6, row - 1, at] + s6
        table[7, row, at] = table[7, row - 1, at] + s7
        table[8, row, at] = table[8, row - 1, at] + s8
        table[9, row, at] = table[9, row - 1, at] + s9
        table[10, row, at] = table[10, row - 1, at] + s10
    for k in range(_SUMS):
        for at in range(cols + reach + 1, table.shape[2]):
            table[k, row, at] = table[k, row, cols + reach]


@routine
def _regress(box, least, fitted):
    """Planes of windows from their sums: LDL^T of the normal equations, without a branch so that it runs on SIMD."""
    for j in range(box.shape[1]):
        n = box[10, j]
        enough = n >= least and box[5, j] > 0.0
        m22 = box[5, j] if enough else 1.0
        l1, l0 = box[4, j] / m22, box[2, j] / m22
        m11 = box[3, j] - l1 * box[4, j]
        m01 = box[1, j] - l0 * box[4, j]
        m00 = box[0, j] - l0 * box[2, j]
        b2 = box[8, j]
        b1, b0 = box[7, j] - l1 * b2, box[6, j] - l0 * b2
        enough = enough and m11 > 0.0
        m11 = m11 if enough else 1.0
        k = m01 / m11
        m00 -= k * m01
        b0 -= k * b1
        enough = enough and m00 > 0.0
        m00 = m00 if enough else 1.0
        x0 = b0 / m00
        x1 = (b1 - m01 * x0) / m11
        x2 = (b2 - box[4, j] * x1 - box[2, j] * x0) / m22
        rest = box[9, j] - x0 * box[6, j] - x1 * box[7, j] - x2 * b2
        rest = np.sqrt(max(rest, 0.0) / max(n - 3.0, 1.0))
        fitted[0, j], fitted[1, j], fitted[2, j] = x0, x1, x2
        fitted[3, j] = rest if enough else np.inf
