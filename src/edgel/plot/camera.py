"""Where a picture of a cloud is taken from, and where its points fall in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from edgel.cloud import Cloud, as_vector

DIRECTIONS = ("auto", "top", "oblique", "sensor")
OBLIQUE = (-0.45, 0.65, -0.62)
"""The oblique view, away from the viewer: from the front, a little from the right, down 38 degrees."""

_CONE = 0.2  # least cosine to the mean direction in which a sensor sees 98 % of what it sees: a camera, no sweep
_TAIL = 0.5  # percent of the points at either end that may lie outside the frame
_SLACK = 0.2  # what a frame by percentiles is widened by; a cloud without outliers then fits in whole


@dataclass(frozen=True, eq=False)
class Viewport:
    """What a picture shows of a cloud, and how large.

    Attributes
    ----------
    size, direction, crop, detail, point_size
        As `edgel.plot.picture` takes them; the size without the legend.
    margin : float
        Free rim, as a share of the smaller side.
    """

    size: tuple[int, int]
    direction: Any = "auto"
    crop: bool = False
    detail: tuple[Any, float] | None = None
    point_size: float | None = None
    margin: float = 0.03

    def check(self) -> None:
        """Raise a ValueError if a size is out of its range."""
        if len(self.size) != 2 or min(self.size) < 16 or max(self.size) > 20_000:
            raise ValueError(f"size: expected width and height from 16 to 20,000 pixels, got {self.size!r}")
        if self.point_size is not None and not 0 <= self.point_size <= 200:
            raise ValueError(f"point_size: expected 0 to 200 pixels, got {self.point_size}")


@dataclass(frozen=True, eq=False)
class Camera:
    """A viewer: three axes at right angles, and an eye when the picture is in perspective.

    Attributes
    ----------
    right, up, back : (3,) float64
        Unit vectors of the picture's x, its y, and towards the viewer.
    eye : (3,) float64 or None
        Where the rays meet, in the cloud's frame; None in an orthographic picture.
    """

    right: np.ndarray
    up: np.ndarray
    back: np.ndarray
    eye: np.ndarray | None = None

    def project(self, xyz: np.ndarray) -> np.ndarray:
        """Give points (N, 3) their position on the picture plane and their distance from the viewer, (N, 3).

        The first two columns count right and up, in the cloud's unit or, in perspective, per unit of distance (NaN
        behind the eye); the third grows away from the viewer, in the cloud's unit.
        """
        x, y, z = (xyz if self.eye is None else xyz - self.eye).T
        # No matrix product: its rounding may depend on where in the array a point stands.
        projected = np.column_stack([x * a + y * b + z * c for a, b, c in (self.right, self.up, -self.back)])
        if self.eye is None:
            return projected
        ahead = np.where(projected[:, 2] > 0, projected[:, 2], np.nan)
        return np.column_stack([projected[:, 0] / ahead, projected[:, 1] / ahead, ahead])


@dataclass(frozen=True, eq=False)
class Frame:
    """The part of the picture plane that a picture shows.

    Attributes
    ----------
    width, height : int
        Size of the picture, in pixels.
    left, top : float
        Its upper left corner on the picture plane.
    pixel : float
        Size of a pixel there.
    """

    width: int
    height: int
    left: float
    top: float
    pixel: float

    def to_pixels(self, projected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where projected points (N, 3) fall, in pixels from the left and from above, both (N,) float64."""
        return (projected[:, 0] - self.left) / self.pixel, (self.top - projected[:, 1]) / self.pixel


def choose_camera(cloud: Cloud, direction: Any) -> Camera:
    """Turn the name of a direction, or a vector, into a camera.

    Parameters
    ----------
    cloud : Cloud
    direction : {"auto", "top", "oblique", "sensor"} or (3,) array_like
        ``"top"``: down -Z, x to the right and y up, as the paper looks; ``"oblique"``: from the front and above;
        ``"sensor"``: from the cloud's viewpoint, upright; ``"auto"``: from the sensor if the cloud knows where it was
        and lies before it, else oblique. A vector points away from the viewer.

    Raises
    ------
    ValueError
        If the name is unknown, the vector is zero, or there is no sensor to look from.
    """
    if not isinstance(direction, str):
        away = as_vector(direction, "direction")
        if not away.any():
            raise ValueError("direction: the zero vector points nowhere; give the vector away from the viewer")
        return _looking(away)
    if direction not in DIRECTIONS:
        raise ValueError(f"direction: expected one of {DIRECTIONS} or a vector (3,), got {direction!r}")
    if direction == "top":
        return _looking(np.array([0.0, 0.0, -1.0]))
    if direction == "oblique":
        return _looking(np.array(OBLIQUE))
    if direction == "sensor" and cloud.viewpoint is None:
        raise ValueError("direction: this cloud does not know its viewpoint; give one, or look from 'oblique'")
    camera = _from_sensor(cloud)
    if camera is None and direction == "sensor":
        raise ValueError("direction: the cloud lies all round its viewpoint; look from 'top' or 'oblique'")
    return camera or _looking(np.array(OBLIQUE))


