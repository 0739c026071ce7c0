"""What the neighbourhood of a point says about an edge there, at several scales, and what trained trees make of it.

The cheap evidence of every point says where to look closer; only there the costly one is gathered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from edgel.evidence import scales, sectors, sheets, through
from edgel.evidence.forest import Forest, evaluate, read_forests
from edgel.evidence.scales import SCALES, fit_scales, spacing_of
from edgel.evidence.sectors import sector_gaps
from edgel.evidence.sheets import fit_sheets
from edgel.evidence.through import planes_through
from edgel.kdtree import NeighborIndex, build_index
from edgel.neighbors import visit_neighbors
from edgel.parallel import kernel

FITS = ((8, 0), (12, 0), (24, 0), (24, 1), (48, 1), (96, 2))
"""Neighbours of each fit of two planes, and the scale of the small planes it starts from."""
NUM_CHEAP = scales.NUM_FEATURES
NUM_COSTLY = (
    NUM_CHEAP + len(FITS) * sheets.NUM_FEATURES + len(through.FITS) * through.NUM_FEATURES + sectors.NUM_FEATURES
)
WEIGHTS = "weights.npz"
_SCREEN = 0.02  # least probability of an edge, from the cheap evidence, for a closer look
_MIN_TURN = math.cos(math.radians(20.0))


@dataclass(frozen=True, eq=False)
class Survey:
    """The cheap evidence of every point, in the order of the index.

    Attributes
    ----------
    normals : (N, S, 4) float32
        Normal and planarity of the plane fitted at each of `SCALES`.
    features : (N, NUM_CHEAP) float32
    """

    normals: np.ndarray
    features: np.ndarray

    def normals_in_order(self, index: NeighborIndex) -> np.ndarray:
        """Return the normals of the middle scale in the order of the input, (N, 3) float64; NaN where there is none."""
        normals = np.empty((len(index), 3))
        middle = self.normals[:, 1]
        normals[index.order] = np.where(middle[:, 3:] > 0, middle[:, :3], np.nan)
        return normals

    @property
    def has_surface(self) -> bool:
        """Whether any neighbourhood spans a plane."""
        return bool((self.features[:, 6 * (len(SCALES) - 1) + 1] > 1e-10).any())


@dataclass(frozen=True, eq=False)
class Evidence:
    """The costly evidence of some points.

    Attributes
    ----------
    features : (M, NUM_COSTLY) float32
    sheets : (M, F, 20) float32
        The two planes found at each of `FITS`, relative to the point: see `edgel.evidence.sheets.fit_sheets`.
    """

    features: np.ndarray
    sheets: np.ndarray

    def take(self, rows: np.ndarray) -> Evidence:
        """Return the evidence of some of the points."""
        return Evidence(self.features[rows], self.sheets[rows])

    @property
    def residuals(self) -> np.ndarray:
        """What each fit of two planes leaves, root mean square in spacings, (M, F)."""
        return np.exp(self._of_fits(2)) - 0.01

    @property
    def away(self) -> np.ndarray:
        """How far the line of each fit passes from the point, in spacings (4 at most), (M, F)."""
        return self._of_fits(5)

    def _of_fits(self, feature: int) -> np.ndarray:
        count = len(FITS) * sheets.NUM_FEATURES
        fits = self.features[:, NUM_CHEAP : NUM_CHEAP + count].reshape(-1, len(FITS), sheets.NUM_FEATURES)
        return fits[:, :, feature].astype(np.float64)


def survey(index: NeighborIndex) -> Survey:
    """Gather the cheap evidence of every point."""
    normals = np.zeros((len(index), len(SCALES), 4), np.float32)
    features = np.zeros((len(index), NUM_CHEAP), np.float32)
    visit_neighbors(_survey, index, index, min(SCALES[-1], len(index)), np.array(SCALES), normals, features)
    return Survey(normals, features)


def screen(index: NeighborIndex, surveyed: Survey) -> np.ndarray:
    """Return the rows of the input that deserve a closer look, ascending."""
    likely = evaluate(forests()["screen"], surveyed.features) > _SCREEN
    return np.sort(index.order[likely])


def examine(index: NeighborIndex, surveyed: Survey, xyz: np.ndarray) -> Evidence:
    """Gather the costly evidence at points (M, 3) of the index."""
    features = np.zeros((len(xyz), NUM_COSTLY), np.float32)
    found = np.zeros((len(xyz), len(FITS), sheets.SHEETS), np.float32)
    if len(xyz):
        visit_neighbors(
            _examine,
            build_index(xyz),
            index,
            min(FITS[-1][0], len(index)),
            surveyed.normals,
            surveyed.features,
            np.array(FITS),
            np.array(through.FITS),
            np.array(sectors.COUNTS),
            features,
            found,
        )
    return Evidence(features, found)


def crease_probability(evidence: Evidence) -> np.ndarray:
    """Return how sure it is that a crease runs through the cell of each point, (M,) from 0 to 1."""
    return evaluate(forests()["crease"], evidence.features)


def outline_probability(evidence: Evidence) -> np.ndarray:
    """Return how sure it is that the surface ends at each point, (M,) from 0 to 1."""
    return evaluate(forests()["outline"], evidence.features)


@cache
def forests() -> dict[str, Forest]:
    """Return the trees of the package, trained by benchmarks/train.py on scenes of `edgel.synth` alone."""
    with (files("edgel.evidence") / WEIGHTS).open("rb") as file:
        return read_forests(file)


@kernel
def _survey(first, places, squared, queries, query_order, xyz, scales, normals, features):
    k = places.shape[1]
    vectors, fitted, found = np.empty((k, 3)), np.zeros((len(scales), 4)), np.zeros(features.shape[1])
    for q in range(places.shape[0]):
        _relative(places[q], queries, first + q, xyz, vectors)
        fit_scales(vectors, squared[q], scales, fitted, found)
        normals[first + q] = fitted
        features[first + q] = found


@kernel
def _relative(places, queries, query, xyz, vectors):
    for i in range(len(places)):
        for axis in range(3):
            vectors[i, axis] = xyz[axis, places[i]] - queries[axis, query]


@kernel
def _examine(
    first, places, squared, queries, query_order, xyz, normals, cheap, fits, votes, counts, features, two_planes
):
    k = places.shape[1]
    vectors = np.empty((k, 3))
    side, best_side, angles = np.empty(k, np.int64), np.empty(k, np.int64), np.empty(k)
    room, solve = np.empty((7, sheets.SHEETS)), np.empty((6, 7))
    found, two, out = np.empty(sheets.NUM_FEATURES), np.empty(sheets.SHEETS), np.empty(through.NUM_FEATURES)
    gaps = np.zeros(2 * len(counts))
    for q in range(places.shape[0]):
        row, own = query_order[first + q], places[q, 0]
        _relative(places[q], queries, first + q, xyz, vectors)
        spacing = spacing_of(squared[q])
        at = cheap.shape[1]
        features[row, :at] = cheap[own]
        for f in range(len(fits)):
            count, scale = min(fits[f, 0], k), fits[f, 1]
            fit_sheets(
                vectors,
                places[q],
                squared[q],
                count,
                spacing,
                normals[:, scale],
                side,
                best_side,
                room,
                solve,
                found,
                two,
            )
            features[row, at : at + len(found)] = found
            two_planes[row, f] = two
            at += len(found)
        for j in range(len(votes)):
            planes_through(vectors, min(int(votes[j, 0]), k), spacing, votes[j, 1], _MIN_TURN, out)
            features[row, at : at + len(out)] = out
            at += len(out)
        sector_gaps(vectors, squared[q], normals[own], counts, angles, gaps)
        features[row, at : at + len(gaps)] = gaps
