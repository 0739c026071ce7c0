"""Pictures of clouds with their edges on top, a legend and a scale bar below."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np
from PIL import Image

from edgel.cloud import as_cloud
from edgel.edges import Edges, kind_names
from edgel.io.files import replacing
from edgel.plot.arrows import LONGEST, Arrows
from edgel.plot.camera import Viewport
from edgel.plot.legend import Entry, Legend
from edgel.plot.palette import KIND_COLORS, THEMES, kind_colors, ramp_colors
from edgel.plot.shading import Shading
from edgel.plot.zbuffer import SUPERSAMPLING, ZBuffer

EDGE_COLORS = ("kind", "strength")


def picture(
    points: Any,
    edges: Edges | None = None,
    *,
    direction: Any = "auto",
    size: tuple[int, int] = (1200, 900),
    crop: bool = False,
    color_by: str = "grey",
    edge_color: str = "kind",
    normals: bool = False,
    background: str = "light",
    legend: bool = True,
    detail: tuple[Any, float] | None = None,
    point_size: float | None = None,
) -> np.ndarray:
    """Draw a cloud and its edges on top, with a legend and a scale bar.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        Points that are not finite are left out; a few far outliers may fall outside the picture.
    edges : Edges, optional
        Of these points. Those hidden behind nearer parts of the cloud are not drawn. ``edges.of_kinds("crease")`` and
        ``edges.take(edges.strength > 0.9)`` choose some.
    direction : {"auto", "top", "oblique", "sensor"} or (3,) array_like
        ``"top"`` looks down -Z as the paper does, ``"sensor"`` from the cloud's viewpoint, ``"oblique"`` from the front
        and above; ``"auto"`` takes the sensor's view where there is one. A vector points away from the viewer.
    size : (int, int)
        Width and height, in pixels.
    crop : bool
        Make the picture no larger than the cloud and the legend need.
    color_by : {"grey", "rgb", "intensity", "height", "normals"}
        Color of the surface: none but its shading; the colors or the intensity that the cloud carries; z, from violet
        to green; or the slope, with x, y, z of the normal as red, green, blue.
    edge_color : {"kind", "strength"}
        Color of the edge points: `edgel.plot.palette.KIND_COLORS`, or from light green, the weakest, to violet.
    normals : bool
        Draw the first normal of the edge points as arrows, at an even selection of them.
    background : {"light", "dark"}
        What the picture is drawn on.
    legend : bool
        Say below the cloud what the colors mean, and how long things are: the bar in units of the cloud, in perspective
        at half of what is seen.
    detail : ((3,) array_like, float), optional
        Show only what lies around a place, and how wide a piece, in the cloud's unit.
    point_size : float, optional
        Width of the points, in pixels. Default: so wide that they close to a surface.

    Returns
    -------
    (height, width, 3) uint8
        RGB.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no finite coordinates or not what it shall be colored by, `edges` are of another cloud, an
        option is out of its range, or the legend leaves no space for the cloud.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> from edgel import plot
    >>> x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    >>> plot.save("roof.png", plot.picture(roof, edgel.detect(roof), size=(400, 300)))
    """
    viewport = Viewport(size, direction, crop=crop, detail=detail, point_size=point_size)
    look = {"color_by": color_by, "edge_color": edge_color, "normals": normals, "legend": legend}
    return Drawing(points, edges, viewport, **look).on(background)


def save(path: str | os.PathLike[str], picture: np.ndarray) -> None:
    """Write a picture (H, W, 3) uint8 as PNG, in one step.

    Raises
    ------
    OSError
        If it cannot be written there.
    """
    with replacing(path) as file:
        Image.fromarray(picture).save(file, format="PNG", optimize=True)


class Drawing:
    """A picture of a cloud and its edges, laid out once, to be drawn on a light or a dark background.

    Parameters
    ----------
    points, edges, color_by, edge_color, normals, legend
        As `picture` takes them.
    viewport : Viewport

    Attributes
    ----------
    buffer : ZBuffer
        Of the cloud.
    """

    def __init__(
        self,
        points: Any,
        edges: Edges | None,
        viewport: Viewport,
        *,
        color_by: str = "grey",
        edge_color: str = "kind",
        normals: bool = False,
        legend: bool = True,
    ) -> None:
        if edge_color not in EDGE_COLORS:
            raise ValueError(f"edge_color: expected one of {', '.join(EDGE_COLORS)}, got {edge_color!r}")
        cloud = as_cloud(points)
        if edges is not None and edges.num_points != len(cloud):
            raise ValueError(f"edges: found in a cloud of {edges.num_points:,} points, this one has {len(cloud):,}")
        viewport.check()
        self._width, height = viewport.size
        self._singly = viewport.point_size is not None
        self._shading = Shading(cloud, color_by)
        self._edge_colors, entries = _edge_colors(edges, edge_color)
        pointed = edges if normals else None
        if pointed is not None:
            entries.append(Entry.arrow("normals"))
            viewport = replace(viewport, margin=LONGEST)
        self._legend = Legend(entries + self._shading.entries, viewport.size) if legend else None
        if self._legend is not None:
            height -= self._legend.height
        self.buffer = ZBuffer(cloud, replace(viewport, size=(self._width, height)))
        self._shown = None if edges is None else self.buffer.overlay(edges.index)
        self._arrows = None if pointed is None else Arrows(self.buffer, pointed)

    def on(self, background: str) -> np.ndarray:
        """Draw it on a ``"light"`` or a ``"dark"`` background, (height, width, 3) uint8."""
        if background not in THEMES:
            raise ValueError(f"background: expected one of {', '.join(THEMES)}, got {background!r}")
        theme = THEMES[background]
        painted = self._shading.paint(self.buffer, theme, singly=self._singly)
        if self._shown is not None:
            seen = self._shown >= 0
            painted[seen] = self._edge_colors[self._shown[seen]]
        image = Image.fromarray(painted)
        if self._arrows is not None:
            self._arrows.draw(image, theme.ink)
        image = image.reduce(SUPERSAMPLING)
        if self._legend is None:
            return np.asarray(image)
        canvas = Image.new("RGB", (self._width, image.height + self._legend.height), theme.background)
        canvas.paste(image, ((self._width - image.width) // 2, 0))
        self._legend.draw(canvas, image.height, theme.ink, *self.buffer.scale())
        return np.asarray(canvas)


def _edge_colors(edges: Edges | None, edge_color: str) -> tuple[np.ndarray, list[Entry]]:
    """Colors (E, 3) of the edge points, and what the legend has to say of them."""
    if edges is None:
        return np.empty((0, 3), np.uint8), []
    if edge_color == "kind":
        counts = edges.count_kinds()
        names = {kind_names(kind)[0]: color for kind, color in KIND_COLORS.items()}
        entries = [
            Entry(np.array([color], np.uint8), f"{name} {counts[name]:,}")
            for name, color in names.items()
            if name in counts
        ]
        return kind_colors(edges.kind), entries
    low, high = (edges.strength.min(), edges.strength.max()) if len(edges) else (0.0, 1.0)
    share = (edges.strength - low) / (high - low) if high > low else np.ones(len(edges))
    # Surfaces are light: what is strong shall be dark.
    ramp = ramp_colors(np.linspace(1, 0, 32))
    return ramp_colors(1.0 - share), [Entry(ramp, f"{high:.2f}", f"strength {low:.2f}")]
