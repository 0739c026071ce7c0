"""The colors of edges, one for each kind, the same in pictures, figures, reports and viewers.

They are told apart with normal vision and without red, green or blue cones, from each other and from the greys of a
shaded surface, on white and on black (`tests/plot/test_palette.py` measures it). Kinds that belong together look
related: the near and the far side of a depth step are a dark and a light blue.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from edgel.edges import EdgeKind

KIND_COLORS: dict[EdgeKind, tuple[int, int, int]] = {
    EdgeKind.BOUNDARY: (102, 102, 255),  # periwinkle, which stands out from the background beside it, light or dark
    EdgeKind.OCCLUDING: (85, 17, 170),  # indigo
    EdgeKind.OCCLUDED: (85, 187, 255),  # sky
    EdgeKind.CREASE: (221, 51, 0),  # vermilion
    EdgeKind.COLOR: (238, 170, 0),  # amber
    EdgeKind.IMAGE: (136, 0, 51),  # wine
    EdgeKind.FRAME: (0, 0, 0),  # black
}
"""Color of each kind, RGB, 0 to 255; a point of several kinds wears that of the first of them here."""

ANY_KIND = KIND_COLORS[EdgeKind.CREASE]
"""Color of edge points whose kind is not told."""


@dataclass(frozen=True, eq=False)
class Theme:
    """The colors of a picture's background and of what is drawn on it.

    Attributes
    ----------
    background, ink : (int, int, int)
        Color where there is nothing, and of letters, scale bar and arrows.
    greys : (int, int)
        Of the darkest and of the lightest slope of a surface.
    point_greys : (int, int)
        The same of points drawn singly, which have to stand out from the background.
    """

    background: tuple[int, int, int]
    ink: tuple[int, int, int]
    greys: tuple[int, int]
    point_greys: tuple[int, int]


THEMES = {
    "light": Theme((255, 255, 255), (28, 28, 28), greys=(120, 236), point_greys=(20, 170)),
    "dark": Theme((23, 23, 26), (232, 232, 230), greys=(105, 205), point_greys=(105, 240)),
}

# Viridis (S. van der Walt, N. Smith, CC0) at even steps: ever lighter, for eyes that tell no hues apart too.
_RAMP = np.array(
    [(68, 1, 84), (70, 50, 127), (54, 92, 141), (39, 127, 142), (31, 161, 135), (74, 194, 109), (159, 218, 58)], float
)

_TAIL = 1.0  # percent of the heights at either end that share the ramp's end colors
_DARKEST = 0.62  # what is left of a color on the slope that gets least light
_PALE, _PALE_GREY = 0.45, 225  # share of this grey in the colors of a surface, so that edges stand out


def kind_colors(kind: Any) -> np.ndarray:
    """Return the color of each edge point.

    Parameters
    ----------
    kind : (E,) int array_like
        `EdgeKind` flags.

    Returns
    -------
    (E, 3) uint8
        RGB.

    Examples
    --------
    >>> kind_colors([EdgeKind.CREASE, EdgeKind.CREASE | EdgeKind.BOUNDARY]).tolist()
    [[221, 51, 0], [102, 102, 255]]
    """
    kind = np.asarray(kind)
    colors = np.tile(np.array(ANY_KIND, np.uint8), (len(kind), 1))
    for flag, color in reversed(KIND_COLORS.items()):
        colors[(kind & int(flag)) > 0] = color
    return colors


def ramp_colors(values: Any) -> np.ndarray:
    """Return a color for each value from 0 (dark violet) to 1 (light green), the lighter the larger.

    Parameters
    ----------
    values : (E,) array_like
        What lies outside 0 to 1 gets the color of the nearer end.

    Returns
    -------
    (E, 3) uint8
        RGB.

    Examples
    --------
    >>> ramp_colors([0.0, 1.0]).tolist()
    [[68, 1, 84], [159, 218, 58]]
    """
    places = np.clip(np.asarray(values, float), 0.0, 1.0) * (len(_RAMP) - 1)
    steps = np.arange(len(_RAMP))
    return np.column_stack([np.rint(np.interp(places, steps, channel)) for channel in _RAMP.T]).astype(np.uint8)


def height_colors(heights: Any, of: Any) -> np.ndarray:
    """Return a color for each height, between the lowest and the highest but for one in a hundred at either end.

    Parameters
    ----------
    heights : (E,) array_like
        Those that are not finite get the color of the lowest.
    of : (N,) array_like
        Heights of the whole cloud, all finite, which decide about the ends.

    Returns
    -------
    (E, 3) uint8
        RGB.

    Examples
    --------
    >>> height_colors([0.0, 100.0], np.arange(101.0)).tolist()
    [[68, 1, 84], [159, 218, 58]]
    """
    low, high = height_limits(of)
    return ramp_colors(np.nan_to_num((np.asarray(heights, float) - low) / (high - low or 1.0)))


def height_limits(heights: Any) -> tuple[float, float]:
    """Return the heights that wear the end colors, of heights (N,), all finite."""
    low, high = np.percentile(heights, [_TAIL, 100.0 - _TAIL])
    return float(low), float(high)


def muted(colors: np.ndarray, shade: np.ndarray | float = 1.0) -> np.ndarray:
    """Darken colors (..., 3), 0 to 255, by a shade (...,) from 0 to 1, and pale them: of a surface below its edges."""
    lit = colors.astype(np.float32) * (_DARKEST + (1.0 - _DARKEST) * np.asarray(shade, np.float32))[..., None]
    return (1.0 - _PALE) * lit + _PALE * _PALE_GREY


def as_hex(color: tuple[int, int, int]) -> str:
    """Write a color as web pages and Matplotlib take it.

    Examples
    --------
    >>> as_hex((221, 51, 0))
    '#dd3300'
    """
    return "#{:02x}{:02x}{:02x}".format(*color)
