"""Where the camera of an organized cloud stood and which way it looked, from the cloud alone.

PCL's organized detector takes the sensor's own frame for granted: the camera at the origin, looking along +Z, columns
along +X, rows along +Y. A cloud in another frame has to be brought there, or the detector is crippled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import edgel

FOCAL_PIXELS = 525.0  # of the Kinect, the camera PCL's defaults were made for
WIDE = np.deg2rad(60.0)  # a view that reaches further from its axis is no camera's


@dataclass(frozen=True, eq=False)
class Sensor:
    """A pose: ``axes @ (p - origin)`` is in the sensor's frame. ``wide``: depth is the range, not Z."""

    origin: np.ndarray
    axes: np.ndarray
    wide: bool = False

    def depth(self, cloud: edgel.Cloud) -> float:
        """Return the median depth of a cloud as PCL sees it: Z, or the range in a wide view."""
        seen = cloud.xyz[np.isfinite(cloud.xyz).all(axis=1)] - self.origin
        return float(np.median(np.linalg.norm(seen, axis=1) if self.wide else seen @ self.axes[2]))


def locate(cloud: edgel.Cloud, spacing: float) -> Sensor:
    """Find the sensor of an organized cloud.

    A pinhole camera when a viewpoint is known and pixels fit it; parallel rays otherwise. Those come from infinitely
    far, where every depth step is relatively nothing: the sensor is put where a camera of `FOCAL_PIXELS` would see
    `spacing` a pixel.
    """
    if cloud.shape is None:
        raise ValueError("cloud: must be organized")
    rows = np.flatnonzero(np.isfinite(cloud.xyz).all(axis=1))
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), 5000)).astype(int)]
    xyz = cloud.xyz[rows]
    pixels = np.column_stack([rows % cloud.shape[1], rows // cloud.shape[1]]).astype(float)
    parallel, parallel_error = _parallel(xyz, pixels, spacing)
    if cloud.viewpoint is None:
        return parallel
    rays = xyz - cloud.viewpoint
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    middle = _unit(rays.mean(axis=0))
    if np.linalg.norm(rays.mean(axis=0)) < 0.5 or np.arccos(np.clip(rays @ middle, -1, 1)).max() > WIDE:
        return Sensor(cloud.viewpoint, _frame(middle, _across(pixels, rays)), wide=True)
    axes, error = _pinhole(rays, pixels)
    return parallel if parallel_error < 0.5 * error else Sensor(cloud.viewpoint, axes)


def _parallel(xyz: np.ndarray, pixels: np.ndarray, spacing: float) -> tuple[Sensor, float]:
    """Fit pixels as a linear function of the points; rays run where it does not change."""
    mean = xyz.mean(axis=0)
    centred = np.column_stack([xyz - mean, np.ones(len(xyz))])
    solution = np.linalg.lstsq(centred, pixels, rcond=None)[0]
    across, down = solution[:3, 0], solution[:3, 1]
    axes = _frame(_unit(np.cross(across, down)), across)
    error = float(np.median(np.abs(centred @ solution - pixels)))
    # Far enough that nothing lies behind the sensor either.
    nearest = float(((xyz - mean) @ axes[2]).min())
    return Sensor(mean + axes[2] * (nearest - FOCAL_PIXELS * spacing), axes), error


def _pinhole(rays: np.ndarray, pixels: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit ``u = (a . d) / (c . d), v = (b . d) / (c . d)`` (direct linear transform); c is the optical axis."""
    centre, size = pixels.mean(axis=0), pixels.std() + 1.0
    u, v = ((pixels - centre) / size).T[:, :, None]
    zero = np.zeros_like(rays)
    system = np.vstack([np.hstack([rays, zero, -u * rays]), np.hstack([zero, rays, -v * rays])])
    a, b, c = np.linalg.svd(system, full_matrices=False)[2][-1].reshape(3, 3)
    if np.median(rays @ c) < 0:
        a, b, c = -a, -b, -c
    seen = np.column_stack([rays @ a, rays @ b]) / (rays @ c)[:, None]
    error = float(np.median(np.abs(seen * size + centre - pixels)))
    return _frame(_unit(c), a), error


def _across(pixels: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Return the direction in which columns grow, on average."""
    return (rays * (pixels[:, 0] - pixels[:, 0].mean())[:, None]).mean(axis=0)


def _frame(forward: np.ndarray, across: np.ndarray) -> np.ndarray:
    right = _unit(across - (across @ forward) * forward)
    return np.array([right, np.cross(forward, right), forward])


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)
