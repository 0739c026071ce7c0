"""Points floating alone: outliers and pixels that mix near and far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._kernels.parallel import kernel, part, run_slices
from edgel._neighbors.selection import quantile
from edgel._range_image.rays import Rays

CLOSE = 3.0  # spacings, and median differences of neighbours, within which a neighbour holds a pixel
HELD = 2, 4  # of the 8 neighbours, or of the 24, that hold a pixel
ON_LINE = 1, 2  # the same of the 2 or 4 on its own line, where lines lie far apart
_BAND = 64  # rows
_SAMPLE = 4  # rows and columns between the pixels whose neighbours are compared


def without_stray(rays: Rays) -> Rays:
    """Let no pixel show that hardly any neighbour holds."""
    near = rays.near
    step = np.abs(near[::_SAMPLE, 1::_SAMPLE] - near[::_SAMPLE, : near.shape[1] - 1 : _SAMPLE])
    unit = rays.spacing(near[::_SAMPLE, 1::_SAMPLE])
    known = np.isfinite(step) & (unit > 0)
    usual = float(np.median(step[known] / unit[known])) if known.any() else 0.0
    kept = np.empty_like(near)
    close = CLOSE * (1.0 + usual) * rays.side
    lines = (int(not rays.apart[0]), int(not rays.apart[1]))  # whether neighbours along columns and rows are any help
    held = HELD if all(lines) else ON_LINE
    run_slices(_without_stray, len(near), near, close, rays.central, held, lines, kept, size=_BAND)
    return replace(rays, near=kept)


@kernel
def _without_stray(start, stop, near, close, central, held, lines, kept):
    width = near.shape[1]
    steps = np.empty((2, 25), np.float32)
    for row in range(start, stop):
        for col in range(width):
            own = near[row, col]
            kept[row, col] = own
            if own != own:
                continue
            limit = np.float32(close * own) if central else np.float32(close)
            # Nearly all are held by the two beside them, which are enough anywhere.
            beside = lines[1] == 1 and 0 < col < width - 1
            if beside and abs(near[row, col - 1] - own) <= limit and abs(near[row, col + 1] - own) <= limit:
                continue
            if _count(near, row, col, 1, lines, limit) >= held[0] or _count(near, row, col, 2, lines, limit) >= held[1]:
                continue
            # Where the surface is steep, neighbours are farther away: as far as they are from each other.
            steep = np.float32(CLOSE) * _steepness(near, row, col, lines, steps)
            if _count(near, row, col, 2, lines, limit + steep) < held[1]:
                kept[row, col] = np.nan


@part
def _count(near, row, col, reach, lines, limit):
    """Number of neighbours within a reach whose depth is close to the pixel's own."""
    count = -1
    for r in range(max(row - reach * lines[0], 0), min(row + reach * lines[0] + 1, near.shape[0])):
        for c in range(max(col - reach * lines[1], 0), min(col + reach * lines[1] + 1, near.shape[1])):
            if abs(near[r, c] - near[row, col]) <= limit:
                count += 1
    return count


@part
def _steepness(near, row, col, lines, steps):
    """Median difference of neighbours along rows or along columns, whichever is larger, in the square of 25."""
    height, width = near.shape
    counts = np.zeros(2, np.int64)
    for r in range(max(row - 2, 0), min(row + 3, height)):
        for c in range(max(col - 2, 0), min(col + 3, width)):
            for way in range(2):
                if lines[way] == 0:
                    continue
                p, q = (r + 1, c) if way == 0 else (r, c + 1)
                if p < min(row + 3, height) and q < min(col + 3, width):
                    step = abs(near[p, q] - near[r, c])
                    if step == step:
                        steps[way, counts[way]] = step
                        counts[way] += 1
    steepest = np.float32(0.0)
    for way in range(2):
        if counts[way] > 0:
            steepest = max(steepest, np.float32(quantile(steps[way], counts[way], 0.5)))
    return steepest
