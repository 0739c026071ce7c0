"""Smoothing: Canny's first step on the surface, as much of it as the noise asks for."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.neighborhood import relative
from edgel._neighbors.normals import fit_nearest
from edgel._neighbors.queries import Queries, at_places, every_point
from edgel._neighbors.spacing import disc_spacing
from edgel._surface import plane_scales
from edgel._surface.plane_scales import SCALES, fit_scales

NEIGHBORS = 24  # of the plane that a point is moved onto, the point among them
FROM, ALL = 0.26, 0.32  # noise, as `cloud_noise` measures it, up to which nothing moves, and from which on all the way
SAMPLE = 4_000  # points that the noise is measured at
_NEAR = 3  # neighbours that tell noise: of a point on a thin plate they lie on its own side
_STEP = 0.02  # what noise is rounded to: no answer shall hang on which points were sampled


def smoothed(index: NeighborIndex) -> NeighborIndex:
    """Move points towards the planes of their nearest; returns the index itself where the noise does not ask for it.

    Up to half a spacing of noise points are better left alone: a plane over a crease rounds it, and the fits of two
    planes average noise away by themselves. At one spacing these no longer see which plane a point belongs to.
    """
    share = share_of(cloud_noise(index))
    if share == 0.0:
        return index
    return build_index(move(index, every_point(index), index.by_point(), share))


def move(index: NeighborIndex, queries: Queries, xyz: np.ndarray, share: float) -> np.ndarray:
    """Move points of a cloud, asked for at (M, 3), some of the way to the planes of their nearest, (M, 3) float64."""
    planes = fit_nearest(index, queries, NEIGHBORS)
    off = (xyz * planes.normals).sum(axis=1) - planes.offset
    moved = xyz - share * off[:, None] * planes.normals
    return np.where(np.isfinite(moved), moved, xyz)


def share_of(noise: float) -> float:
    """Say how far towards their planes points are moved on a cloud of this noise, 0 to 1."""
    return min(max((noise - FROM) / (ALL - FROM), 0.0), 1.0)


def cloud_noise(index: NeighborIndex) -> float:
    """Measure how far the nearest of a point lie off the plane of its 32 nearest, put through the point, in spacings.

    The lower quartile over the cloud: 0.1 and less on clean surfaces however bent or thin they are, 0.2 at noise of 0.3
    spacings and 0.34 at one spacing, beyond which it hardly grows.
    """
    return noise_of(noise_at(index, index.sampled(SAMPLE)))


def noise_of(off: np.ndarray) -> float:
    """Take the quantile of what `noise_at` says of the sampled places of a cloud, in any order."""
    return round(float(np.quantile(off, 0.25)) / _STEP) * _STEP


def noise_at(index: NeighborIndex, places: np.ndarray) -> np.ndarray:
    """Measure how far the nearest of some places (M,) lie off their planes, in spacings, (M,) float64."""
    off, k = np.zeros(len(places)), min(SCALES[-1], len(index))
    visit_neighbors(_measure_off, at_places(index, places), index, k, np.array(SCALES[-1:]), off)
    return off


@kernel
def _measure_off(first, places, squared, queries, targets, xyz, scales, off):
    """Write how far the nearest lie off the last scale's plane, put through the point, in spacings."""
    vectors, fitted = np.empty((3, places.shape[1])), np.zeros((len(scales), 4))
    found, near = np.zeros(plane_scales.NUM_FEATURES), min(_NEAR, places.shape[1] - 1)
    for q in range(places.shape[0]):
        relative(places[q], queries, first + q, xyz, vectors)
        fit_scales(vectors, squared[q], scales, fitted, found)
        normal, total = fitted[len(scales) - 1], 0.0
        for i in range(1, near + 1):
            total += abs(vectors[0, i] * normal[0] + vectors[1, i] * normal[1] + vectors[2, i] * normal[2])
        off[targets[first + q]] = total / (near * max(disc_spacing(squared[q]), 1e-300))
