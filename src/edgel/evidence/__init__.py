"""What the neighbourhood of a point says about an edge there, at several scales, and what trained trees make of it.

The cheap evidence of every point says where to look closer; only there the costly one is gathered, and only where that
makes an edge likely, the neighbours' chances are heard too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from edgel.evidence import coarse, context, gather, scales, sectors, sheets, through
from edgel.evidence.forest import Forest, evaluate, read_forests
from edgel.evidence.scales import SCALES
from edgel.kdtree import NeighborIndex, build_index, leaf_starts
from edgel.neighbors import visit_neighbors

FITS = ((8, 0), (12, 0), (24, 0), (48, 1), (96, 2))
"""Neighbours of each fit of two planes, and the scale of the small planes it starts from."""
NUM_CLOUD = 8
NUM_CHEAP = scales.NUM_FEATURES + NUM_CLOUD
NUM_COSTLY = (
    NUM_CHEAP + len(FITS) * sheets.NUM_FEATURES + len(through.FITS) * through.NUM_FEATURES + sectors.NUM_FEATURES
)
NUM_ALL = NUM_COSTLY + 2 * context.NUM_FEATURES
WEIGHTS = "weights.npz"
COARSE = 0.05  # least probability of an edge in a leaf, by a glance at it, for looking at its points at all
SCREEN = 0.04  # least probability of an edge, from the cheap evidence, for a closer look
SECOND = 0.02  # and from the costly evidence, for a second one
MAX_AWAY = 1.5  # spacings: a line farther from the point is not its edge
MIN_TURN = math.radians(12.0)  # of two planes that make an edge
_CENSUS = 8_000  # points that say what is typical of the cloud
_BLOCK = 65_536  # points whose evidence is held at a time
_FLOOR = 0.02  # spacings: residuals below it do not make one fit better than another
_COS_MIN = math.cos(math.radians(20.0))  # of two planes through a point, whose angle is at least this


@dataclass(frozen=True, eq=False)
class Survey:
    """The cheap evidence of the points, in the order of the index.

    Attributes
    ----------
    normals : (N, S, 4) float32
        Normal and planarity of the plane fitted at each of `SCALES`; where a leaf of the index was found smooth, that
        of the leaf.
    likely : (N,) float32
        Chance of an edge, by the cheap evidence.
    cloud : (NUM_CLOUD,) float32
        What is typical of the cloud: see `census`.
    has_surface : bool
        Whether any neighbourhood spans a plane.
    """

    normals: np.ndarray
    likely: np.ndarray
    cloud: np.ndarray
    has_surface: bool

    def normals_in_order(self, index: NeighborIndex) -> np.ndarray:
        """Return the normals of the middle scale in the order of the input, (N, 3) float64; NaN where there is none."""
        normals = np.empty((len(index), 3))
        middle = self.normals[:, 1]
        normals[index.order] = np.where(middle[:, 3:] > 0, middle[:, :3], np.nan)
        return normals


@dataclass(frozen=True, eq=False)
class Evidence:
    """The costly evidence of some points.

    Attributes
    ----------
    features : (M, NUM_COSTLY) float32
    fit : (M, 24) float32
        The two planes, relative to the point, of the fit that places its edge best: see
        `edgel.evidence.sheets.fit_sheets`.
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
            np.zeros((0, NUM_COSTLY), np.float32), np.zeros((0, sheets.SHEETS), np.float32), np.zeros(0, bool)
        )
        names = Evidence.__dataclass_fields__
        return Evidence(*(np.concatenate([getattr(part, name) for part in (nothing, *parts)]) for name in names))


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the evidence says of the points where an edge is likely at all.

    Attributes
    ----------
    rows : (M,) int64
        Their rows in the input, ascending.
    crease, outline : (M,) float64
        How sure it is, 0 to 1, that a crease runs through the cell of each point, and that the surface ends there.
    evidence : Evidence
    """

    rows: np.ndarray
    crease: np.ndarray
    outline: np.ndarray
    evidence: Evidence


def survey(index: NeighborIndex, trees: Mapping[str, Forest] | None = None) -> Survey:
    """Gather the cheap evidence of every point that a glance at the leaves of the index does not rule out.

    Takes the forests "coarse" and "screen", by default those of the package.
    """
    trees = forests() if trees is None else trees
    cloud, has_surface = census(index)
    leaves, planes, nearest = coarse.look(index)
    known = np.concatenate([leaves, np.broadcast_to(cloud, (len(leaves), NUM_CLOUD))], axis=1)
    size = np.diff(leaf_starts(index))
    # Those around a rough leaf are looked at too: how the tree cuts the cloud, which turns with it, must not matter.
    rough = np.repeat((evaluate(trees["coarse"], known) >= COARSE)[nearest].any(axis=1), size)
    normals = np.repeat(planes[:, None].astype(np.float32), len(SCALES), axis=1).repeat(size, axis=0)
    likely = np.zeros(len(index), np.float32)
    places = np.flatnonzero(rough)
    if len(places):
        visit_neighbors(
            gather.survey,
            build_index(index.at(places)),
            index,
            min(SCALES[-1], len(index)),
            places,
            np.array(SCALES),
            cloud,
            trees["screen"].in_step,
            normals,
            likely,
        )
    return Survey(normals, likely, cloud, has_surface)


def describe(index: NeighborIndex, places: np.ndarray) -> np.ndarray:
    """Return the cheap evidence (M, NUM_CHEAP - NUM_CLOUD) float32 of the points at some places (M,) of the index."""
    features = np.zeros((len(places), scales.NUM_FEATURES), np.float32)
    queries = build_index(index.at(places))
    visit_neighbors(gather.describe, queries, index, min(SCALES[-1], len(index)), np.array(SCALES), features)
    return features


def census(index: NeighborIndex) -> tuple[np.ndarray, bool]:
    """Say how bent, how noisy and how evenly sampled a cloud is, (NUM_CLOUD,) float32; and whether it has a surface.

    From quantiles of the cheap evidence of points strewn over it; it has a surface if any neighbourhood spans a plane.
    """
    features = describe(index, index.strewn(_CENSUS))
    bent, small, nearest, row_like = (features[:, i] for i in (12, 0, scales.NUM_FEATURES - 2, 1))
    cloud = np.concatenate(
        [np.quantile(bent, [0.1, 0.5, 0.9]), np.quantile(small, [0.1, 0.5]), np.quantile(nearest, [0.1, 0.5])]
        + [np.quantile(row_like, [0.5])]
    )
    return cloud.astype(np.float32), bool((features[:, 6 * (len(SCALES) - 1) + 1] > 1e-10).any())


def examine(index: NeighborIndex, surveyed: Survey, xyz: np.ndarray) -> Evidence:
    """Gather the costly evidence at points (M, 3) of the index."""
    features = np.zeros((len(xyz), NUM_COSTLY), np.float32)
    found = np.zeros((len(xyz), len(FITS), sheets.SHEETS), np.float32)
    if len(xyz):
        visit_neighbors(
            gather.examine,
            build_index(xyz),
            index,
            min(FITS[-1][0], len(index)),
            surveyed.normals,
            surveyed.cloud,
            np.array(SCALES),
            np.array(FITS),
            np.array(through.FITS),
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
    count = len(FITS) * sheets.NUM_FEATURES
    fits = features[:, NUM_CHEAP : NUM_CHEAP + count].reshape(-1, len(FITS), sheets.NUM_FEATURES)
    residual, turn, away = (fits[:, :, i].astype(np.float64) for i in (2, 3, 5))
    error = (np.exp(residual) - 0.01 + _FLOOR) / np.sqrt([count for count, _ in FITS])
    error[(away > MAX_AWAY) | ~(turn > MIN_TURN)] = np.inf
    best = error.argmin(axis=1)
    return best, np.isfinite(error[np.arange(len(error)), best])


def look_around(
    index: NeighborIndex, places: np.ndarray, evidence: Evidence, crease: np.ndarray, outline: np.ndarray
) -> np.ndarray:
    """Add to the evidence of some points what their neighbours make of themselves.

    Parameters
    ----------
    index : NeighborIndex
    places : (M,) int64
        Of these points in the order of the index.
    evidence : Evidence
    crease, outline : (M,) float64
        Chances by the evidence alone; at all other points they are 0.

    Returns
    -------
    (M, NUM_ALL) float32
    """
    chances = np.zeros((2, len(index)), np.float32)
    chances[:, places] = crease, outline
    slot = np.full(len(index), -1, np.int32)
    slot[places[evidence.placed]] = np.flatnonzero(evidence.placed)
    lines, feet = np.ascontiguousarray(evidence.fit[:, 6:9]), np.ascontiguousarray(evidence.fit[:, 9:12])
    around = np.zeros((2, len(places), context.NUM_FEATURES), np.float32)
    if len(places):
        k = min(context.NEIGHBORS + 1, len(index))
        visit_neighbors(
            context.look_around, build_index(index.at(places)), index, k, chances, slot, lines, feet, around
        )
    return np.concatenate([evidence.features, *around], axis=1)


def judge(index: NeighborIndex, surveyed: Survey) -> Verdict:
    """Look closer where the survey makes an edge likely, and once more where the evidence does."""
    likely = np.flatnonzero(surveyed.likely > SCREEN)
    trees = forests()
    kept, parts, chances = [], [], []
    for start in range(0, len(likely), _BLOCK):
        places = likely[start : start + _BLOCK]
        evidence = examine(index, surveyed, index.at(places))
        first = np.stack([evaluate(trees[f"first {kind}"], evidence.features) for kind in ("crease", "outline")])
        good = np.flatnonzero((first > SECOND).any(axis=0))
        kept.append(places[good])
        chances.append(first[:, good])
        parts.append(evidence.take(good))
    places = np.concatenate([np.zeros(0, np.int64), *kept])
    first, evidence = np.concatenate([np.zeros((2, 0)), *chances], axis=1), Evidence.join(parts)
    features = look_around(index, places, evidence, first[0], first[1])
    rows = index.order[places]
    order = np.argsort(rows)
    return Verdict(
        rows[order],
        evaluate(trees["crease"], features)[order],
        evaluate(trees["outline"], features)[order],
        evidence.take(order),
    )


@cache
def forests() -> dict[str, Forest]:
    """Return the trees of the package, trained by benchmarks/train.py on scenes of `edgel.synth` alone."""
    with (files("edgel.evidence") / WEIGHTS).open("rb") as file:
        return read_forests(file)
