"""Raster: a cloud as a sensor sees it, one point a pixel.

Organized clouds come as they are; any other points are projected along a direction, onto the image plane of a camera,
or onto a sphere. Depth stays in the cloud's unit, as float64: no grey levels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Raster:
    """Which point each pixel shows, and how far from the viewer it is.

    Attributes
    ----------
    depth : (H, W) float64
        Distance from the viewpoint, or along the direction of parallel rays, in the cloud's unit; NaN = nothing.
    index : (H, W) int64
        Row of the point, among those the raster was made of; -1 = nothing.
    method : str
        "organized", "orthographic", "pinhole" or "spherical".
    pitch : (float, float)
        Size of a pixel, along a column and along a row of the image: radians where the rays leave a viewpoint, else in
        the cloud's unit.
    viewpoint : (3,) float64 or None
        Where the rays leave; None where they are parallel.
    direction : (3,) float64
        Unit vector along the parallel rays, or along the middle one.
    """

    depth: np.ndarray
    index: np.ndarray
    method: str
    pitch: tuple[float, float]
    viewpoint: np.ndarray | None
    direction: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.depth.shape[0], self.depth.shape[1]

    @property
    def spacing(self) -> np.ndarray:
        """Root of the area, across the ray, that each pixel covers at its depth; (H, W) float64, the cloud's unit."""
        side = float(np.sqrt(self.pitch[0] * self.pitch[1]))
        return side * self.depth if self.viewpoint is not None else np.where(np.isnan(self.depth), np.nan, side)


def organized(
    xyz: np.ndarray, rows: np.ndarray, shape: tuple[int, int], viewpoint: np.ndarray | None = None
) -> Raster:
    """See an organized cloud as its sensor did.

    Whether the rays leave the viewpoint or are parallel is read off the cloud: whichever makes the steps from pixel to
    pixel the more even.

    Parameters
    ----------
    xyz : (N, 3) float64, finite
    rows : (N,) int64
        Place of each point in the flat grid (`edgel.cloud.Points.rows`).
    shape : (int, int)
    viewpoint : (3,) float64, optional
        Default: the origin, where sensors have theirs.
    """
    index = np.full(shape[0] * shape[1], -1)
    index[rows] = np.arange(len(xyz))
    index = index.reshape(shape)
    eye = np.zeros(3) if viewpoint is None else viewpoint
    depth = np.linalg.norm(xyz - eye, axis=1)
    pairs = _neighbours(index)
    with np.errstate(divide="ignore", invalid="ignore"):
        rays = (xyz - eye) / depth[:, None]
    from_eye = [np.linalg.norm(rays[b] - rays[a], axis=1) for a, b in pairs]
    direction = _parallel(xyz, pairs)
    across = xyz - (xyz @ direction)[:, None] * direction
    parallel = [np.linalg.norm(across[b] - across[a], axis=1) for a, b in pairs]
    middle = rays[depth > 0].mean(axis=0) if (depth > 0).any() else np.array([0.0, 0.0, 1.0])
    if _unevenness(parallel) < _unevenness(from_eye):
        facing = direction @ (middle if viewpoint is not None or direction[2] == 0 else -direction * direction[2])
        direction = -direction if facing < 0 else direction
        depth, steps, eye, middle = xyz @ direction, parallel, None, direction
    else:
        steps = from_eye
    image = np.full(shape, np.nan)
    image.ravel()[rows] = depth
    pitch = [float(np.median(step)) if len(step) else 1.0 for step in steps]
    return Raster(image, index, "organized", (pitch[0], pitch[1]), eye, middle / np.linalg.norm(middle))


def _neighbours(index: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pairs of points one below the other, and side by side."""
    pairs = []
    for a, b in ((index[:-1], index[1:]), (index[:, :-1], index[:, 1:])):
        both = (a >= 0) & (b >= 0)
        pairs.append((a[both], b[both]))
    return pairs


def _parallel(xyz: np.ndarray, pairs: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Direction along which alone the steps between neighbours differ, as they do where the rays are parallel."""
    scatter = np.zeros((3, 3))
    middles = []
    for a, b in pairs:
        step = xyz[b] - xyz[a]
        middles.append(np.median(step, axis=0) if len(step) else np.zeros(3))
        step = step - middles[-1]
        scatter += step.T @ step
    values, vectors = np.linalg.eigh(scatter)
    across = np.cross(*middles)
    length = np.linalg.norm(across)
    count = sum(len(a) for a, _ in pairs)
    if values[-1] <= 1e-12 * count * length and length > 0:  # one plane: any direction would do
        return across / length
    return vectors[:, -1]


def _unevenness(steps: list[np.ndarray]) -> float:
    """Median deviation of the steps from their median, relative to it, the larger of both directions."""
    worst = 0.0
    for step in steps:
        middle = np.median(step) if len(step) else 0.0
        worst = max(worst, float(np.median(np.abs(step - middle)) / middle) if middle > 0 else np.inf)
    return worst
