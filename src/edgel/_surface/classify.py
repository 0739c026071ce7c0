"""Classification: which of the points where an edge could be lie on a crease, and where the surface ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex
from edgel._surface.evidence import Evidence, gather_evidence, with_context
from edgel._surface.forest import evaluate, load_forests
from edgel._surface.screen import Screening

SECOND = 0.02  # least probability of an edge, by a point's own evidence, for looking at its context
_BLOCK = 65_536  # points whose evidence is held at a time


@dataclass(frozen=True, eq=False)
class Classification:
    """How likely some points are edge points; all others are none.

    Attributes
    ----------
    points : (M,) int64
        Ascending.
    crease, outline : (M,) float64
        Probability that a crease runs through the cell of each point, and that the surface ends there.
    evidence : Evidence
    """

    points: np.ndarray
    crease: np.ndarray
    outline: np.ndarray
    evidence: Evidence

    def take(self, some: np.ndarray) -> Classification:
        """Return the classification of some of these points."""
        return Classification(self.points[some], self.crease[some], self.outline[some], self.evidence.take(some))


def classify(
    index: NeighborIndex, screening: Screening, asked: np.ndarray | None = None, every: np.ndarray | None = None
) -> Classification:
    """Classify the candidates of a screening by their own evidence, and the likely ones again by their context.

    Those at some places alone, `asked` (N,) bool, where these are given: what is said at one of them is the same as
    long as all candidates among those nearest to it are asked for too (`edgel._surface.reach.with_context_of`).
    `every` (2, N) takes, where it is given, the probability of a crease and of an outline at all candidates, by point.
    """
    trees, candidates = load_forests(), screening.candidates
    if asked is not None:
        candidates = candidates[asked[candidates]]
    kept, parts, probabilities = [], [], []
    for start in range(0, len(candidates), _BLOCK):
        places = candidates[start : start + _BLOCK]
        evidence = gather_evidence(index, screening, places)
        first = np.stack([evaluate(trees[f"first {kind}"], evidence.features) for kind in ("crease", "outline")])
        likely = np.flatnonzero((first > SECOND).any(axis=0))
        if every is not None:
            every[:, index.order[places]] = first
        kept.append(places[likely])
        probabilities.append(first[:, likely])
        parts.append(evidence.take(likely))
    places = np.concatenate([np.zeros(0, np.int64), *kept])
    (crease, outline), evidence = np.concatenate([np.zeros((2, 0)), *probabilities], axis=1), Evidence.join(parts)
    features = with_context(index, places, evidence, crease, outline, screening.stretch)
    points = index.order[places]
    crease, outline = evaluate(trees["crease"], features), evaluate(trees["outline"], features)
    if every is not None:
        every[:, points] = crease, outline
    ascending = np.argsort(points)
    return Classification(points[ascending], crease[ascending], outline[ascending], evidence.take(ascending))
