"""Cloud-level statistics: how bent, how noisy and how evenly sampled a cloud is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import at_places
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
STEPS = np.array([2.0, 2.0, 1.0, 2.0, 2.0, 0.2, 0.1, 0.1])
"""What each is rounded to: no answer shall hang on which points were sampled, or on what lies far away."""
CELL = 16.0
"""Size of the cells that are looked at first, in median spacings."""
SAMPLE = 16_000
"""Points that the quantiles are taken of."""
_SPANS = 1e-10  # roundness below which neighbours lie on a line
_LARGEST = len(OF_SCALE) * (len(SCALES) - 1)  # first column of the largest scale
_NEAREST = len(OF_SCALE) * len(SCALES)


@dataclass(frozen=True, eq=False)
class Statistics:
    """What the whole cloud says.

    Attributes
    ----------
    features : (8,) float32
        `FEATURES`, in whole `STEPS`.
    spacing : float
        Median root of the area that a point stands for, in the cloud's unit.
    """

    features: np.ndarray
    spacing: float

    @property
    def cell(self) -> float:
        """Size of the cells whose points are looked at together at first: a power of two, in the cloud's unit."""
        return float(2.0 ** np.round(np.log2(CELL * self.spacing)))


def cloud_statistics(index: NeighborIndex, stretch: np.ndarray | None = None) -> Statistics:
    """Take quantiles of the cheap evidence over a cloud, at places chosen by their coordinates alone.

    Takes the stretch (3, N) of `edgel._neighbors.scan_lines`, where there is one.

    Raises
    ------
    ValueError
        If no neighbourhood spans a plane.
    """
    return statistics_of(*describe_places(index, index.sampled(SAMPLE), stretch))


def statistics_of(features: np.ndarray, spacing: np.ndarray) -> Statistics:
    """Take the quantiles of what `describe_places` says of the sampled places of a cloud, in any order.

    Raises
    ------
    ValueError
        If no neighbourhood spans a plane.
    """
    if not (features[:, _LARGEST + ROUNDNESS] > _SPANS).any():
        raise ValueError("points: all lie on one line or spot, so there is no surface whose edges could be found")
    columns = features[:, (_LARGEST + VARIATION, VARIATION, _NEAREST, ROUNDNESS)]
    bent, noise, nearest, roundness = np.quantile(columns, [0.1, 0.5, 0.9], axis=0).T
    quantiles = np.array([*bent, *noise[:2], *nearest[:2], roundness[1]])
    values = (np.round(quantiles / STEPS) * STEPS).astype(np.float32)
    return Statistics(values, float(np.median(spacing[spacing > 0])))


def describe_places(
    index: NeighborIndex, places: np.ndarray, stretch: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the cheap evidence (M, `plane_scales.NUM_FEATURES`) float32 at some places (M,), and the spacing (M,).

    Takes the stretch (3, N) of `edgel._neighbors.scan_lines`, where there is one.
    """
    features, spacing = np.zeros((len(places), plane_scales.NUM_FEATURES), np.float32), np.empty(len(places))
    k, queries = min(SCALES[-1], len(index)), at_places(index, places, stretch=stretch)
    visit_neighbors(describe, queries, index, k, np.array(SCALES), features, spacing)
    return features, spacing
