"""Screening: where could an edge be? By the leaves of the k-d tree first, then by plane fits at three scales."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, leaf_starts
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import at_places
from edgel._surface import gather
from edgel._surface.forest import Forest, evaluate, load_forests
from edgel._surface.leaves import describe_leaves
from edgel._surface.plane_scales import SCALES

LEAF = 0.05  # least probability of an edge in a leaf, or in one around it, for screening its points
POINT = 0.04  # least probability of an edge at a point, by the cheap evidence, for gathering the costly one


@dataclass(frozen=True, eq=False)
class Screening:
    """The cheap evidence of the points, by their places in the index.

    Attributes
    ----------
    normals : (N, S, 4) float32
        Normal and planarity of the plane fitted at each of `SCALES`; where a leaf of the index was found smooth, that
        of the leaf.
    probability : (N,) float32
        Of an edge, by the cheap evidence.
    statistics : (8,) float32
        Of the cloud: see `edgel._surface.statistics`.
    stretch : (3, N) float64 or None
        Of each place on scan lines: see `edgel._neighbors.scan_lines`.
    """

    normals: np.ndarray
    probability: np.ndarray
    statistics: np.ndarray
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
    statistics: np.ndarray,
    forests: Mapping[str, Forest] | None = None,
    stretch: np.ndarray | None = None,
) -> Screening:
    """Gather the cheap evidence of every point that the leaves of the index do not rule out.

    Takes the forests "leaf" and "screen", by default those of the package, and the stretch (3, N) on scan lines.
    """
    trees = load_forests() if forests is None else forests
    leaves = describe_leaves(index)
    of_cloud = np.broadcast_to(statistics, (len(leaves.features), len(statistics)))
    likely = evaluate(trees["leaf"], np.concatenate([leaves.features, of_cloud], axis=1)) >= LEAF
    # Leaves around a likely one are kept too: how the tree cuts the cloud, which turns with it, must not matter.
    size = np.diff(leaf_starts(index))
    kept = np.repeat(likely[leaves.nearest].any(axis=1), size)
    if stretch is not None:  # leaves hold points of one line, which say nothing of the surface
        kept |= stretch.any(axis=0)
    normals = np.repeat(leaves.planes[:, None].astype(np.float32), len(SCALES), axis=1).repeat(size, axis=0)
    probability = np.zeros(len(index), np.float32)
    places = np.flatnonzero(kept)
    if len(places):
        k = min(SCALES[-1], len(index))
        arguments = (np.array(SCALES), statistics, trees["screen"].in_step, normals, probability)
        visit_neighbors(gather.screen, at_places(index, places, places, stretch), index, k, *arguments)
    return Screening(normals, probability, statistics, stretch)
