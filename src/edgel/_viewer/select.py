"""What of the edges is shown: filters of what the detector found, cheap enough for every move of a slider."""

from __future__ import annotations

import numpy as np

from edgel._viewer.settings import Settings
from edgel.edges import Edges


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
    if edges.method != "paper":
        edges = edges.take(edges.strength >= settings.strength)
        if settings.angle > 0:
            edges = edges.drop_blunt(settings.angle)
        edges = edges.of_kinds(settings.kinds) if settings.kinds else edges.take(np.empty(0, np.int64))
    if settings.is_cropped:
        edges = edges.crop(xyz, box)
    return edges
