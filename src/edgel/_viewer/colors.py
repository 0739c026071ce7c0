"""Colors of clouds and edges, (N, 3) uint8."""

from __future__ import annotations

import numpy as np

from edgel._color.channels import color_channels, intensity_of, rgb_of
from edgel._kinds import LIKELY
from edgel._viewer.settings import Coloring
from edgel._viewer.source import Source
from edgel.edges import EdgeKind, Edges
from edgel.plot.palette import height_colors, kind_colors, muted, ramp_colors

KIND_MEANINGS: dict[EdgeKind, str] = {
    EdgeKind.OCCLUDING: "near side of a step in depth",
    EdgeKind.OCCLUDED: "far side, behind it",
    EdgeKind.BOUNDARY: "the surface ends",
    EdgeKind.CREASE: "two faces meet",
    EdgeKind.COLOR: "a step in color or intensity",
    EdgeKind.IMAGE: "edge of the projected image",
    EdgeKind.FRAME: "the end of what the sensor sees",
}

_LIGHT = np.array([-0.35, -0.45, 0.82])  # towards the light, in the scene: from the left, the front and above
_GREYS = (105.0, 232.0)
_INTENSITY_GREYS = (20.0, 245.0)
_FLAT_GREY = 180
_PALE_GREY = 225  # what unlikely edge points fade into, all the more the less likely


def colorings(source: Source) -> list[Coloring]:
    """Return what the points of a file can be colored by."""
    found = [Coloring.GREY, Coloring.HEIGHT, Coloring.NORMALS]
    if source.cloud is not None:
        channels = color_channels(source.cloud)
        if channels is not None and channels.shape[1] == 3:
            found.append(Coloring.OWN)
        if intensity_of(source.cloud) is not None:
            found.append(Coloring.INTENSITY)
    return found


def cloud_colors(source: Source, at: np.ndarray, coloring: Coloring, rotation: np.ndarray) -> np.ndarray:
    """Color points of a file.

    Parameters
    ----------
    source : Source
        Already read.
    at : (D,) int64
        Indices into `source.shown` of the points to color.
    coloring : Coloring
        Grey where the file does not carry it.
    rotation : (3, 3) float64
        Turns directions of the cloud into those of the scene, whose light shades the grey.
    """
    assert source.cloud is not None
    rows = source.shown[at]
    if coloring is Coloring.OWN and (rgb := rgb_of(source.cloud)) is not None:
        return (255 * np.nan_to_num(rgb[rows], nan=0.5) + 0.5).astype(np.uint8)
    if coloring is Coloring.INTENSITY and (intensity := intensity_of(source.cloud)) is not None:
        low, high = _INTENSITY_GREYS
        grey = low + (high - low) * np.nan_to_num(np.clip(intensity[rows], 0.0, 1.0))
        return grey.astype(np.uint8)[:, None].repeat(3, axis=1)
    normals = None if source.normals is None else source.normals[at] @ rotation.T.astype(np.float32)
    if coloring is Coloring.NORMALS and normals is not None:
        return (127.5 * np.nan_to_num(normals) + 128).astype(np.uint8)
    light = np.ones(len(at))
    if normals is not None:
        light = np.clip(np.nan_to_num(normals @ _LIGHT.astype(np.float32)) * 0.65 + 0.35, 0.0, 1.0)
    if coloring is Coloring.HEIGHT:
        heights = source.cloud.xyz[:, 2]  # as in pictures, whatever stands upright in the scene
        return (muted(height_colors(heights[rows], heights[source.shown]), light) + 0.5).astype(np.uint8)
    if normals is None:
        return np.full((len(at), 3), _FLAT_GREY, np.uint8)
    grey = (_GREYS[0] + (_GREYS[1] - _GREYS[0]) * light).astype(np.uint8)
    return grey[:, None].repeat(3, axis=1)


def edge_colors(edges: Edges, *, by_strength: bool, least: float) -> np.ndarray:
    """Color edge points by their kind, unlikely ones paler, or by strength from `least` (light) to 1 (dark)."""
    if not by_strength:
        colors = kind_colors(edges.kind)
        if edges.method == "paper":
            return colors
        doubt = np.clip(1.0 - edges.strength / LIKELY, 0.0, 1.0)[:, None]
        return (colors + doubt * (_PALE_GREY - colors.astype(np.float32)) + 0.5).astype(np.uint8)
    if edges.method == "paper":  # its strengths are shares of the largest step there can be: all small
        return ramp_colors(1.0 - edges.strength / edges.strength.max(initial=1e-9))
    return ramp_colors((1.0 - edges.strength) / (1.0 - least))
