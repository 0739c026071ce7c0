"""What of the edges is shown: filters of what the detector found, cheap enough for every move of a slider."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from edgel.edges import EdgeKind, Edges
from edgel.view.settings import Settings

E = TypeVar("E", bound=Edges)


def drop_blunt(edges: E, angle: float) -> E:
    """Take the flag of a crease from edge points whose faces turn less than an angle, in radians.

    Those that are nothing else disappear. Where the angle is not known the crease stays.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    >>> edges = edgel.detect(roof, kinds="crease")
    >>> len(drop_blunt(edges, np.radians(80))) > 30, len(drop_blunt(edges, np.radians(100)))
    (True, 0)
    """
    blunt = edges.angle < angle
    kind = np.where(blunt, edges.kind & ~np.uint8(EdgeKind.CREASE), edges.kind)
    return replace(edges, kind=kind).take(kind > 0)


def in_box(xyz: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Mark the points (N, 3) inside a box, its lower and upper corner (2, 3), (N,) bool."""
    return ((xyz >= box[0]) & (xyz <= box[1])).all(axis=1)


def select(edges: Edges, xyz: np.ndarray, settings: Settings, box: np.ndarray) -> Edges:
    """Return the edges that settings show, of those that were found.

    Parameters
    ----------
    edges : Edges
    xyz : (N, 3) float64
        Of the whole cloud.
    settings : Settings
    box : (2, 3) float64
        The crop box.
    """
    if edges.preset == "default":
        edges = edges.take(edges.strength >= settings.strength)
        if settings.angle > 0:
            edges = drop_blunt(edges, settings.angle)
        edges = edges.only(settings.kinds) if settings.kinds else edges.take(np.empty(0, np.int64))
    if settings.is_cropped:
        edges = edges.take(in_box(xyz[edges.index], box))
    return edges
