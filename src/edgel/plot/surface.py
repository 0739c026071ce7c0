"""How the surface of a cloud looks in a picture: its colors, and what they mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._color.channels import intensity_of, rgb_of
from edgel.cloud import Cloud, check_points
from edgel.plot.legend import Entry
from edgel.plot.palette import height_colors, height_limits, muted, ramp_colors
from edgel.plot.scene import Scene

COLOR_BY = ("grey", "rgb", "intensity", "height", "normals")


@dataclass(frozen=True, eq=False)
class Sheet:
    """What a picture is drawn on.

    Attributes
    ----------
    paper, ink : (int, int, int)
        Color where there is nothing, and of letters.
    greys : (int, int)
        Of the darkest and of the lightest slope.
    """

    paper: tuple[int, int, int]
    ink: tuple[int, int, int]
    greys: tuple[int, int]


SHEETS = {
    "light": Sheet((255, 255, 255), (28, 28, 28), (120, 236)),
    "dark": Sheet((23, 23, 26), (232, 232, 230), (105, 205)),
}


class Surface:
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
        self._colors = np.empty((0, 3))  # one a point, 0 to 255; grey and normals come from the picture
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

    def paint(self, scene: Scene, sheet: Sheet) -> np.ndarray:
        """Paint the scene of the cloud, (height, width, 3) uint8 at its fine pixels."""
        shade = scene.shaded_by_slope()
        if self._color_by == "grey":
            colors = (sheet.greys[0] + (sheet.greys[1] - sheet.greys[0]) * shade)[..., None]
        elif self._color_by == "normals":
            colors = muted(127.5 * (1.0 + scene.normals_by_slope()), shade)
        else:
            colors = self._colors[scene.rows][scene.winner]
            if self._color_by == "height":
                colors = muted(colors, shade)
        painted = np.empty((*scene.covered.shape, 3), np.uint8)
        painted[...] = (colors + 0.5).astype(np.uint8)
        painted[~scene.covered] = sheet.paper
        return painted


def _carried(cloud: Cloud, color_by: str) -> np.ndarray:
    """The cloud's own colors, (N, 3) in 0 to 255."""
    values = rgb_of(cloud) if color_by == "rgb" else intensity_of(cloud)
    if values is None:
        lacks = "no red, green and blue" if color_by == "rgb" else "no intensity that differs between points"
        raise ValueError(f"color_by: the cloud carries {lacks}; color it by grey, height or normals")
    values = 255.0 * np.nan_to_num(values, nan=0.5)
    return (values if values.ndim == 2 else values[:, None].repeat(3, axis=1)).astype(np.float32)
