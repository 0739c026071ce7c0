"""Surface normals by plane fits to the nearest neighbours, at all points or only where they are asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from edgel.blocks import Queries, Tree, queries_of, tree_of
from edgel.cloud import as_cloud, as_vector, check_points, check_rows
from edgel.kdtree import NeighborIndex, build_index
from edgel.parallel import kernel, run_slices
from edgel.planes import fit_slice

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
    """

    normals: np.ndarray
    offset: np.ndarray
    residual: np.ndarray
    variation: np.ndarray

    def __len__(self) -> int:
        return len(self.normals)

    @property
    def num_undefined(self) -> int:
        """Number of points without a normal."""
        return int(np.isnan(self.offset).sum())

    def take(self, rows: np.ndarray) -> Normals:
        """Return the planes of some rows."""
        return Normals(self.normals[rows], self.offset[rows], self.residual[rows], self.variation[rows])

    def put(self, rows: np.ndarray, planes: Normals) -> None:
        """Overwrite the planes of some rows."""
        for each in fields(self):
            getattr(self, each.name)[rows] = getattr(planes, each.name)

    def flipped(self, where: np.ndarray) -> Normals:
        """Return the same planes with the normals of a (M,) mask turned round."""
        sign = np.where(where, -1.0, 1.0)
        return replace(self, normals=self.normals * sign[:, None], offset=self.offset * sign)


def no_planes(count: int) -> Normals:
    """Return that many planes, all still undefined."""
    return Normals(np.full((count, 3), np.nan), *(np.full(count, np.nan) for _ in range(3)))


def estimate_normals(points: Any, *, at: Any = None, num_neighbors: int = 16, viewpoint: Any = None) -> Normals:
    """Fit a plane to the k nearest neighbours of each point, or only of the points `at`.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        Neighbours are searched among all of its finite points, exactly.
    at : (M,) int or (N,) bool, optional
        Rows of the points whose normals are wanted; default all.
    num_neighbors : int
        k, the point itself among them; at least 3. Fewer are used when the cloud has fewer.
    viewpoint : (3,) array_like, optional
        Normals are turned towards it. Default: the sensor's position when the cloud knows it, else from above (+Z).

    Returns
    -------
    Normals
        One row a point asked for; the same whatever the order of the points and the number of threads.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no coordinates or fewer than 3 finite ones, or an option is out of its range.

    Notes
    -----
    Total least squares as in eq. 20 of the paper: the eigenvector of the smallest eigenvalue of the neighbours' scatter
    matrix.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(10.0), np.arange(10.0))
    >>> edgel.estimate_normals(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()], at=[44]).normals
    array([[0., 0., 1.]])
    """
    cloud = as_cloud(points)
    if viewpoint is None:
        viewpoint = cloud.viewpoint
    viewpoint = None if viewpoint is None else as_vector(viewpoint, "viewpoint")
    checked = check_points(cloud)
    index = build_index(checked.xyz)
    if at is None and checked.num_dropped == 0:
        return towards(fit_planes(index, index, check_num_neighbors(num_neighbors, len(index))), checked.xyz, viewpoint)
    rows = np.arange(len(cloud)) if at is None else check_rows(at, len(cloud))
    wanted = np.asarray(np.isfinite(cloud.xyz[rows]).all(axis=1))
    xyz = cloud.xyz[rows[wanted]]
    planes = plane_fits(index, xyz, num_neighbors)
    return _spread(towards(planes, xyz, viewpoint), wanted)


def check_num_neighbors(num_neighbors: int, num_points: int) -> int:
    """Check k of a plane fit and return how many neighbours a cloud of `num_points` can give."""
    if not isinstance(num_neighbors, int | np.integer) or num_neighbors < 3:
        raise ValueError(f"num_neighbors: a plane needs at least 3, got {num_neighbors!r}")
    return min(int(num_neighbors), num_points)


def plane_fits(index: NeighborIndex, xyz: np.ndarray, num_neighbors: int) -> Normals:
    """Fit planes to the k nearest neighbours of (M, 3) finite positions; the normals look upwards (+Z)."""
    k = check_num_neighbors(num_neighbors, len(index))
    if len(xyz) == 0:
        return no_planes(0)
    return fit_planes(index, build_index(xyz), k)


def fit_planes(index: NeighborIndex, queries: NeighborIndex, num_neighbors: int) -> Normals:
    """Fit planes at sorted queries, which may be the index itself; normals upwards, rows in the queries' own order.

    All points are neighbours where there are fewer than `num_neighbors`.
    """
    return _fit(tree_of(index), queries_of(queries), min(num_neighbors, len(index)), np.empty(0))


def plane_fits_within(
    index: NeighborIndex, places: np.ndarray, rows: np.ndarray, num_neighbors: int
) -> tuple[Normals, np.ndarray]:
    """Fit planes at some of an index' own points.

    Parameters
    ----------
    places : (M,) int64
        Places of the points in the index, ascending.
    rows : (M,) int64
        Where the results of each go: a permutation.

    Returns
    -------
    Normals
    (M,) float64
        Distance within which the neighbours of each lie.
    """
    limits = np.empty(len(rows))
    x, y, z = index.xyz.take(places, axis=1)
    planes = _fit(tree_of(index), Queries(x, y, z, rows), num_neighbors, limits)
    return planes, np.sqrt(limits)


