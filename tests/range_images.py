"""Range images of made surfaces: rays of three kinds, and what is seen along them."""

from __future__ import annotations

import numpy as np

from edgel._range_image.range_image import RangeImage

KINDS = ("parallel", "pinhole", "spherical")
FAR = 100.0
"""Distance at which cameras look at what is made here, where their pixels are about 1 apart."""


def frame(seed: int = 0) -> np.ndarray:
    """Right, down and forward of some viewer."""
    axes = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return axes * np.sign(np.linalg.det(axes))


def image_of(kind: str, height: np.ndarray, pitch: tuple[float, float] = (1.0, 1.0)) -> tuple[RangeImage, np.ndarray]:
    """See heights (H, W) over a plane across the view at 100 from the viewer; NaN where there is nothing.

    `pitch` is the distance of pixels along a column and along a row, there. Returns the image and its points.
    """
    rows, cols = height.shape
    down = (np.arange(rows) - (rows - 1) / 2)[:, None] * pitch[0] * np.ones(cols)
    right = (np.arange(cols) - (cols - 1) / 2) * pitch[1] * np.ones((rows, 1))
    axes, place = frame(), np.array([30.0, -20.0, 50.0])
    if kind == "parallel":
        own = np.stack([right, down, FAR - height], axis=-1)
        eye, angular = None, pitch
    else:
        if kind == "pinhole":
            ray = np.stack([right, down, np.full_like(right, FAR)], axis=-1)
        else:
            azimuth, elevation = right / FAR, down / FAR
            ray = np.stack(
                [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)], axis=-1
            )
        # The same plane at the height 0 for every kind: along the ray, until the distance ahead is 100 less the height.
        own = ray / ray[..., 2:] * (FAR - height)[..., None]
        eye, angular = place, (pitch[0] / FAR, pitch[1] / FAR)
    seen = np.isfinite(height)
    xyz = own[seen] @ axes + place
    index = np.full(height.shape, -1)
    index[seen] = np.arange(len(xyz))
    direction = axes[2]
    return RangeImage(index, "organized", angular, eye, direction, np.zeros(len(xyz))), xyz


def grid(rows: int, cols: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of pixels (H, W), from the middle."""
    row, col = np.mgrid[:rows, :cols].astype(float)
    return row - (rows - 1) / 2, col - (cols - 1) / 2


def white(shape: tuple[int, int], seed: int = 0) -> np.ndarray:
    """Independent noise (H, W) of standard deviation 1."""
    return np.random.default_rng(seed).standard_normal(shape)


def smoothed(shape: tuple[int, int], window: int = 5, seed: int = 0) -> np.ndarray:
    """Noise (H, W) of standard deviation 1, alike over a window."""
    wide = white((shape[0] + window - 1, shape[1] + window - 1), seed)
    return np.lib.stride_tricks.sliding_window_view(wide, (window, window)).sum(axis=(2, 3)) / window


def holes(shape: tuple[int, int], share: float, seed: int = 0) -> np.ndarray:
    """Pixels (H, W) that are missing, a share of all."""
    return np.random.default_rng(seed + 100).random(shape) < share
