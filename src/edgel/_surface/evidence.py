"""The costly evidence of the points where an edge could be, and the fit of two planes that places it best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import at_places
from edgel._surface import context, gather, hinge, minimal_planes, sectors, two_planes
from edgel._surface.features import NUM_EVIDENCE, POINT
from edgel._surface.plane_scales import SCALES
from edgel._surface.screen import Screening
from edgel._surface.two_planes import FITS

MAX_AWAY = 1.5  # spacings: a line farther from the point is not its edge
MIN_TURN = math.radians(12.0)  # of two planes that make an edge
_MOST = 0.7  # of the turn that any neighbourhood shows
_FLOOR = 0.02  # spacings: residuals below it do not make one fit better than another
_OF_FITS = POINT.block("two_planes")
_COS_MIN = math.cos(math.radians(20.0))  # of two planes through a point, whose angle is at least this


@dataclass(frozen=True, eq=False)
class Evidence:
    """The costly evidence of some points.

    Attributes
    ----------
    features : (M, NUM_EVIDENCE) float32
        The first columns of `edgel._surface.features.POINT`.
    fit : (M, 24) float32
        The two planes, relative to the point, of the fit that places its edge best, by the rows that
        `edgel._surface.hinge` names.
    placed : (M,) bool
        Whether any fit places an edge near the point.
    """

    features: np.ndarray
    fit: np.ndarray
    placed: np.ndarray

    def take(self, rows: np.ndarray) -> Evidence:
        """Return the evidence of some of the points."""
        return Evidence(self.features[rows], self.fit[rows], self.placed[rows])

    @staticmethod
    def join(parts: Sequence[Evidence]) -> Evidence:
        """Put the points of several together; of none, an empty one."""
        nothing = Evidence(
            np.zeros((0, NUM_EVIDENCE), np.float32), np.zeros((0, hinge.HINGE), np.float32), np.zeros(0, bool)
        )
        names = Evidence.__dataclass_fields__
        return Evidence(*(np.concatenate([getattr(part, name) for part in (nothing, *parts)]) for name in names))


def gather_evidence(index: NeighborIndex, screening: Screening, places: np.ndarray) -> Evidence:
    """Gather the costly evidence at some places (M,), ascending, of the index."""
    features = np.zeros((len(places), NUM_EVIDENCE), np.float32)
    found = np.zeros((len(places), len(FITS), hinge.HINGE), np.float32)
    if len(places):
        visit_neighbors(
            gather.gather_evidence,
            at_places(index, places, stretch=screening.stretch),
            index,
            min(FITS[-1][0], len(index)),
            screening.normals,
            screening.statistics.features,
            np.array(SCALES),
            np.array(FITS),
            np.array(minimal_planes.FITS),
            np.array(sectors.COUNTS),
            _COS_MIN,
            features,
            found,
        )
    best, placed = _best_fit(features)
    return Evidence(features, found[np.arange(len(best)), best], placed)


def _best_fit(features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Choose for each point the fit that places its edge best, (M,) int64; and whether any does, (M,) bool.

    The error of a line fitted to K points falls with the residual over the root of K: small fits win at curved and
    crowded edges, large ones under noise.
    """
    fits = features[:, _OF_FITS].reshape(-1, len(FITS), two_planes.NUM_FEATURES)
    residual, turn, away = (
        fits[:, :, i].astype(np.float64) for i in (two_planes.TWO_PLANES, two_planes.TURN, two_planes.FOOT_AWAY)
    )
    error = (np.exp(residual) - 0.01 + _FLOOR) / np.sqrt([count for count, _ in FITS])
    error[(away > MAX_AWAY) | ~(turn > MIN_TURN)] = np.inf
    best = error.argmin(axis=1)
    return best, np.isfinite(error[np.arange(len(error)), best])


def support(evidence: Evidence) -> np.ndarray:
    """Return the least number of neighbours, of those of `FITS`, that show most of each edge's turn, (M,) int64.

    Sharp edges show it to the few nearest; one that is rounded only to as many as reach over its bend.
    """
    fits = evidence.features[:, _OF_FITS].reshape(-1, len(FITS), two_planes.NUM_FEATURES)
    turn = np.where(fits[:, :, two_planes.FOOT_AWAY] <= MAX_AWAY, fits[:, :, two_planes.TURN], 0.0)
    shown = turn >= _MOST * turn.max(axis=1, keepdims=True)
    return np.array([count for count, _ in FITS])[shown.argmax(axis=1)]


def with_context(
    index: NeighborIndex,
    places: np.ndarray,
    evidence: Evidence,
    crease: np.ndarray,
    outline: np.ndarray,
    stretch: np.ndarray | None = None,
) -> np.ndarray:
    """Add to the evidence of some points how likely their neighbours are edge points.

    Parameters
    ----------
    index : NeighborIndex
    places : (M,) int64
        Of these points, ascending.
    evidence : Evidence
    crease, outline : (M,) float64
        Probabilities by the evidence alone; at all other points they are 0.
    stretch : (3, N) float64 or None
        Of each place on scan lines: see `edgel._neighbors.scan_lines`.

    Returns
    -------
    (M, len(POINT)) float32
        All columns of `edgel._surface.features.POINT`.
    """
    probability = np.zeros((2, len(index)), np.float32)
    probability[:, places] = crease, outline
    slot = np.full(len(index), -1, np.int32)
    slot[places[evidence.placed]] = np.flatnonzero(evidence.placed)
    lines, feet = (np.ascontiguousarray(evidence.fit[:, i : i + 3]) for i in (hinge.LINE, hinge.FOOT))
    around = np.zeros((2, len(places), context.NUM_FEATURES), np.float32)
    if len(places):
        k = min(context.NEIGHBORS + 1, len(index))
        arguments = (probability, slot, lines, feet, around)
        asked = at_places(index, places, stretch=stretch)
        visit_neighbors(context.gather_context, asked, index, k, *arguments)
    return np.concatenate([evidence.features, *around], axis=1)
