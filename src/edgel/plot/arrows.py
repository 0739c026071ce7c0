"""Normals as arrows: of an even selection of the edge points that a picture shows."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw

from edgel.edges import Edges
from edgel.plot.zbuffer import SUPERSAMPLING, ZBuffer

LONGEST = 0.08
"""Length of an arrow seen from the side, as a share of the picture's smaller side; at an angle it looks shorter."""

_CELL = 0.035  # side of the cells of the picture that get one arrow each, in the same share
_WIDTH, _THINNEST = 1 / 360, 1.4  # of a shaft: in the same share, and in pixels
_HEAD = 5.0  # length of a head in widths of the shaft


class Arrows:
    """Arrows on a picture of a cloud.

    Parameters
    ----------
    buffer : ZBuffer
        Of the cloud.
    edges : Edges
        Those without a normal get no arrow.
    """

    def __init__(self, buffer: ZBuffer, edges: Edges) -> None:
        normals = edges.normals[:, 0]
        known = np.flatnonzero(np.isfinite(normals).all(axis=1))
        unit = min(buffer.width, buffer.height)
        chosen, self._starts = buffer.sample_evenly(edges.index[known], _CELL * unit)
        along = normals[known[chosen]] @ np.column_stack([buffer.camera.right, -buffer.camera.up])
        self._stops = self._starts + along * LONGEST * unit
        self._width = max(_THINNEST * SUPERSAMPLING, _WIDTH * unit)

    def draw(self, image: Image.Image, color: tuple[int, int, int]) -> None:
        """Draw them on an image of the subpixels."""
        draw = ImageDraw.Draw(image)
        for start, stop in zip(self._starts, self._stops, strict=True):
            draw_arrow(draw, start, stop, width=self._width, color=color)


def draw_arrow(
    draw: ImageDraw.ImageDraw, start: np.ndarray, stop: np.ndarray, *, width: float, color: tuple[int, int, int]
) -> None:
    """Draw a shaft as wide as told and a head, a dot where the arrow points at the viewer."""
    length = float(np.hypot(*(stop - start)))
    if length < 3 * width:
        draw.ellipse([*(start - width), *(start + width)], fill=color)
        return
    along = (stop - start) / length
    across = np.array([-along[1], along[0]])
    head = min(_HEAD * width, 0.6 * length)
    neck = stop - along * head
    draw.line([tuple(start), tuple(neck)], fill=color, width=round(width))
    draw.polygon([tuple(stop), tuple(neck + 0.4 * head * across), tuple(neck - 0.4 * head * across)], fill=color)
