"""Canny's detector on 2-D float arrays, step by step; it knows nothing of points.

Canny 1986, doi:10.1109/TPAMI.1986.4767851; equation numbers are those of the paper in `edgel.paper`. Rasters are
``[row, col]``. Outside an image its border pixels are repeated; whoever wants another border pads first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel
from edgel.io.errors import printable

_WIDEST = 999
"""Pixels of the Gaussian at most: beyond is nothing but a mistake, which would take hours."""


@dataclass(frozen=True, eq=False)
class CannyResult:
    """What each step of `canny` made of an (H, W) image.

    Attributes
    ----------
    smooth : (H, W) float64
        The image after the Gaussian, in the image's unit.
    magnitude : (H, W) float64
        Length of the Sobel gradient: 4 times the height of a step along an axis.
    thinned : (H, W) float64
        The magnitude where it is a maximum along the gradient, 0 elsewhere.
    edges : (H, W) bool
        The edge map.
    """

    smooth: np.ndarray
    magnitude: np.ndarray
    thinned: np.ndarray
    edges: np.ndarray


def canny(image: np.ndarray, *, kernel_size: int, sigma: float, low: float, high: float) -> CannyResult:
    """Find the edges of an image: smooth, gradient, thin, double threshold and hysteresis.

    Parameters
    ----------
    image : (H, W) float64, finite
    kernel_size : int
        Width of the Gaussian's square, odd.
    sigma : float
        Its standard deviation, in pixels.
    low, high : float
        Thresholds on the gradient's magnitude, ``0 <= low <= high``: an edge begins above `high`, goes on above `low`.

    Examples
    --------
    >>> import numpy as np
    >>> image = np.zeros((6, 8)); image[:, 4:] = 1.0
    >>> canny(image, kernel_size=3, sigma=0.8, low=0.5, high=2.0).edges[3].nonzero()
    (array([3]),)
    """
    if not 0 <= low <= high:
        raise ValueError(f"low, high: expected 0 <= low <= high, got low={low}, high={high}")
    smoothed = smooth(image, kernel_size, sigma)
    gx, gy = gradient(smoothed)
    magnitude = np.hypot(gx, gy)
    thinned = non_maximum_suppression(magnitude, gx, gy)
    return CannyResult(smoothed, magnitude, thinned, hysteresis(thinned, low, high))


def check_gaussian(kernel_size: int, sigma: float) -> None:
    """Raise ValueError for a Gaussian that no image is smoothed by."""
    if not isinstance(kernel_size, int | np.integer) or not 1 <= kernel_size <= _WIDEST or kernel_size % 2 == 0:
        raise ValueError(
            f"kernel_size: expected an odd number of pixels from 1 to {_WIDEST}, got {printable(kernel_size, 40)}"
        )
    if not 0 < sigma <= _WIDEST:
        raise ValueError(f"sigma: expected a number of pixels above 0, at most {_WIDEST}, got {printable(sigma, 40)}")


def gaussian_kernel(kernel_size: int, sigma: float) -> np.ndarray:
    """Sample the 2-D Gaussian on a square of pixels and scale it to sum 1 (eq. 7; eq. 8 is its 3 x 3 for sigma 1.4).

    Returns
    -------
    (kernel_size, kernel_size) float64
    """
    weights = _gaussian_weights(kernel_size, sigma)
    return np.outer(weights, weights)


def smooth(image: np.ndarray, kernel_size: int, sigma: float) -> np.ndarray:
    """Convolve an (H, W) image with the Gaussian of `gaussian_kernel` (eq. 12), one axis after the other."""
    weights = _gaussian_weights(kernel_size, sigma)
    height, width = image.shape
    padded = np.pad(image, kernel_size // 2, mode="edge")
    rows = sum(w * padded[i : i + height] for i, w in enumerate(weights))
    return sum(w * rows[:, i : i + width] for i, w in enumerate(weights))  # pyright: ignore[reportReturnType, reportIndexIssue]


def gradient(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sobel derivatives along columns (x) and rows (y) of an (H, W) image (eq. 15).

    Eq. 16-17 write them out with misprinted last terms. The magnitude is ``hypot(gx, gy)`` (eq. 13), the direction
    ``arctan2(gy, gx)`` (eq. 14).
    """
    padded = np.pad(image, 1, mode="edge")
    across = padded[:, 2:] - padded[:, :-2]
    gx = across[:-2] + 2 * across[1:-1] + across[2:]
    down = padded[2:] - padded[:-2]
    gy = down[:, :-2] + 2 * down[:, 1:-1] + down[:, 2:]
    return gx, gy


def non_maximum_suppression(magnitude: np.ndarray, gx: np.ndarray, gy: np.ndarray) -> np.ndarray:
    """Suppress what is not the largest of the three pixels along the gradient's direction (section 3.3 of the paper).

    The direction is rounded to one of four, as OpenCV does; of two equal pixels side by side the lower or right one
    goes, of two on a diagonal both, and the magnitude outside the image counts as 0.

    Returns
    -------
    (H, W) float64
        The magnitude where it is a maximum, 0 elsewhere.
    """
    out = np.zeros_like(magnitude)
    _suppress(np.pad(magnitude, 1), gx, gy, out)
    return out


def hysteresis(thinned: np.ndarray, low: float, high: float) -> np.ndarray:
    """Keep pixels above `high`, and those above `low` that a chain of 8-neighbours joins to one (section 3.4).

    The paper's text looks only at direct neighbours; chains are followed here, as Canny defined it.
    """
    edges = np.zeros(thinned.shape, np.bool_)
    _follow(np.pad(thinned, 1), low, high, edges)
    return edges


def _gaussian_weights(kernel_size: int, sigma: float) -> np.ndarray:
    check_gaussian(kernel_size, sigma)
    with np.errstate(over="ignore"):  # of a sigma of next to nothing: all weight is in the middle
        weights = np.exp(-(((np.arange(kernel_size) - kernel_size // 2) / sigma) ** 2) / 2)
    return weights / weights.sum()


@kernel
def _suppress(padded, gx, gy, out):
    tan_22, tan_67 = 0.41421356237309503, 2.414213562373095
    height, width = gx.shape
    for row in range(height):
        for col in range(width):
            m = padded[row + 1, col + 1]
            x, y = abs(gx[row, col]), abs(gy[row, col])
            if y < tan_22 * x:
                keep = m > padded[row + 1, col] and m >= padded[row + 1, col + 2]
            elif y > tan_67 * x:
                keep = m > padded[row, col + 1] and m >= padded[row + 2, col + 1]
            else:
                side = 1 if (gx[row, col] < 0) == (gy[row, col] < 0) else -1
                keep = m > padded[row, col + 1 - side] and m > padded[row + 2, col + 1 + side]
            if keep:
                out[row, col] = m


@kernel
def _follow(padded, low, high, edges):
    height, width = edges.shape
    stack = np.empty(height * width, np.int64)
    depth = 0
    for row in range(height):
        for col in range(width):
            if padded[row + 1, col + 1] > high:
                edges[row, col] = True
                stack[depth] = row * width + col
                depth += 1
    while depth > 0:
        depth -= 1
        row, col = stack[depth] // width, stack[depth] % width
        for r in range(max(row - 1, 0), min(row + 2, height)):
            for c in range(max(col - 1, 0), min(col + 2, width)):
                if padded[r + 1, c + 1] > low and not edges[r, c]:
                    edges[r, c] = True
                    stack[depth] = r * width + c
                    depth += 1
