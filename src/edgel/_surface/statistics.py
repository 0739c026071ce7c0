"""Cloud-level statistics: how bent, how noisy and how evenly sampled a cloud is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.candidates import at_places
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._surface import plane_scales
from edgel._surface.plane_scales import OF_SCALE, ROUNDNESS, SCALES, VARIATION, describe

FEATURES = {
    "bent_10": "10 % quantile, over the cloud, of `variation` at the largest scale",
    "bent_50": "its median",
    "bent_90": "its 90 % quantile",
    "noise_10": "10 % quantile of `variation` at the smallest scale",
    "noise_50": "its median",
    "nearest_10": "10 % quantile of the nearest neighbour's distance",
    "nearest_50": "its median",
    "roundness_50": "median of `roundness` at the smallest scale",
}
_SAMPLE = 8_000  # points that the quantiles are taken of
_SPANS = 1e-10  # roundness below which neighbours lie on a line
_LARGEST = len(OF_SCALE) * (len(SCALES) - 1)  # first column of the largest scale
_NEAREST = len(OF_SCALE) * len(SCALES)


@dataclass(frozen=True, eq=False)
class CloudStatistics:
    """What holds for a cloud as a whole.

    Attributes
    ----------
    values : (8,) float32
        `FEATURES`.
    has_surface : bool
        Whether any neighbourhood spans a plane.
    """

    values: np.ndarray
    has_surface: bool


def cloud_statistics(index: NeighborIndex) -> CloudStatistics:
    """Take quantiles of the cheap evidence over evenly sampled points of a cloud."""
    features = describe_places(index, index.evenly_sampled(_SAMPLE))
    bent, noise, nearest, roundness = (features[:, i] for i in (_LARGEST + VARIATION, VARIATION, _NEAREST, ROUNDNESS))
    quantiles = [
        np.quantile(bent, [0.1, 0.5, 0.9]),
        np.quantile(noise, [0.1, 0.5]),
        np.quantile(nearest, [0.1, 0.5]),
        np.quantile(roundness, [0.5]),
    ]
    has_surface = bool((features[:, _LARGEST + ROUNDNESS] > _SPANS).any())
    return CloudStatistics(np.concatenate(quantiles).astype(np.float32), has_surface)


def describe_places(index: NeighborIndex, places: np.ndarray) -> np.ndarray:
    """Return the cheap evidence (M, `plane_scales.NUM_FEATURES`) float32 at some places (M,), ascending, of an index."""
    features = np.zeros((len(places), plane_scales.NUM_FEATURES), np.float32)
    k = min(SCALES[-1], len(index))
    visit_neighbors(describe, at_places(index, places), index, k, np.array(SCALES), features)
    return features
