"""A cloud with its edges, laid out once, to be drawn on white or on black."""

from __future__ import annotations

from typing import Any

import numpy as np
from PIL import Image

from edgel.cloud import as_cloud
from edgel.edges import Edges, kind_names
from edgel.plot.legend import Entry, Strip
from edgel.plot.palette import KIND_COLORS, kind_colors, ramp_colors
from edgel.plot.scene import FINE, Scene
from edgel.plot.surface import SHEETS, Sheet, Surface

EDGE_COLORS = ("kind", "strength")

_MARGIN = 0.03  # free rim, as a share of the picture's smaller side


class Drawing:
    """A picture of a cloud and its edges that is still to be drawn on something.

    Parameters
    ----------
    points, edges, direction, size, crop, color_by, edge_color, legend, detail
        As `edgel.plot.picture` takes them.
    """

    def __init__(
        self,
        points: Any,
        edges: Edges | None = None,
        *,
        direction: Any = "auto",
        size: tuple[int, int],
        crop: bool = False,
        color_by: str = "grey",
        edge_color: str = "kind",
        legend: bool = True,
        detail: tuple[Any, float] | None = None,
    ) -> None:
        if edge_color not in EDGE_COLORS:
            raise ValueError(f"edge_color: expected one of {', '.join(EDGE_COLORS)}, got {edge_color!r}")
        cloud = as_cloud(points)
        if edges is not None and edges.num_points != len(cloud):
            raise ValueError(f"edges: found in a cloud of {edges.num_points:,} points, this one has {len(cloud):,}")
        self._surface = Surface(cloud, color_by)
        self._colors, entries = _edge_colors(edges, edge_color)
        self._strip = Strip(entries + self._surface.entries, size[0]) if legend else None
        room = size[1] - (self._strip.height if self._strip else 0)
        if self._strip and (room < size[1] / 2 or not self._strip.fits):
            what = f"{size[0]} x {size[1]} has no room for the legend"
            raise ValueError(f"size: {what}; choose a larger one, or legend=False")
        self._width = size[0]
        self._scene = Scene(cloud, direction=direction, size=(size[0], room), crop=crop, margin=_MARGIN, detail=detail)
        self._shown = None if edges is None else self._scene.on_top(edges.index)

    def on(self, background: str) -> np.ndarray:
        """Draw it on a ``"light"`` or a ``"dark"`` background, (height, width, 3) uint8."""
        sheet = sheet_of(background)
        fine = self._surface.paint(self._scene, sheet)
        if self._shown is not None:
            seen = self._shown >= 0
            fine[seen] = self._colors[self._shown[seen]]
        drawn = reduced(Image.fromarray(fine))
        if self._strip is None:
            return drawn
        canvas = Image.new("RGB", (self._width, len(drawn) + self._strip.height), sheet.paper)
        canvas.paste(Image.fromarray(drawn), ((self._width - drawn.shape[1]) // 2, 0))
        self._strip.draw(canvas, len(drawn), sheet.ink, *self._scene.scale())
        return np.asarray(canvas)


def sheet_of(background: str) -> Sheet:
    """Return what a background is called by."""
    if background not in SHEETS:
        raise ValueError(f"background: expected one of {', '.join(SHEETS)}, got {background!r}")
    return SHEETS[background]


def reduced(fine: Image.Image) -> np.ndarray:
    """Average the fine pixels of each pixel, (H, W, 3) uint8."""
    return np.asarray(fine.reduce(FINE))


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
