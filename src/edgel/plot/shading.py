"""How light and in what color the surface of a cloud is drawn, and what its colors mean."""

from __future__ import annotations

import numpy as np

from edgel._color.channels import intensity_of, rgb_of
from edgel.cloud import Cloud, check_points
from edgel.plot.legend import Entry
from edgel.plot.palette import Theme, height_colors, height_limits, muted, ramp_colors
from edgel.plot.zbuffer import SUPERSAMPLING, ZBuffer

COLOR_BY = ("grey", "rgb", "intensity", "height", "normals")

_LIGHT = np.array([-0.30, 0.42, 0.86])  # towards the light: from the left, above, and behind the viewer
_AMBIENT = 0.5  # how far round the light reaches, so that slopes away from it still differ


class Shading:
    """The colors of a cloud's surface.

    Parameters
    ----------
    cloud : Cloud
    color_by : str
        One of `COLOR_BY`.

    Attributes
    ----------
    entries : list of Entry
        What the legend has to say of the colors.

    Raises
    ------
    ValueError
        If `color_by` is unknown, or the cloud does not carry it.
    """

    def __init__(self, cloud: Cloud, color_by: str) -> None:
        if color_by not in COLOR_BY:
            raise ValueError(f"color_by: expected one of {', '.join(COLOR_BY)}, got {color_by!r}")
        self.entries: list[Entry] = []
        self._color_by = color_by
        self._colors = np.empty((0, 3))  # one a row of the cloud, 0 to 255; grey and normals come from the picture
        if color_by == "height":
            finite = check_points(cloud, minimum=1).xyz[:, 2]
            self._colors = height_colors(cloud.xyz[:, 2], finite)
            low, high = height_limits(finite)
            ramp = muted(ramp_colors(np.linspace(0, 1, 32)))
            self.entries.append(Entry(ramp.astype(np.uint8), f"{high:.6g}", f"height {low:.6g}"))
        elif color_by in ("rgb", "intensity"):
            self._colors = _carried(cloud, color_by)
            if color_by == "rgb":
                self._colors = muted(self._colors)

    def paint(self, buffer: ZBuffer, theme: Theme, *, singly: bool) -> np.ndarray:
        """Paint what a z-buffer of the cloud shows, (height, width, 3) uint8 at its subpixels.

        `singly` says that the points do not close to a surface.
        """
        normals = _visible_normals(buffer)
        light = _at_subpixels(_lightness(normals @ _LIGHT))
        if self._color_by == "grey":
            darkest, lightest = theme.point_greys if singly else theme.greys
            colors = (darkest + (lightest - darkest) * light)[..., None]
        elif self._color_by == "normals":
            axes = np.vstack([buffer.camera.right, buffer.camera.up, buffer.camera.back])
            colors = muted(127.5 * (1.0 + _at_subpixels(normals @ axes)), light)
        else:
            colors = self._colors[buffer.rows][buffer.nearest]
            if self._color_by == "height":
                colors = muted(colors, light)
        painted = np.empty((*buffer.covered.shape, 3), np.uint8)
        painted[...] = (colors + 0.5).astype(np.uint8)
        painted[~buffer.covered] = theme.background
        return painted


def _carried(cloud: Cloud, color_by: str) -> np.ndarray:
    """The cloud's own colors, (N, 3) in 0 to 255."""
    values = rgb_of(cloud) if color_by == "rgb" else intensity_of(cloud)
    if values is None:
        lacks = "no red, green and blue" if color_by == "rgb" else "no intensity that differs between points"
        raise ValueError(f"color_by: the cloud carries {lacks}; color it by grey, height or normals")
    values = 255.0 * np.nan_to_num(values, nan=0.5)
    return (values if values.ndim == 2 else values[:, None].repeat(3, axis=1)).astype(np.float32)


def _visible_normals(buffer: ZBuffer) -> np.ndarray:
    """Unit normals by the slope of the depth, one a pixel (H, W, 3): to the right, up, and towards the viewer."""
    # At the resolution of the picture itself: four times as fast, and the outline stays that of the subpixels.
    depth, covered = (all_[::SUPERSAMPLING, ::SUPERSAMPLING] for all_ in (buffer.surface_depth, buffer.covered))
    pixel = buffer.pixel_size(depth)
    depth = _smoothed(depth, covered, int(np.ceil(1.5 * max(buffer.spacing, buffer.radius) / SUPERSAMPLING)))
    down, right = np.gradient(depth)
    # Depth grows away from the viewer; a jump counts as a steep slope, no more.
    x, y = (np.clip(np.nan_to_num(step / pixel), -3.0, 3.0) for step in (right, -down))
    return np.dstack([x, y, np.ones_like(x)]) / np.sqrt(x * x + y * y + 1.0)[..., None]


def _lightness(cosine: np.ndarray) -> np.ndarray:
    """Map the cosine of the angle to the light to 0..1; slopes a little turned away from it are not yet black."""
    return np.clip((cosine + _AMBIENT) / (1.0 + _AMBIENT), 0.0, 1.0)


def _at_subpixels(values: np.ndarray) -> np.ndarray:
    return values.repeat(SUPERSAMPLING, axis=0).repeat(SUPERSAMPLING, axis=1)


def _smoothed(values: np.ndarray, known: np.ndarray, radius: int) -> np.ndarray:
    """Smooth the known values twice by a square of 2 radius + 1; what is unknown has no say; NaN far from any."""
    middle = np.nanmean(values)  # small numbers keep their digits in the running sums
    total, weight = np.where(known, values - middle, 0.0), known.astype(float)
    for _ in range(2):
        total, weight = _box(total, radius), _box(weight, radius)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(weight > 1e-6, total / weight, np.nan)


def _box(values: np.ndarray, radius: int) -> np.ndarray:
    """Mean over squares of 2 radius + 1; zeros outside."""
    for axis in (0, 1):
        pad = [(0, 0), (0, 0)]
        pad[axis] = (radius + 1, radius)
        sums = np.pad(values, pad)
        np.cumsum(sums, axis=axis, out=sums)
        far, near = [slice(None)] * 2, [slice(None)] * 2
        far[axis], near[axis] = slice(2 * radius + 1, None), slice(None, -2 * radius - 1)
        values = (sums[tuple(far)] - sums[tuple(near)]) / (2 * radius + 1)
    return values
