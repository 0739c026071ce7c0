"""Screening: where could an edge be? By the leaves of an octree first, then by plane fits at three scales."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import at_places
from edgel._surface import gather
from edgel._surface.forest import Forest, evaluate, load_forests
from edgel._surface.leaves import Leaves, describe_leaves
from edgel._surface.plane_scales import SCALES
from edgel._surface.statistics import Statistics

LEAF = 0.05  # leaves with an edge that are expected among those nearest to a leaf: least for screening its points
POINT = 0.04  # least probability of an edge at a point, by the cheap evidence, for gathering the costly one


@dataclass(frozen=True, eq=False)
class Screening:
    """The cheap evidence of the points, by their places in the index.

    Attributes
    ----------
    normals : (N, S, 4) float32
        Normal and planarity of the plane fitted at each of `SCALES`; where a leaf of the octree was found smooth,
        that of the leaf.
    probability : (N,) float32
        Of an edge, by the cheap evidence.
    statistics : Statistics
        Of the cloud.
    leaves : Leaves
        Of the octree that was looked at first.
    stretch : (3, N) float64 or None
        Of each place on scan lines: see `edgel._neighbors.scan_lines`.
    """

    normals: np.ndarray
    probability: np.ndarray
    statistics: Statistics
    leaves: Leaves
    stretch: np.ndarray | None = None

    @property
    def candidates(self) -> np.ndarray:
        """Places (M,), ascending, where an edge could be."""
        return np.flatnonzero(self.probability > POINT)

    def normals_of_points(self, index: NeighborIndex) -> np.ndarray:
        """Return the normals of the middle scale by point, (N, 3) float64; NaN where there is none."""
        normals = np.empty((len(index), 3))
        middle = self.normals[:, 1]
        normals[index.order] = np.where(middle[:, 3:] > 0, middle[:, :3], np.nan)
        return normals


def screen(
    index: NeighborIndex,
    statistics: Statistics,
    forests: Mapping[str, Forest] | None = None,
    stretch: np.ndarray | None = None,
) -> Screening:
    """Gather the cheap evidence of every point that the leaves of an octree do not rule out.

    Takes the forests "leaf" and "screen", by default those of the package, and the stretch (3, N) on scan lines.
    """
    trees = load_forests() if forests is None else forests
    leaves, of_cloud = describe_leaves(index, statistics.cell), statistics.features
    repeated = np.broadcast_to(of_cloud, (len(leaves.features), len(of_cloud)))
    probable = evaluate(trees["leaf"], np.concatenate([leaves.features, repeated], axis=1))
    # Those around a likely one are kept too: where cells begin must not matter.
    kept = probable[leaves.nearest].sum(axis=1) >= LEAF
    leaf = leaves.octree.leaf_of_places()
    normals = np.repeat(leaves.planes[:, None].astype(np.float32), len(SCALES), axis=1)[leaf]
    probability = np.zeros(len(index), np.float32)
    asked = kept[leaf]
    if stretch is not None:  # leaves hold points of one line, which say nothing of the surface
        asked |= stretch.any(axis=0)
    places = np.flatnonzero(asked)
    if len(places):
        k = min(SCALES[-1], len(index))
        arguments = (np.array(SCALES), of_cloud, trees["screen"].in_step, normals, probability)
        visit_neighbors(gather.screen, at_places(index, places, places, stretch), index, k, *arguments)
    return Screening(normals, probability, statistics, leaves, stretch)