def _fit(tree: Tree, queries: Queries, num_neighbors: int, limits: np.ndarray) -> Normals:
    count = len(queries.rows)
    planes = Normals(np.empty((count, 3)), np.empty(count), np.empty(count), np.empty(count))
    results = (planes.normals, planes.offset, planes.residual, planes.variation)
    run_slices(fit_slice, count, queries, tree, num_neighbors, *results, limits, size=_SLICE)
    return planes


def towards(planes: Normals, xyz: np.ndarray, viewpoint: np.ndarray | None) -> Normals:
    """Turn the upward normals of `fit_planes` at (M, 3) positions towards a viewpoint (3,), unless it is None."""
    if viewpoint is None:
        return planes
    return planes.flipped(((viewpoint - xyz) * planes.normals).sum(axis=1) < 0)


def by_offset(planes: Normals) -> Normals:
    """Turn the normals so that ``D > 0``, the orientation of the paper (eq. 20)."""
    return planes.flipped(planes.offset < 0)


def _spread(planes: Normals, wanted: np.ndarray) -> Normals:
    """Put planes into the rows of a mask, NaN elsewhere."""
    if wanted.all():
        return planes
    full = no_planes(len(wanted))
    full.put(np.flatnonzero(wanted), planes)
    return full


@kernel
def smallest_eigenpair(xx, xy, xz, yy, yz, zz):
    """Return the smallest and the middle eigenvalue of a symmetric 3 x 3 matrix, and the former's unit eigenvector.

    Closed form (Smith 1961, doi:10.1145/355578.366316), then Rayleigh quotients, which undo the rounding of the arccos.
    """
    scale = max(abs(xx), abs(yy), abs(zz), abs(xy), abs(xz), abs(yz))
    if scale == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 1.0
    xx, xy, xz, yy, yz, zz = xx / scale, xy / scale, xz / scale, yy / scale, yz / scale, zz / scale
    mean = (xx + yy + zz) / 3.0
    dx, dy, dz = xx - mean, yy - mean, zz - mean
    p = math.sqrt((dx * dx + dy * dy + dz * dz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if p < 1e-100:  # three equal eigenvalues
        return mean * scale, mean * scale, 0.0, 0.0, 1.0
    det = dx * (dy * dz - yz * yz) - xy * (xy * dz - yz * xz) + xz * (xy * yz - dy * xz)
    angle = math.acos(min(max(det / (2.0 * p * p * p), -1.0), 1.0)) / 3.0
    largest = mean + 2.0 * p * math.cos(angle)
    smallest = mean + 2.0 * p * math.cos(angle + 2.0943951023931953)
    # At rank 1 the longest row is the largest eigenvector.
    x, y, z = across(*_longest_row(xx - smallest, xy, xz, yy - smallest, yz, zz - smallest))
    for step in range(4):
        a, b, c = xx - smallest, yy - smallest, zz - smallest
        # Every column of the adjugate of A - lambda I points along the eigenvector; the longest is the safest.
        ax, ay, az = b * c - yz * yz, a * c - xz * xz, a * b - xy * xy
        kxy, kxz, kyz = xz * yz - xy * c, xy * yz - xz * b, xy * xz - yz * a
        if abs(ax) >= abs(ay) and abs(ax) >= abs(az):
            u, v, w = ax, kxy, kxz
        elif abs(ay) >= abs(az):
            u, v, w = kxy, ay, kyz
        else:
            u, v, w = kxz, kyz, az
        length = math.sqrt(u * u + v * v + w * w)
        if length > 1e-14 * p * p:
            x, y, z = u / length, v / length, w / length
        elif step > 0:  # the two smallest are equal: any direction across the largest will do
            break
        smallest = x * (xx * x + xy * y + xz * z) + y * (xy * x + yy * y + yz * z) + z * (xz * x + yz * y + zz * z)
    middle = 3.0 * mean - smallest - largest
    if middle < smallest:  # so near each other that the other one was found: turn to the direction across
        u, v, w = _longest_row(xx - smallest, xy, xz, yy - smallest, yz, zz - smallest)
        u, v, w = y * w - z * v, z * u - x * w, x * v - y * u
        length = math.sqrt(u * u + v * v + w * w)
        if length > 0.0:
            x, y, z, middle = u / length, v / length, w / length, smallest
            smallest = x * (xx * x + xy * y + xz * z) + y * (xy * x + yy * y + yz * z) + z * (xz * x + yz * y + zz * z)
    return smallest * scale, middle * scale, x, y, z


@kernel
def _longest_row(a, xy, xz, b, yz, c):
    """Return the longest row of a symmetric matrix."""
    u, v, w = a, xy, xz
    if b * b + yz * yz + xy * xy > u * u + v * v + w * w:
        u, v, w = xy, b, yz
    if c * c + yz * yz + xz * xz > u * u + v * v + w * w:
        u, v, w = xz, yz, c
    return u, v, w


@kernel
def across(u, v, w):
    """Return a unit vector across another one (of a vector of no length, +X)."""
    if abs(u) <= abs(v) and abs(u) <= abs(w):
        x, y, z = 0.0, w, -v
    elif abs(v) <= abs(w):
        x, y, z = -w, 0.0, u
    else:
        x, y, z = v, -u, 0.0
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return 1.0, 0.0, 0.0
    return x / length, y / length, z / length


@kernel
def tangents(nx, ny, nz):
    """Return two unit vectors across a unit normal and each other."""
    x, y, z = across(nx, ny, nz)
    return x, y, z, ny * z - nz * y, nz * x - nx * z, nx * y - ny * x
