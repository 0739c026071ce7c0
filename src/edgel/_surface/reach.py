"""Reach: how far from a point what is said of it can depend on other points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import anywhere, at_places
from edgel._neighbors.scan_lines import stretch_reach
from edgel._surface.context import NEIGHBORS
from edgel._surface.leaves import Leaves
from edgel._surface.plane_scales import SCALES
from edgel._surface.two_planes import FITS

_CHAIN = (NEIGHBORS + 1, FITS[-1][0], SCALES[-1])  # neighbours of a point, of each of these, and of each of theirs
_USUAL = 2.0  # times the median of leaves, within which nearly all reach
_BLOCK = 65_536  # places whose leaves' centroids exist at a time


def evidence_reach(
    index: NeighborIndex, leaves: Leaves, places: np.ndarray, stretch: np.ndarray | None = None
) -> np.ndarray:
    """Bound how far the evidence at some places (M,), ascending, and of their context reaches, (M,) float64.

    What lies in no top cell of the leaves' octree that a ball of this radius touches changes no probability of
    `classify`, given the cloud's statistics: a point hears of the probabilities of its nearest, each of which has two
    planes fitted to its own, which start from the planes of theirs or of the leaves they lie in (`screening_reach`). Of
    the index that is classified, smoothed or not. Takes its stretch (3, N) on scan lines, where it has one: each of
    these hears of others, too.
    """
    farthest = screening_reach(index, leaves)
    of_stretch = np.zeros(len(index)) if stretch is None else stretch_reach(index)
    asked = [places]
    for count in _CHAIN[:-1]:
        near = np.zeros(len(index), np.bool_)
        k = min(count, len(index))
        visit_neighbors(_mark, at_places(index, asked[-1], stretch=stretch), index, k, near)
        asked.append(np.flatnonzero(near))
    for count, some in zip(reversed(_CHAIN), reversed(asked), strict=True):
        visit = _or_radius if count == SCALES[-1] else and_farthest
        result = np.zeros(len(index))
        queries = at_places(index, some, some, stretch)  # no point lies farther than it does stretched
        visit_neighbors(visit, queries, index, min(count, len(index)), farthest, of_stretch, result)
        farthest = result if count <= len(index) else np.full(len(index), np.inf)
    return farthest[places]


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds on how far the points of each leaf reach, by the centroids of the leaves alone.

    Attributes
    ----------
    leaf : (N,) int32
        Of each place.
    radii : (4, L) float64
        Around any point of a leaf, within which its nearest of each number in `_CHAIN` lie; last, the radius within
        which the first look at it depends on others.
    """

    leaf: np.ndarray
    radii: np.ndarray

    @staticmethod
    def of(index: NeighborIndex, leaves: Leaves) -> Bounds:
        """Measure at the centroids; infinite where there are fewer points than are asked for."""
        leaf, begins = leaves.octree.leaf_of_places(), leaves.octree.starts[:-1]
        radii = np.full((len(_CHAIN) + 1, len(begins)), np.inf)
        if len(index) >= max(_CHAIN):
            visit_neighbors(_at_centres, anywhere(leaves.centroids), index, max(_CHAIN), np.array(_CHAIN), radii)
        radii[-1] = leaves.radii + leaves.radii[leaves.nearest].max(axis=1)
        # No point of a leaf reaches farther than its centroid does, and it lies from that.
        radii += np.maximum.reduceat(_off_centre(index, leaves, leaf)[leaves.octree.places], begins)
        return Bounds(leaf, radii)


def with_context_of(
    index: NeighborIndex, bounds: Bounds, asked: np.ndarray, depth: np.ndarray, stretch: np.ndarray | None = None
) -> np.ndarray:
    """Return some places, `asked` (N,) bool, and those whose evidence is among the context of one of them, (N,) bool.

    `depth` (N,) is how deep each lies in a region of which all places are asked for: most need not be looked at. Takes
    the stretch (3, N) on scan lines, where there is one: then all are.
    """
    near = asked.copy()
    outer = asked if stretch is not None else asked & (bounds.radii[0][bounds.leaf] >= depth)
    places = np.flatnonzero(outer)
    if len(places):
        queries = at_places(index, places, stretch=stretch)
        visit_neighbors(_mark, queries, index, min(_CHAIN[0], len(index)), near)
    return near


