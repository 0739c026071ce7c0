"""Reach: how far from a point what is said of it can depend on other points."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import knn, visit_neighbors
from edgel._neighbors.queries import at_places
from edgel._neighbors.scan_lines import stretch_reach
from edgel._surface.context import NEIGHBORS
from edgel._surface.leaves import Leaves
from edgel._surface.plane_scales import SCALES
from edgel._surface.two_planes import FITS

_USUAL = 1.5  # times the median reach of leaves, within which most lie
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
    chain = (NEIGHBORS + 1, FITS[-1][0], SCALES[-1])
    asked = [places]
    for count in chain[:-1]:
        near = np.zeros(len(index), np.bool_)
        k = min(count, len(index))
        visit_neighbors(_mark, at_places(index, asked[-1], stretch=stretch), index, k, near)
        asked.append(np.flatnonzero(near))
    for count, some in zip(reversed(chain), reversed(asked), strict=True):
        visit = _or_radius if count == SCALES[-1] else _and_farthest
        result = np.zeros(len(index))
        queries = at_places(index, some, some, stretch)  # no point lies farther than it does stretched
        visit_neighbors(visit, queries, index, min(count, len(index)), farthest, of_stretch, result)
        farthest = result if count <= len(index) else np.full(len(index), np.inf)
    return farthest[places]


def settled(index: NeighborIndex, leaves: Leaves, depth: np.ndarray) -> np.ndarray:
    """Say at which places (N,) bool nothing can change that lies farther away than some depth (N,).

    Most are told by their leaves: where all leaves around reach no farther than usual, no chain of three does. The
    others are looked at one by one (`evidence_reach`).
    """
    octree = leaves.octree
    begins, number = octree.starts[:-1], np.diff(octree.starts)
    leaf = octree.leaf_of_places()
    off = _off_centre(index, leaves, leaf)
    extent = np.maximum.reduceat(off[octree.places], begins)
    shallow = np.minimum.reduceat(depth[octree.places], begins)
    nearest = leaves.nearest
    enough = number[nearest].sum(axis=1) >= FITS[-1][0]
    beyond = np.maximum(extent[nearest].max(axis=1), leaves.radii[nearest].max(axis=1))
    reach = np.where(enough, extent + leaves.radii + beyond, np.inf)
    usual = _USUAL * np.median(reach)
    far = reach > usual
    clear = ~far & (shallow > 3 * usual)
    if far.any() and clear.any():
        others = build_index(np.ascontiguousarray(leaves.centroids[far]))
        away = knn(others, leaves.centroids[clear], 1).distances[:, 0]
        clear[clear] = away > 2 * usual + extent[clear] + extent[far].max()
    sure = clear[leaf]
    places = np.flatnonzero(~sure)
    if len(places):
        sure[places] = evidence_reach(index, leaves, places) < depth[places]
    return sure


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
def _and_farthest(first, places, squared, queries, targets, xyz, theirs, least, result):
    for q in range(places.shape[0]):
        row, farthest = targets[first + q], 0.0
        for i in range(places.shape[1]):
            farthest = max(farthest, theirs[places[q, i]])
        result[row] = max(least[row], np.sqrt(squared[q, places.shape[1] - 1])) + farthest
