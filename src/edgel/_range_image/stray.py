"""Points floating alone: outliers and pixels that mix near and far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._range_image.rays import Rays

CLOSE = 3.0  # spacings, and median differences of neighbours, within which a neighbour holds a pixel
HELD = 2, 4  # of the 8 neighbours, or of the 24, that hold a pixel
_BAND = 16  # rows
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
    run_slices(_without_stray, len(near), near, close, rays.central, HELD, kept, size=_BAND)
    return replace(rays, near=kept)


@kernel
def _without_stray(start, stop, near, close, central, held, kept):
    height, width = near.shape
    for row in range(start, stop):
        for col in range(width):
            own = near[row, col]
            kept[row, col] = own
            if own != own:
                continue
            limit = np.float32(close * own) if central else np.float32(close)
            for reach in range(1, 3):
                count = -1
                for r in range(max(row - reach, 0), min(row + reach + 1, height)):
                    for c in range(max(col - reach, 0), min(col + reach + 1, width)):
                        if abs(near[r, c] - own) <= limit:
                            count += 1
                if count >= held[reach - 1]:
                    break
                if reach == 2:
                    kept[row, col] = np.nan