def choose_frame(projected: np.ndarray, viewport: Viewport) -> Frame:
    """Fit points into a picture, without the outliers that would make all else small.

    Parameters
    ----------
    projected : (N, 3) float64
        From `Camera.project`.
    viewport : Viewport
        Its size, its margin, and whether it is cropped count.
    """
    size = viewport.size
    plane = projected[np.isfinite(projected[:, 0]), :2]
    low, high = np.percentile(plane, [_TAIL, 100.0 - _TAIL], axis=0)
    slack = _SLACK * (high - low)
    low, high = np.maximum(plane.min(axis=0), low - slack), np.minimum(plane.max(axis=0), high + slack)
    extent = high - low
    rim = viewport.margin * min(size)
    pixel = float((extent / (np.array(size) - 2 * rim)).max())
    if not pixel > 0:
        pixel = 1.0  # one point, or all on one line of sight: any scale will do
    width, height = np.minimum(np.ceil(extent / pixel + 2 * rim), size).astype(int) if viewport.crop else size
    left, top = (low + high) / 2 + np.array([-width, height]) * pixel / 2
    return Frame(int(width), int(height), float(left), float(top), pixel)


def detail_frame(camera: Camera, place: Any, extent: float, size: tuple[int, int]) -> Frame:
    """Frame the surroundings of a place.

    Parameters
    ----------
    camera : Camera
    place : (3,) array_like
        What is in the middle of the picture, in the cloud's frame.
    extent : float
        Width of the picture at that place, in the cloud's unit.
    size : (int, int)
        Width and height, in pixels.

    Raises
    ------
    ValueError
        If the place lies behind the viewer, or there is no width.
    """
    x, y, distance = camera.project(as_vector(place, "detail")[None])[0]
    if not extent > 0 or np.isnan(x):
        raise ValueError(f"detail: expected a place before the viewer and a width above 0, got {place!r}, {extent!r}")
    pixel = float(extent) / size[0] / (1.0 if camera.eye is None else distance)
    return Frame(size[0], size[1], x - pixel * size[0] / 2, y + pixel * size[1] / 2, pixel)


def _looking(away: np.ndarray, down: np.ndarray | None = None, eye: np.ndarray | None = None) -> Camera:
    """Look along a vector, with +Z up in the picture (+Y when looking along Z) unless told which way is down."""
    back = -away / np.linalg.norm(away)
    if down is not None and np.linalg.norm(np.cross(down, back)) > 1e-3 * np.linalg.norm(down):
        up = -down
    else:
        up = np.array([0.0, 0.0, 1.0]) if abs(back[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    return Camera(right, np.cross(back, right), back, eye)


def _from_sensor(cloud: Cloud) -> Camera | None:
    """Look from the viewpoint as the sensor did; None if there is none, or the cloud lies round it."""
    if cloud.viewpoint is None:
        return None
    rays = cloud.xyz - cloud.viewpoint
    length = np.linalg.norm(rays, axis=1)
    seen = np.isfinite(length) & (length > 0)
    if not seen.any():
        return None
    rays = rays[seen] / length[seen, None]
    away = rays.mean(axis=0)
    strength = np.linalg.norm(away)
    if strength == 0 or np.percentile(rays @ (away / strength), 2.0) < _CONE:
        return None
    nearest_axis = np.zeros(3)
    nearest_axis[np.abs(away).argmax()] = np.sign(away[np.abs(away).argmax()])
    down = _row_direction(cloud)
    if down is None and nearest_axis[2] > 0:
        down = np.array([0.0, 1.0, 0.0])  # z forward: a camera's frame, in which y points down
    # A camera that looks nearly along an axis is drawn along it, so that straight stays straight.
    forward = nearest_axis if strength and away @ nearest_axis > 0.97 * strength else away
    return _looking(forward, down, cloud.viewpoint)


def _row_direction(cloud: Cloud) -> np.ndarray | None:
    """Which way the rows of an organized cloud run on the whole, (3,); None when it is unorganized."""
    if cloud.shape is None or cloud.shape[0] < 2:
        return None
    steps = np.diff(cloud.xyz.reshape(*cloud.shape, 3), axis=0).reshape(-1, 3)
    steps = steps[np.isfinite(steps).all(axis=1)]
    if len(steps) == 0:
        return None
    down = np.median(steps, axis=0)
    return down if down.any() else None
