"""What the training of the trees takes from a cloud: features by points, with the index kept out of sight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.scan_lines import scan_line_stretch
from edgel._surface.evidence import Evidence, gather_evidence, with_context
from edgel._surface.forest import Forest
from edgel._surface.leaves import describe_leaves
from edgel._surface.screen import Screening, screen
from edgel._surface.smoothing import smoothed
from edgel._surface.statistics import cloud_statistics, describe_places


@dataclass(frozen=True, eq=False)
class ScreeningFeatures:
    """What the two screenings hear of a cloud.

    Attributes
    ----------
    leaves : (L, len(LEAF)) float32
        Of each leaf of the octree, by `edgel._surface.features.LEAF`.
    leaf : (N,) int64
        The leaf that each point lies in.
    points : (M,) int64
        The points asked for, in the order of the index.
    features : (M, NUM_SCREEN) float32
        Of each of them, the first columns of `edgel._surface.features.POINT`.
    """

    leaves: np.ndarray
    leaf: np.ndarray
    points: np.ndarray
    features: np.ndarray


def screening_features(xyz: np.ndarray, asked: np.ndarray) -> ScreeningFeatures:
    """Describe all leaves of a cloud (N, 3), and the points asked for, (N,) bool."""
    index = smoothed(build_index(np.ascontiguousarray(xyz)))
    stretch = scan_line_stretch(index)
    statistics = cloud_statistics(index, stretch)
    values, found = statistics.features, describe_leaves(index, statistics.cell)
    places = np.flatnonzero(asked[index.order])
    leaf = np.empty(len(index), np.int64)
    leaf[index.order] = found.octree.leaf_of_places()
    leaves, features = (
        np.concatenate([part, np.broadcast_to(values, (len(part), len(values)))], axis=1)
        for part in (found.features, describe_places(index, places, stretch)[0])
    )
    return ScreeningFeatures(leaves, leaf, index.order[places], features)


@dataclass(frozen=True, eq=False)
class ScreenedCloud:
    """A cloud after the screening; made by `screen_cloud`."""

    index: NeighborIndex
    screening: Screening

    @property
    def probability(self) -> np.ndarray:
        """Of an edge at each point, (N,) float32, by the cheap evidence."""
        probability = np.empty(len(self.index), np.float32)
        probability[self.index.order] = self.screening.probability
        return probability

    def gather_evidence(self, asked: np.ndarray) -> tuple[np.ndarray, Evidence]:
        """Return the points (M,) asked for, (N,) bool, in the order of the index, and the costly evidence of each."""
        places = np.flatnonzero(asked[self.index.order])
        return self.index.order[places], gather_evidence(self.index, self.screening, places)


def screen_cloud(xyz: np.ndarray, forests: Mapping[str, Forest]) -> ScreenedCloud:
    """Screen a cloud (N, 3) with the forests "leaf" and "screen"."""
    index = smoothed(build_index(np.ascontiguousarray(xyz)))
    stretch = scan_line_stretch(index)
    return ScreenedCloud(index, screen(index, cloud_statistics(index, stretch), forests, stretch))


def add_context(
    xyz: np.ndarray, points: np.ndarray, evidence: Evidence, crease: np.ndarray, outline: np.ndarray
) -> np.ndarray:
    """Add to the evidence of some points (M,), in the order of the index, what their context says.

    Takes the coordinates (N, 3) of the index, smoothed where the cloud was; see `edgel._surface.evidence.with_context`.
    """
    index = build_index(np.ascontiguousarray(xyz))
    return with_context(index, index.places_of(points), evidence, crease, outline, scan_line_stretch(index))


def blend(one: Forest, other: Forest, share: float) -> Forest:
    """Put two forests together, so that their logit is the mean of both; the other's counts for a share of it."""
    nodes = len(one.feature)
    weighted = (np.where(f.feature < 0, w * f.threshold, f.threshold) for f, w in ((one, 1 - share), (other, share)))
    return Forest(
        roots=np.concatenate([one.roots, other.roots + nodes]),
        feature=np.concatenate([one.feature, other.feature]),
        threshold=np.concatenate(list(weighted), dtype=np.float32),
        right=np.concatenate([one.right, other.right + nodes]),
    )
