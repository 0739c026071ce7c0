"""Reach: how far from a point what is said of it can depend on other points."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import every_place
from edgel._neighbors.scan_lines import stretch_reach
from edgel._surface.context import NEIGHBORS
from edgel._surface.plane_scales import SCALES
from edgel._surface.two_planes import FITS


def evidence_reach(index: NeighborIndex, stretch: np.ndarray | None = None) -> np.ndarray:
    """Bound how far the evidence of each point and of its context reaches, by place, (N,) float64 in the cloud's unit.

    What lies farther away than this changes no probability of `classify`, given the cloud's statistics and that the
    leaves of the index rule nothing out: a point hears of the probabilities of its nearest, each of which has two
    planes fitted to its own, which start from the planes of theirs. Of the index that is classified, smoothed or not.
    Takes its stretch (3, N) on scan lines, where it has one: each of these hears of others, too.
    """
    counts = np.minimum([SCALES[-1], FITS[-1][0], NEIGHBORS + 1], len(index))
    radii = np.empty((3, len(index)))
    asked = every_place(index, stretch)  # no point lies farther than it does stretched
    visit_neighbors(_radii, asked, index, counts.max(), counts, radii)
    if stretch is not None:
        radii = np.maximum(radii, stretch_reach(index))
    of_planes, of_fits, of_context = radii
    of_evidence, reach = np.empty((2, len(index)))
    for count, own, theirs, result in (
        (counts[1], of_fits, of_planes, of_evidence),
        (counts[2], of_context, of_evidence, reach),
    ):
        visit_neighbors(_add_farthest, asked, index, count, own, theirs, result)
    return reach


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
