"""Reach: how far from a point what is said of it can depend on other points."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import every_place
from edgel._surface.context import NEIGHBORS
from edgel._surface.leaves import Leaves
from edgel._surface.plane_scales import SCALES
from edgel._surface.two_planes import FITS

_BLOCK = 65_536  # places whose leaves' centroids exist at a time


def evidence_reach(index: NeighborIndex, leaves: Leaves) -> np.ndarray:
    """Bound how far the evidence of each point and of its context reaches, by place, (N,) float64 in the cloud's unit.

    What lies in no top cell of the leaves' octree that a ball of this radius touches changes no probability of
    `classify`, given the cloud's statistics: a point hears of the probabilities of its nearest, each of which has two
    planes fitted to its own, which start from the planes of theirs or of the leaves they lie in (`screening_reach`). Of
    the index that is classified, smoothed or not.
    """
    wanted = np.array([SCALES[-1], FITS[-1][0], NEIGHBORS + 1])
    counts = np.minimum(wanted, len(index))
    radii = np.empty((3, len(index)))
    visit_neighbors(_radii, every_place(index), index, counts.max(), counts, radii)
    radii[wanted > len(index)] = np.inf
    of_planes, of_fits, of_context = radii
    np.maximum(of_planes, screening_reach(index, leaves), out=of_planes)
    of_evidence, reach = np.empty((2, len(index)))
    for count, own, theirs, result in (
        (counts[1], of_fits, of_planes, of_evidence),
        (counts[2], of_context, of_evidence, reach),
    ):
        visit_neighbors(_add_farthest, every_place(index), index, count, own, theirs, result)
    return reach


def screening_reach(index: NeighborIndex, leaves: Leaves) -> np.ndarray:
    """Bound how far the first look at each point reaches, by place, (N,) float64, as `evidence_reach` does.

    Whether it is screened hangs on the leaves nearest to its own, and what is said of these on those nearest to them.
    """
    beyond = leaves.radii + leaves.radii[leaves.nearest].max(axis=1)
    leaf = leaves.octree.leaf_of_places()
    off = np.empty(len(index))
    for start in range(0, len(index), _BLOCK):
        rows = slice(start, start + _BLOCK)
        off[rows] = np.linalg.norm(index.xyz[:, rows].T - leaves.centroids[leaf[rows]], axis=1)
    return off + beyond[leaf]


@kernel
def _radii(first, places, squared, queries, targets, xyz, counts, radii):
    for q in range(places.shape[0]):
        for i in range(len(counts)):
            radii[i, targets[first + q]] = np.sqrt(squared[q, counts[i] - 1])


@kernel
def _add_farthest(first, places, squared, queries, targets, xyz, own, theirs, result):
    for q in range(places.shape[0]):
        farthest = 0.0
        for i in range(places.shape[1]):
            farthest = max(farthest, theirs[places[q, i]])
        result[targets[first + q]] = own[targets[first + q]] + farthest
