"""Pieces of a surface whose normals agree: joined in cells of a grid first, then with each other, and turned outwards.

All that is added up is whole numbers, and what ties is told by coordinates: parts of a cloud that hold whole cells
between them merge into the answer of the whole.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

UNIT = 1 << 20  # of agreement: 1 in whole numbers
SURELY = 0.7  # share of agreement over all pairs between two pieces, for joining in a cell, where others are not known
CELL = 32.0  # spacings of the cloud: side of a cell, about
BINS = 64  # in which points are sorted by how sure they are
_DIRECTIONS = np.array(
    [np.array(d) / np.linalg.norm(d) for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)]
)


@dataclass(frozen=True, eq=False)
class Pairs:
    """What neighbours say of each other, added up over all between the same two.

    Attributes
    ----------
    a, b : (K,) int64
        Numbers of points or pieces.
    weight : (K,) int64
        How far they agree, in `UNIT`; negative where one is upside down.
    count : (K,) int64
        Of how many pairs of points.
    """

    a: np.ndarray
    b: np.ndarray
    weight: np.ndarray
    count: np.ndarray

    def merged(self, number: int) -> Pairs:
        """Add up those between the same two of `number` pieces; those of one with itself are left out."""
        apart = self.a != self.b
        a, b = np.minimum(self.a, self.b)[apart], np.maximum(self.a, self.b)[apart]
        keys, which = np.unique(a * number + b, return_inverse=True)
        # Whole numbers below 2**53 are added up without rounding.
        sums = (np.bincount(which, each[apart], len(keys)).astype(np.int64) for each in (self.weight, self.count))
        return Pairs(keys // number, keys % number, *sums)

    def take(self, some: np.ndarray) -> Pairs:
        """Return some of the pairs."""
        return Pairs(self.a[some], self.b[some], self.weight[some], self.count[some])

    def renamed(self, piece: np.ndarray, sign: np.ndarray) -> Pairs:
        """Return the pairs of the pieces that points are in, with signs (N,) as they are there."""
        turned = self.weight * (sign[self.a] * sign[self.b]).astype(np.int64)
        return Pairs(piece[self.a], piece[self.b], turned, self.count)


def join(pairs: Pairs, number: int, least: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Give `number` points a sign each, so that those that agree get equal ones; Boruvka's rounds.

    Each piece joins the one that it shares most with, of those where the mean over all pairs is above `least`. Returns
    the signs (N,), and the point (N,) that each piece begins with: what pairs connect.
    """
    root, sign = np.arange(number), np.ones(number)
    while True:
        pairs = pairs.merged(number)
        likely = pairs.take(np.abs(pairs.weight) > least * UNIT * pairs.count)
        if not len(likely.a):
            return sign, root
        parent, turn = _strongest(likely, number)
        while (parent != parent[parent]).any():
            turn, parent = turn * turn[parent], parent[parent]
        pairs, sign, root = pairs.renamed(parent, turn), sign * turn[root], parent[root]


def _strongest(pairs: Pairs, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the piece that each joins, itself where it is the first of two that choose each other, and the sign."""
    a, b, weight = pairs.a, pairs.b, pairs.weight
    order = np.lexsort((b, a, -np.abs(weight)))
    ends, others = np.stack([a, b], axis=1)[order].ravel(), np.stack([b, a], axis=1)[order].ravel()
    pieces, at = np.unique(ends, return_index=True)
    parent, turn = np.arange(number), np.ones(number)
    parent[pieces], turn[pieces] = others[at], np.where(weight[order[at // 2]] < 0, -1.0, 1.0)
    first = (parent[parent] == np.arange(number)) & (np.arange(number) < parent)
    parent[first], turn[first] = np.flatnonzero(first), 1.0
    return parent, turn


def cell_size(spacing: float) -> float:
    """Return the side of the cells that points are joined in at first, a power of two."""
    return float(2.0 ** np.round(np.log2(CELL * spacing)))


def within_cells(pairs: Pairs, xyz: np.ndarray, size: float) -> Pairs:
    """Return those pairs of points (N, 3) that lie in one cell."""
    cell = np.floor(xyz / size)
    return pairs.take((cell[pairs.a] == cell[pairs.b]).all(axis=1))


def bins_of(sure: np.ndarray) -> np.ndarray:
    """Sort points by how sure they are, -1 to 1, into bins (N,) int64."""
    return np.floor((np.nan_to_num(sure, nan=-1.0) + 1) / 2 * BINS).astype(np.int64).clip(0, BINS - 1)


def least_bin(counts: np.ndarray) -> np.ndarray:
    """Return the highest bin (B,) from which on lie at least half of the points of each of some counts (B, BINS)."""
    above = counts[:, ::-1].cumsum(axis=1)[:, ::-1]
    return (above * 2 >= counts.sum(axis=1, keepdims=True)).sum(axis=1) - 1


@dataclass(frozen=True, eq=False)
class Outermost:
    """The outermost points of some pieces in 26 directions.

    Attributes
    ----------
    far : (B, 26) float64
        How far out each lies, along its direction.
    xyz : (B, 26, 3) float64
    says : (B, 26) float64
        How far its normal looks the same way.
    """

    far: np.ndarray
    xyz: np.ndarray
    says: np.ndarray

    @classmethod
    def of(cls, xyz: np.ndarray, normals: np.ndarray, piece: np.ndarray, number: int) -> Outermost:
        """Find them among points (N, 3) with their normals (N, 3), of pieces (N,) numbered from 0 on."""
        far = np.full((number, len(_DIRECTIONS)), -np.inf)
        places, says = np.zeros((*far.shape, 3)), np.zeros_like(far)
        for column, (x, y, z) in enumerate(_DIRECTIONS):
            along = xyz[:, 0] * x + xyz[:, 1] * y + xyz[:, 2] * z
            order = np.lexsort((*xyz.T[::-1], -along, piece))
            best = order[np.flatnonzero(np.diff(piece[order], prepend=-1))]
            rows = piece[best]
            far[rows, column], places[rows, column] = along[best], xyz[best]
            says[rows, column] = normals[best, 0] * x + normals[best, 1] * y + normals[best, 2] * z
        return cls(far, places, says)

    def merge(self, other: Outermost, rows: np.ndarray) -> None:
        """Put in those of another part, whose pieces are some `rows` of these."""
        far, xyz = self.far[rows], self.xyz[rows]
        first = np.zeros(far.shape, bool)
        undecided = other.far == far
        for axis in range(3):  # of those equally far out the first by coordinates
            first |= undecided & (other.xyz[..., axis] < xyz[..., axis])
            undecided &= other.xyz[..., axis] == xyz[..., axis]
        better = (other.far > far) | first
        self.far[rows] = np.where(better, other.far, far)
        self.xyz[rows] = np.where(better[..., None], other.xyz, xyz)
        self.says[rows] = np.where(better, other.says, self.says[rows])

    @property
    def signs(self) -> np.ndarray:
        """1 for each piece (B,) whose outermost points look outwards, else -1."""
        return np.where(self.says.sum(axis=1) < 0, -1.0, 1.0)
