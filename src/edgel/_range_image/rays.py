"""Rays: along each pixel's, a plane is linear in one number, so that fitting one is a linear regression.

Where rays leave a viewpoint that number is the inverse of the range: a plane ``m . p = 1`` meets the unit ray q at the
range r with ``1 / r = m . q``. Where rays are parallel it is the height against their direction: ``m . (x, y, 1)``.
Triangulating sensors (structured light, stereo) err evenly in the inverse of the range, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import bounds
from edgel._range_image.range_image import RangeImage

APART = 1.7  # times the pitch along lines, from which lines (of a spinning sensor) lie far apart
_NEAREST = 1e-60  # squared distance
_BAND = 64  # rows


@dataclass(frozen=True, eq=False)
class Rays:
    """The rays of a range image, larger numbers nearer to the viewer.

    Attributes
    ----------
    ray : (H, W, 3) float32
        Unit ray q in the cloud's axes, or (x, y, 1) right and down of the image's middle; 0 where nothing is seen.
    near : (H, W) float32
        Inverse of the range, in 1 / the cloud's unit, or height in its unit; NaN where nothing is seen.
    axes : (3, 3) float64
        Right, down and forward of parallel rays, the identity for rays from a viewpoint.
    origin : (3,) float64
        The viewpoint, or the point at x = y = height = 0.
    central : bool
        Whether the rays leave a viewpoint.
    pitch : (float, float)
        Size of a pixel along a column and along a row: radians, or the cloud's unit.
    organized : bool
        Whether the cloud came with these pixels.
    """

    ray: np.ndarray
    near: np.ndarray
    axes: np.ndarray
    origin: np.ndarray
    central: bool
    pitch: tuple[float, float]
    organized: bool

    @property
    def side(self) -> float:
        """Root of the area of a pixel, in radians or the cloud's unit."""
        return float(np.sqrt(self.pitch[0] * self.pitch[1]))

    @property
    def apart(self) -> tuple[bool, bool]:
        """Whether neighbours along columns, and along rows, lie on lines far apart, as a spinning sensor's do."""
        down, right = self.pitch
        return down > APART * right, right > APART * down

    @property
    def gridded(self) -> bool:
        """Whether the pixels are the sensor's own, which may share noise, and not those of a projection."""
        return self.organized or any(self.apart)

    def spacing(self, near: np.ndarray) -> np.ndarray:
        """How much `near` changes where the surface recedes by the width of a pixel: what one spacing is in it."""
        return self.side * near if self.central else np.full_like(near, self.side)

    def planes(self, fitted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals (M, 3) towards the viewer, and offsets (M,) ``normal . p``, of fitted planes m (M, 3)."""
        out = -fitted.astype(np.float64)
        offset = np.full(len(out), -1.0) if self.central else -out[:, 2]
        if not self.central:
            out[:, 2] = -1.0
        length = np.linalg.norm(out, axis=1)
        normals = out @ self.axes / length[:, None]
        return normals, offset / length + normals @ self.origin


def trace_rays(image: RangeImage, xyz: np.ndarray) -> Rays:
    """Make the rays of a range image.

    Parameters
    ----------
    image : RangeImage
    xyz : (N, 3) float64
        The points it was made of.
    """
    ray, near = np.empty((*image.shape, 3), np.float32), np.empty(image.shape, np.float32)
    central = image.viewpoint is not None
    if image.viewpoint is not None:
        axes, origin = np.eye(3), image.viewpoint
    else:
        # The middle of the box, since a mean would depend on the order of the points in its last digit.
        low, high = bounds(xyz) if len(xyz) else np.zeros((2, 3))
        origin = (low + high) / 2
        forward = image.direction
        right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(forward, right), forward])
    run_slices(_trace, len(near), image.index, xyz, axes, origin, central, ray, near, size=_BAND)
    return Rays(ray, near, axes, origin, central, image.pitch, image.method == "organized")


@kernel
def _trace(start, stop, index, xyz, axes, origin, central, ray, near):
    ox, oy, oz = origin[0], origin[1], origin[2]
    for row in range(start, stop):
        for col in range(index.shape[1]):
            p = index[row, col]
            ray[row, col, 0], ray[row, col, 1], ray[row, col, 2], near[row, col] = 0.0, 0.0, 0.0, np.nan
            if p < 0:
                continue
            x, y, z = xyz[p, 0] - ox, xyz[p, 1] - oy, xyz[p, 2] - oz
            if central:
                squared = x * x + y * y + z * z
                if not squared > _NEAREST:  # its inverse would be beyond single precision
                    continue
                inverse = 1.0 / np.sqrt(squared)
                ray[row, col, 0], ray[row, col, 1], ray[row, col, 2] = x * inverse, y * inverse, z * inverse
                near[row, col] = inverse
            else:
                ray[row, col, 0] = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z
                ray[row, col, 1] = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
                ray[row, col, 2] = 1.0
                near[row, col] = -(axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z)
