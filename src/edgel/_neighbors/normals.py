"""Surface normals by plane fits to the nearest neighbours, at all points or only where they are asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from edgel._kernels.parallel import run_slices
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.plane_fits import fit_listed, fit_slice
from edgel._neighbors.queries import Queries, tree_of

SENSOR, OWN, OUTWARD, UNKNOWN = "sensor", "normals", "outward", "unknown"
"""Who says on which side of a surface its normals are: see `edgel.Edges.orientation`."""

_PER_POINT = ("normals", "offset", "residual", "variation")
_SLICE = 8192  # queries: the first chunk of a slice has none before it to guess its reach from


@dataclass(frozen=True, eq=False)
class Normals:
    """Best-fit planes ``normal . p = offset`` of the points asked for, in their order.

    Attributes
    ----------
    normals : (M, 3) float64
        Unit normals; NaN where the neighbours span no plane or the point itself is not finite.
    offset : (M,) float64
        D of the paper's eq. 20, the plane's signed distance from the origin, in the cloud's unit.
    residual : (M,) float64
        e of eq. 20, the sum of squared distances of the neighbours to the plane, in the cloud's unit squared.
    variation : (M,) float64
        Surface variation, smallest over summed variance (Pauly et al. 2002): 0 on a plane, 1/3 at most.
    orientation : str
        Who says on which side they are: "sensor", "normals" (those that came with the cloud), "outward" (the whole
        surface), or "unknown": then they look upwards (+Z).
    """

    normals: np.ndarray
    offset: np.ndarray
    residual: np.ndarray
    variation: np.ndarray
    orientation: str = UNKNOWN

    def __len__(self) -> int:
        return len(self.normals)

    @property
    def num_undefined(self) -> int:
        """Number of points without a normal."""
        return int(np.isnan(self.offset).sum())

    def take(self, rows: np.ndarray) -> Normals:
        """Return the planes of some rows."""
        return replace(self, **{name: getattr(self, name)[rows] for name in _PER_POINT})

    def put(self, rows: np.ndarray, planes: Normals) -> None:
        """Overwrite the planes of some rows."""
        for name in _PER_POINT:
            getattr(self, name)[rows] = getattr(planes, name)

    def flipped(self, where: np.ndarray) -> Normals:
        """Return the same planes with the normals of a (M,) mask turned round."""
        sign = np.where(where, -1.0, 1.0)
        return replace(self, normals=self.normals * sign[:, None], offset=self.offset * sign)


def no_planes(count: int) -> Normals:
    """Return that many planes, all still undefined."""
    offset, residual, variation = np.full((3, count), np.nan)
    return Normals(np.full((count, 3), np.nan), offset, residual, variation)


def check_num_neighbors(num_neighbors: int, num_points: int) -> int:
    """Check k of a plane fit and return how many neighbours a cloud of `num_points` can give."""
    if not isinstance(num_neighbors, int | np.integer) or num_neighbors < 3:
        raise ValueError(f"num_neighbors: a plane needs at least 3, got {num_neighbors!r}")
    return min(int(num_neighbors), num_points)


def fit_planes(index: NeighborIndex, queries: Queries, num_neighbors: int) -> Normals:
    """Fit planes to the k nearest neighbours of queries; the normals look upwards (+Z).

    All points are neighbours where there are fewer than `num_neighbors`.
    """
    return _fit(index, queries, min(num_neighbors, len(index)), np.empty(0))


def fit_nearest(index: NeighborIndex, queries: Queries, num_neighbors: int) -> Normals:
    """Fit planes as `fit_planes` does, with sums from the nearest neighbour to the farthest.

    So they are the same to the bit in a part of the cloud that holds these neighbours, whose tree is another.
    """
    count = len(queries)
    planes = Normals(np.empty((count, 3)), np.empty(count), np.empty(count), np.empty(count))
    results = (planes.normals, planes.offset, planes.residual, planes.variation)
    visit_neighbors(fit_listed, queries, index, min(num_neighbors, len(index)), *results)
    return planes


def fit_planes_within(index: NeighborIndex, queries: Queries, num_neighbors: int) -> tuple[Normals, np.ndarray]:
    """Fit planes as `fit_planes` does, and say within which distance the neighbours lie.

    Returns
    -------
    Normals
    (M,) float64
        Distance within which the neighbours of each lie.
    """
    limits = np.empty(len(queries))
    planes = _fit(index, queries, num_neighbors, limits)
    return planes, np.sqrt(limits)


def _fit(index: NeighborIndex, queries: Queries, num_neighbors: int, limits: np.ndarray) -> Normals:
    count = len(queries)
    planes = Normals(np.empty((count, 3)), np.empty(count), np.empty(count), np.empty(count))
    results = (planes.normals, planes.offset, planes.residual, planes.variation)
    if queries.are_stretched:
        visit_neighbors(fit_listed, queries, index, num_neighbors, *results)
        return planes
    run_slices(fit_slice, count, queries.arrays, tree_of(index), num_neighbors, *results, limits, size=_SLICE)
    return planes


def towards(planes: Normals, xyz: np.ndarray, viewpoint: np.ndarray | None) -> Normals:
    """Turn the upward normals of `fit_planes` at (M, 3) positions towards a viewpoint (3,), unless it is None."""
    if viewpoint is None:
        return planes
    return planes.flipped(((viewpoint - xyz) * planes.normals).sum(axis=1) < 0)


def by_offset(planes: Normals) -> Normals:
    """Turn the normals so that ``D > 0``, the orientation of the paper (eq. 20)."""
    return planes.flipped(planes.offset < 0)