def settled(
    index: NeighborIndex,
    leaves: Leaves,
    bounds: Bounds,
    depth: np.ndarray,
    asked: np.ndarray,
    stretch: np.ndarray | None = None,
) -> np.ndarray:
    """Say at which of some places, `asked` (N,) bool, nothing can change that lies farther away than a depth (N,).

    Most are told by a bound on how far all around reach; the others, and all on scan lines, are looked at one by one
    (`evidence_reach`).
    """
    sure = asked & (_farthest(index, bounds) < depth if stretch is None else False)
    places = np.flatnonzero(asked & ~sure)
    if len(places):
        sure[places] = evidence_reach(index, leaves, places, stretch) < depth[places]
    return sure


def _farthest(index: NeighborIndex, bounds: Bounds) -> np.ndarray:
    """Bound `evidence_reach` at all places, (N,) float64, by the farthest that leaves around reach, seen from above."""
    leaf, radii = bounds.leaf, bounds.radii[:-1].copy()
    radii[-1] = np.maximum(radii[-1], bounds.radii[-1])
    if not np.isfinite(radii).all():
        return np.full(len(index), np.inf)
    usual = _USUAL * np.median(radii[:-1], axis=1)
    plan = index.xyz[:2] - index.xyz[:2].min(axis=1, keepdims=True)
    size = max(float(usual[0]) / 2, float(np.sqrt(np.prod(np.ptp(plan, axis=1)) / len(index))))
    column, row = (plan // size).astype(np.int64)
    farthest, beyond = radii[-1][leaf], float(radii[-1].max())
    for own, most in zip(radii[-2::-1], usual[::-1], strict=True):
        around = np.zeros((column.max() + 1, row.max() + 1))
        np.maximum.at(around, (column, row), farthest)
        around = _largest_around(around, int(np.ceil(most / size)))
        farthest = own[leaf] + np.where(own[leaf] <= most, around[column, row], beyond)
        beyond = float(farthest.max())
    return farthest


def _largest_around(values: np.ndarray, cells: int) -> np.ndarray:
    """Return the largest of the values (R, C), not negative, within so many cells of each."""
    for axis in (0, 1):
        padded = np.moveaxis(values, axis, 0)
        padded = np.pad(padded, ((cells, cells), (0, 0)))
        rows = len(padded) - 2 * cells
        values = np.moveaxis(np.max([padded[i : i + rows] for i in range(2 * cells + 1)], axis=0), 0, axis)
    return values


@kernel
def _at_centres(first, places, squared, queries, targets, xyz, counts, radii):
    for q in range(places.shape[0]):
        for i in range(len(counts)):
            radii[i, targets[first + q]] = np.sqrt(squared[q, counts[i] - 1])


def screening_reach(index: NeighborIndex, leaves: Leaves) -> np.ndarray:
    """Bound how far the first look at each point reaches, by place, (N,) float64, as `evidence_reach` does.

    Whether it is screened hangs on the leaves nearest to its own, and what is said of these on those nearest to them.
    """
    beyond = leaves.radii + leaves.radii[leaves.nearest].max(axis=1)
    leaf = leaves.octree.leaf_of_places()
    return _off_centre(index, leaves, leaf) + beyond[leaf]


def _off_centre(index: NeighborIndex, leaves: Leaves, leaf: np.ndarray) -> np.ndarray:
    """Return how far each place (N,) lies from the centroid of its leaf, (N,) float64."""
    off = np.empty(len(index))
    for start in range(0, len(index), _BLOCK):
        rows = slice(start, start + _BLOCK)
        off[rows] = np.linalg.norm(index.xyz[:, rows].T - leaves.centroids[leaf[rows]], axis=1)
    return off


@kernel
def _mark(first, places, squared, queries, targets, xyz, near):
    for q in range(places.shape[0]):
        for i in range(places.shape[1]):
            near[places[q, i]] = True  # whoever comes first: the same is written


@kernel
def _or_radius(first, places, squared, queries, targets, xyz, own, least, result):
    for q in range(places.shape[0]):
        row, radius = targets[first + q], np.sqrt(squared[q, places.shape[1] - 1])
        result[row] = max(own[row], least[row], radius)


@kernel
def and_farthest(first, places, squared, queries, targets, xyz, theirs, least, result):
    """Write how far away the farthest neighbour lies, or what is the least, and what is the most of `theirs` (N,)."""
    for q in range(places.shape[0]):
        row, farthest = targets[first + q], 0.0
        for i in range(places.shape[1]):
            farthest = max(farthest, theirs[places[q, i]])
        result[row] = max(least[row], np.sqrt(squared[q, places.shape[1] - 1])) + farthest
