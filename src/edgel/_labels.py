"""Labels: the kinds of edge that each point is, by strength."""

from __future__ import annotations

import numpy as np

from edgel._range_image import View, outlines, sides
from edgel._surface import Classification
from edgel.edges import EdgeKind

LIKELY = 0.5  # strength of an edge that is as likely as not
EVEN = (0.45, 0.5)  # probability of an edge that is as likely as not: least, on the vaguest cloud, and most
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


def label_edges(classified: Classification, view: View, xyz: np.ndarray) -> Labels:
    """Label the points (N, 3): creases by the surface, its outline by the view where there is one."""
    labels = Labels(len(xyz))
    labels.add(classified.points, EdgeKind.CREASE, strength_of_probability(classified.crease))
    if view.image is None:
        direction, points = view.direction, classified.points
        kind = EdgeKind.BOUNDARY if direction is None else sides(xyz, direction, points)
        labels.add(points, kind, strength_of_probability(classified.outline))
    else:
        outline = outlines(view.image, xyz)
        labels.add(np.arange(len(xyz)), outline.kind, outline.strength)
    return labels


def strength_of_probability(probability: np.ndarray) -> np.ndarray:
    """Turn the probabilities of one kind into strengths, so that one half is the best place to draw the line.

    The expected F1 is greatest at half of it (Lipton et al. 2014, doi:10.1007/978-3-662-44851-9_15): near one half
    where edges are plain, lower where noise leaves none of them sure. Odds keep their ratio.
    """
    falling = np.sort(probability)[::-1]
    expected = np.cumsum(falling) / (np.arange(1, len(falling) + 1) + falling.sum())
    even = min(max(float(expected.max(initial=0.0)), EVEN[0]), EVEN[1])
    return probability * (1 - even) / (probability * (1 - even) + even * (1 - probability))


def strength_of_contrast(contrast: np.ndarray) -> np.ndarray:
    """Turn contrasts into strengths, a sure edge's threshold to one half; its fainter parts have that too."""
    return np.where(contrast > 0, np.maximum(contrast / (contrast + COLOR), LIKELY), 0)
