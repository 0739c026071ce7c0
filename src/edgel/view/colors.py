"""Colors of clouds and edges, (N, 3) uint8."""

from __future__ import annotations

import numpy as np

from edgel.color.channels import color_channels, intensity_of, rgb_of
from edgel.edges import EdgeKind, Edges
from edgel.palette import kind_colors, ramp_colors
from edgel.view.settings import Coloring
from edgel.view.source import Source

KIND_MEANINGS: dict[EdgeKind, str] = {
    EdgeKind.OCCLUDING: "near side of a step in depth",
    EdgeKind.OCCLUDED: "far side, behind it",
    EdgeKind.BOUNDARY: "the surface ends",
    EdgeKind.CREASE: "two faces meet",
    EdgeKind.COLOR: "a step in color or intensity",
    EdgeKind.IMAGE: "edge of the projected image",
}

_HEIGHT_RAMP = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [240, 220, 60]], float)
_LIGHT = np.array([-0.35, -0.45, 0.82])  # towards the light, in the scene: from the left, the front and above
_GREYS = (105.0, 232.0)
_FLAT_GREY = 180


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


def cloud_colors(source: Source, coloring: Coloring, rotation: np.ndarray) -> np.ndarray:
    """Color the points of a file that are drawn.

    Parameters
    ----------
    source : Source
        Already read.
    coloring : Coloring
        Grey where the file does not carry it.
    rotation : (3, 3) float64
        Turns directions of the cloud into those of the scene, whose light shades the grey.
    """
    assert source.cloud is not None
    if coloring is Coloring.OWN and (rgb := rgb_of(source.cloud)) is not None:
        return (255 * np.nan_to_num(rgb[source.shown], nan=0.5) + 0.5).astype(np.uint8)
    if coloring is Coloring.INTENSITY and (intensity := intensity_of(source.cloud)) is not None:
        return _ramp(intensity[source.shown], np.array([[20.0] * 3, [245.0] * 3]))
    if coloring is Coloring.HEIGHT:
        height = source.cloud.xyz[source.shown] @ rotation[2]
        low, high = np.percentile(height, [1.0, 99.0])
        return _ramp((height - low) / max(high - low, 1e-300), _HEIGHT_RAMP)
    if source.normals is None:
        return np.full((len(source.shown), 3), _FLAT_GREY, np.uint8)
    normals = source.normals @ rotation.T.astype(np.float32)
    if coloring is Coloring.NORMALS:
        return (127.5 * np.nan_to_num(normals) + 128).astype(np.uint8)
    light = np.clip(np.nan_to_num(normals @ _LIGHT.astype(np.float32)) * 0.65 + 0.35, 0.0, 1.0)
    grey = (_GREYS[0] + (_GREYS[1] - _GREYS[0]) * light).astype(np.uint8)
    return grey[:, None].repeat(3, axis=1)


def edge_colors(edges: Edges, *, by_strength: bool, least: float) -> np.ndarray:
    """Color edge points by their kind, or by strength from `least` (light) to 1 (dark)."""
    if not by_strength:
        return kind_colors(edges.kind)
    if edges.preset == "paper":  # its strengths are shares of the largest step there can be: all small
        return ramp_colors(1.0 - edges.strength / edges.strength.max(initial=1e-9))
    return ramp_colors((1.0 - edges.strength) / (1.0 - least))


def _ramp(values: np.ndarray, stops: np.ndarray) -> np.ndarray:
    at = np.nan_to_num(np.clip(values, 0.0, 1.0))
    along = np.linspace(0.0, 1.0, len(stops))
    return np.column_stack([np.interp(at, along, channel) for channel in stops.T]).astype(np.uint8)
