"""Facets: a plane for each pixel of a depth image, fitted to its own side of whatever edge is near.

The facet model of Haralick (1984, doi:10.1109/TPAMI.1984.4767475), with windows chosen as Nagao & Matsuyama (1979,
doi:10.1016/0146-664X(79)90003-3) do: among many around the pixel, the one that its surface fills.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._range_image.range_image import RangeImage

SECTORS = 16
WINDOWS = np.array([SECTORS, 7, 3])
"""Sectors of a pixel's windows: all around; on one side of any straight edge; in any right angle."""
PREFER = np.array([0.0, 0.1, 0.3])
"""By how much a window's variance counts more: of two that fit alike, the larger one averages more noise away."""
_PRIOR = 4  # pixels that the noise level stands for in a window's variance
_STRAY_SIGMAS = 4.0
_CLOSE = 3.0  # spacings, and standard deviations, within which neighbours hold a pixel
_TILE = 16  # pixels


def noise_level(image: RangeImage) -> np.ndarray:
    """Estimate the standard deviation of the depth's noise around each pixel; (H, W) float64, the cloud's unit.

    From second differences, which a plane does not have, by their median over tiles, which steps and outliers hardly
    move.
    """
    tiles = tuple(-(-length // _TILE) for length in image.shape)
    level = np.empty(tiles)
    run_slices(_tile_levels, tiles[0], image.depth, image.viewpoint is not None, level, size=4)
    known = ~np.isnan(level)
    level[~known] = np.median(level[known]) if known.any() else 0.0
    # The median of the mean of two bends, each of deviation sqrt(6) sigma, is 1.85 sigma.
    level = (level / 1.85).repeat(_TILE, axis=0)[: image.shape[0]]
    return level.repeat(_TILE, axis=1)[:, : image.shape[1]]


def without_isolated(depth: np.ndarray, spacing: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Drop pixels that fewer than 4 of their 24 neighbours hold: points floating alone."""
    kept = np.full(depth.shape, np.nan)
    run_slices(_without_isolated, len(depth), depth, _CLOSE * (spacing + noise), kept, size=32)
    return kept


def local_planes(depth: np.ndarray, noise: np.ndarray, pixels: np.ndarray, perspective: bool, reach: int) -> np.ndarray:
    """Fit a plane to some pixels' own side of whatever edge is near.

    Parameters
    ----------
    depth, noise : (H, W) float64
    pixels : (M,) int64
        Places in the flat image; their depths are known.
    perspective : bool
        Whether the rays leave a viewpoint, else they are parallel.
    reach : int
        Of the windows, in pixels.

    Returns
    -------
    (M, 5) float64
        Depth of the plane at the pixel, its slopes down and right (per pixel), the variance of that depth, and how far
        noise may take the pixel's own depth from it.
    """
    around = np.arange(-reach, reach + 1)
    dr, dc = (part.ravel() for part in np.meshgrid(around, around, indexing="ij"))
    inside = (dr**2 + dc**2 <= (reach + 0.3) ** 2) & ((dr != 0) | (dc != 0))
    dr, dc = dr[inside], dc[inside]
    sector = np.floor((np.arctan2(dr, dc) / (2 * np.pi) * SECTORS + 1e-9) % SECTORS).astype(np.int64)
    planes = np.empty((len(pixels), 5))
    run_slices(_planes, len(pixels), depth, noise, pixels, perspective, dr, dc, sector, planes, size=1024)
    return planes


@kernel
def _tile_levels(start, stop, depth, perspective, level):
    """Median, over each tile of some rows of tiles, of the bends along rows and columns; NaN where few are known."""
    height, width = depth.shape
    bends = np.empty(_TILE * _TILE)
    for i in range(start, stop):
        for j in range(level.shape[1]):
            count = 0
            for row in range(max(i * _TILE, 1), min((i + 1) * _TILE, height - 1)):
                for col in range(max(j * _TILE, 1), min((j + 1) * _TILE, width - 1)):
                    own, scale = depth[row, col], 1.0
                    up, down, left, right = (
                        depth[row - 1, col],
                        depth[row + 1, col],
                        depth[row, col - 1],
                        depth[row, col + 1],
                    )
                    # On a plane seen from a viewpoint it is the inverse of the range that is linear in the pixels.
                    if perspective:
                        if own * up * down * left * right == 0.0:
                            continue
                        scale = own * own
                        own, up, down, left, right = -1 / own, -1 / up, -1 / down, -1 / left, -1 / right
                    bend = (abs(up - 2 * own + down) + abs(left - 2 * own + right)) / 2 * scale
                    if math.isfinite(bend):
                        bends[count] = bend
                        count += 1
            level[i, j] = np.median(bends[:count]) if count >= _TILE else np.nan


@kernel
def _without_isolated(start, stop, depth, close, kept):
    height, width = depth.shape
    steps = np.empty((2, 20))
    for row in range(start, stop):
        for col in range(width):
            own = depth[row, col]
            if math.isnan(own):
                continue
            top, left, bottom, right = max(row - 2, 0), max(col - 2, 0), min(row + 3, height), min(col + 3, width)
            tolerance, count = close[row, col], 0
            for attempt in range(2):
                count = -1
                for r in range(top, bottom):
                    for c in range(left, right):
                        if abs(depth[r, c] - own) <= tolerance:
                            count += 1
                if count >= 4 or attempt == 1:
                    break
                # Where the surface is steep, neighbours are farther away: as far as they are from each other.
                across, down = 0, 0
                for r in range(top, bottom):
                    for c in range(left, right):
                        if r + 1 < bottom and not math.isnan(depth[r + 1, c] - depth[r, c]):
                            steps[0, down] = abs(depth[r + 1, c] - depth[r, c])
                            down += 1
                        if c + 1 < right and not math.isnan(depth[r, c + 1] - depth[r, c]):
                            steps[1, across] = abs(depth[r, c + 1] - depth[r, c])
                            across += 1
                steepness = np.median(steps[0, :down]) if down > 0 else 0.0
                if across > 0:
                    steepness = max(steepness, np.median(steps[1, :across]))
                tolerance += _CLOSE * steepness
            if count >= 4:
                kept[row, col] = own


@kernel
def _fit(m):
    """Plane v + a y + b x of moments n, x, y, xx, xy, yy, u, xu, yu, uu: v, a, b, residual sum, leverage at 0."""
    n = m[0]
    if n < 5:
        return 0.0, 0.0, 0.0, np.inf, 1.0
    mx, my, mu = m[1] / n, m[2] / n, m[6] / n
    xx, xy, yy = m[3] - m[1] * mx, m[4] - m[1] * my, m[5] - m[2] * my
    xu, yu, uu = m[7] - m[1] * mu, m[8] - m[2] * mu, m[9] - m[6] * mu
    det = xx * yy - xy * xy
    if det < 0.5:  # on a line
        return 0.0, 0.0, 0.0, np.inf, 1.0
    b, a = (xu * yy - yu * xy) / det, (yu * xx - xu * xy) / det
    rest = max(uu - b * xu - a * yu, 0.0)
    leverage = 1.0 / n + (mx * mx * yy - 2 * mx * my * xy + my * my * xx) / det
    return mu - b * mx - a * my, a, b, rest, leverage


@kernel
def _planes(start, stop, depth, noise, pixels, perspective, dr, dc, sector, planes):
    height, width = depth.shape
    sums, m = np.zeros((2 * SECTORS + 1, 10)), np.zeros(10)
    for p in range(start, stop):
        row, col = pixels[p] // width, pixels[p] % width
        own = depth[row, col]
        sums[:] = 0.0
        for i in range(len(dr)):
            r, c = row + dr[i], col + dc[i]
            if r < 0 or r >= height or c < 0 or c >= width or math.isnan(depth[r, c]):
                continue
            x, y = float(dc[i]), float(dr[i])
            u = depth[r, c] - own
            if perspective:
                u *= own / depth[r, c]
            part = sums[sector[i] + 1]
            part[0] += 1.0
            part[1] += x
            part[2] += y
            part[3] += x * x
            part[4] += x * y
            part[5] += y * y
            part[6] += u
            part[7] += x * u
            part[8] += y * u
            part[9] += u * u
        for k in range(SECTORS):
            for j in range(10):
                sums[SECTORS + 1 + k, j] = sums[1 + k, j]
        for k in range(1, 2 * SECTORS + 1):
            for j in range(10):
                sums[k, j] += sums[k - 1, j]
        best = np.inf
        variance = noise[row, col] ** 2
        out = planes[p]
        out[0], out[1], out[2], out[3], out[4] = own, 0.0, 0.0, variance, 0.0
        for w in range(len(WINDOWS)):
            size = WINDOWS[w]
            for k in range(1 if size == SECTORS else SECTORS):
                for j in range(10):
                    m[j] = sums[k + size, j] - sums[k, j]
                m[0] += 1.0
                v, a, b, rest, leverage = _fit(m)
                if rest == np.inf:
                    continue
                spread = max((rest + _PRIOR * variance) / (m[0] - 3 + _PRIOR), variance)
                # The pixel's own misfit counts once more, or it might take the plane of the other side.
                score = spread * (1 + PREFER[w] + leverage) + v * v / 4
                if score < best:
                    best = score
                    out[0], out[1], out[2], out[3] = own + v, a, b, spread * leverage
                    # By how much the pixel itself pulls its plane, it stays closer to it than others would.
                    out[4] = _STRAY_SIGMAS * math.sqrt(variance) * (1 - leverage)
