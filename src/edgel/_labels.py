"""Labels: the kinds of edge that each point is, by strength."""

from __future__ import annotations

import numpy as np

from edgel._kinds import LIKELY
from edgel._range_image import SeenEdges, explaining_view, pixel_size, sides
from edgel._surface import Strengths, Surface
from edgel.edges import EdgeKind

BOLD = np.radians(30.0)  # least turn of the creases that windows in the image add to those of neighbourhoods
COLOR = 0.2  # contrast of a color edge that is as likely as not


class Labels:
    """The kinds (N,) uint8 of the points, and the strength (N,) of the most marked one.

    A kind less likely than not (strength below one half) counts only where no other is more likely. So the kinds of a
    point do not depend on how faint the edges are that were asked for.
    """

    def __init__(self, count: int) -> None:
        self.kind = np.zeros(count, np.uint8)
        self.strength = np.zeros(count)

    def add(self, points: np.ndarray, kind: EdgeKind | np.ndarray, strength: np.ndarray) -> None:
        """Add a kind (one, or (M,) flags) to points (M,), with its strength (M,)."""
        before, flags = self.strength[points], np.where(strength > 0, kind, 0).astype(np.uint8)
        both = (before >= LIKELY) & (strength >= LIKELY)
        alone = np.where(strength > before, flags, self.kind[points])
        self.kind[points] = np.where(both, self.kind[points] | flags, alone)
        self.strength[points] = np.maximum(before, strength)

    def of(self, kinds: EdgeKind, min_strength: float) -> np.ndarray:
        """Return the kinds (N,) uint8 among those wanted, of the points that have the least strength or more."""
        return np.where(self.strength >= min_strength, self.kind & np.uint8(kinds), np.uint8(0))


def label_edges(xyz: np.ndarray, found: Strengths | None, seen: SeenEdges | None, surface: Surface | None) -> Labels:
    """Label the points (N, 3): outlines by the view where there is one, creases by view or surface.

    `surface`, where the sensor's place is not known: its outlines may be told apart by the direction that shows it all.
    """
    labels = Labels(len(xyz))
    if found is not None:
        labels.add(found.points, EdgeKind.CREASE, found.crease)
    if seen is not None:
        # In much noise windows find what neighbourhoods miss, but bends as well.
        bold = slice(None) if found is None else seen.turn > BOLD
        labels.add(seen.creases[bold], EdgeKind.CREASE, seen.crease_strength[bold])
        labels.add(seen.points, seen.kind, seen.strength)
    elif found is not None:
        direction = None if surface is None else explaining_view(surface.index)
        kind = EdgeKind.BOUNDARY
        if surface is not None and direction is not None:
            kind = sides(xyz, direction, found.points, pixel_size(surface.screening.statistics.spacing))
        labels.add(found.points, kind, found.outline)
    return labels


def strength_of_contrast(contrast: np.ndarray) -> np.ndarray:
    """Turn contrasts into strengths, a sure edge's threshold to one half; its fainter parts have that too."""
    return np.where(contrast > 0, np.maximum(contrast / (contrast + COLOR), LIKELY), 0)
