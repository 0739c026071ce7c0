"""Where the line is drawn between edges and none: from probabilities to strengths, by what the cloud itself says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.union_find import keep_linked
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import at_points
from edgel.edges import EdgeKind

EVEN = (0.2, 0.5)  # probability that is as likely as not an edge's: least, on the vaguest cloud, and most
SURE = 0.44  # where it lies on a cloud whose edges are plain; above it a point needs no other
STRONG = 0.4  # what a chain of fainter points has to hold
VAGUE = (0.2, 0.3)  # where it lies in that range, faint points come one abreast the more, the nearer to the end
_STEP = 0.02  # what it is rounded to: no answer shall hang on what lies far away
BINS = 1 << 16  # values of a probability that are told apart when the line is drawn
NEAREST = 9  # points among which the likeliest is looked for, and which link to a chain, the point among them


@dataclass(frozen=True, eq=False)
class Strengths:
    """How marked the edges are at some points (M,), ascending; one half is as likely as not.

    Attributes
    ----------
    points : (M,) int64
    crease, outline : (M,) float64
    """

    points: np.ndarray
    crease: np.ndarray
    outline: np.ndarray

    @property
    def strongest(self) -> np.ndarray:
        """Strength (M,) of the more marked of both."""
        return np.maximum(self.crease, self.outline)

    def kinds(self, least: float) -> np.ndarray:
        """Return the kinds (M,) uint8 of at least some strength."""
        kinds = np.where(self.crease >= least, EdgeKind.CREASE, 0) | np.where(
            self.outline >= least, EdgeKind.BOUNDARY, 0
        )
        return kinds.astype(np.uint8)

    def take(self, some: np.ndarray) -> Strengths:
        """Return the strengths at some of these points."""
        return Strengths(self.points[some], self.crease[some], self.outline[some])

    def join(self, other: Strengths) -> Strengths:
        """Put those of other points in between; where both have a point, the larger ones count."""
        points = np.union1d(self.points, other.points)
        both = np.zeros((2, len(points)))
        for part in (self, other):
            rows = np.searchsorted(points, part.points)
            both[:, rows] = np.maximum(both[:, rows], (part.crease, part.outline))
        return Strengths(points, *both)


def strengths(index: NeighborIndex, points: np.ndarray, probability: np.ndarray) -> np.ndarray:
    """Turn the probabilities (M,) of one kind of edge at some points (M,) into strengths (M,).

    Where edges are plain, strength one half lies where the expected F1 is greatest. Where noise or softness leave few
    points sure it lies lower, and what is below `SURE` has to show that it belongs to an edge, as in Canny's second
    half: by a chain that holds a strong point, and by being the likeliest among its nearest. On the vaguest clouds,
    where no one can say which of the points abreast is the edge's, all of them count.
    """
    even = even_probability(histogram(probability))
    if even >= SURE:
        return strength_of(probability, even)
    likely, row = np.flatnonzero(probability >= even), np.full(len(index), -1)
    row[points] = np.arange(len(points))
    nearest = row[knn(index, at_points(index, points[likely]), min(NEAREST, len(index))).points]
    faint = faint_points(probability, even, likely, nearest)
    number, chained = np.full(len(probability), -1), np.empty(len(faint.rows), np.bool_)
    number[faint.rows] = np.arange(len(faint.rows))
    links = np.where(faint.links >= 0, number[faint.links], -1)
    keep_linked(links, probability[faint.rows] >= STRONG, chained)
    return with_faint(probability, even, faint, chained)


def histogram(probability: np.ndarray) -> np.ndarray:
    """Count probabilities (M,) by their value, (BINS,) int64: counts of the parts of a cloud add up to the whole's."""
    return np.bincount((probability * BINS).astype(np.int64).clip(0, BINS - 1), minlength=BINS)


def even_probability(counts: np.ndarray) -> float:
    """Return the probability that is as likely as not an edge's: half of the greatest expected F1, within `EVEN`.

    Lipton et al. 2014, doi:10.1007/978-3-662-44851-9_15: near one half where edges are plain, lower where noise leaves
    none of them sure. Where it would be lower than that there are no edges to speak of, and what is found has to be as
    sure as elsewhere. Takes the `histogram` of all probabilities.
    """
    bins = np.flatnonzero(counts)[::-1]
    hits = np.cumsum(counts[bins] * ((bins + 0.5) / BINS))
    expected = hits / (np.cumsum(counts[bins]) + hits[-1:])
    even = round(float(expected.max(initial=0.0)) / _STEP) * _STEP
    return min(even, EVEN[1]) if even >= EVEN[0] else SURE


def least_probability(min_strength: float) -> float:
    """Return the least probability of a point that may be asked for, wherever the line is drawn.

    Points below it have less strength, belong to no chain, and tell nobody where the surface ends.
    """
    least = EVEN[0] * min_strength / (EVEN[0] * min_strength + (1 - EVEN[0]) * (1 - min_strength))
    return min(EVEN[0], least * (1 - 1e-9))


@dataclass(frozen=True, eq=False)
class Faint:
    """The points that count if they show that they belong to an edge: those as likely as not, and surer ones.

    Attributes
    ----------
    rows : (K,) int64
        Among the points with a probability, ascending.
    links : (K, 9) int64
        The rows of the nearest points of each, itself first; -1 where that is not as likely.
    likeliest : (K,) bool
        Whether none of them is likelier.
    """

    rows: np.ndarray
    links: np.ndarray
    likeliest: np.ndarray


def faint_points(probability: np.ndarray, even: float, on: np.ndarray, nearest: np.ndarray) -> Faint:
    """Look at those of some rows `on` (K,), ascending, whose probability (M,) is at least `even`.

    `nearest` (K, 9) are the rows of the nearest points of each, itself first; -1 where one has no probability.
    """
    likely = probability[on] >= even
    on, nearest = on[likely], nearest[likely]
    beside = np.where(nearest >= 0, probability[nearest], 0.0)
    return Faint(on, np.where(beside >= even, nearest, -1), probability[on] >= beside.max(axis=1, initial=0.0))


def with_faint(probability: np.ndarray, even: float, faint: Faint, chained: np.ndarray) -> np.ndarray:
    """Turn probabilities (M,) into strengths (M,), of the faint points of those that show that they belong to an edge.

    `chained` (K,) bool are the faint points whose chain holds a strong one.
    """
    strength, on = strength_of(probability, SURE), faint.rows
    share = np.clip((even - VAGUE[0]) / (VAGUE[1] - VAGUE[0]), 0.0, 1.0)
    shown = on[chained & (faint.likeliest | (probability[on] >= even + share * (SURE - even)))]
    strength[shown] = strength_of(probability[shown], even)
    return strength


def strength_of(probability: np.ndarray, even: float) -> np.ndarray:
    """Turn probabilities into strengths, `even` into one half; odds keep their ratio."""
    return probability * (1 - even) / (probability * (1 - even) + even * (1 - probability))
