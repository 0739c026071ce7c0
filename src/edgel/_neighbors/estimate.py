"""`edgel.estimate_normals`: the normals of all points of a cloud, or only where they are asked for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.normals import OUTWARD, SENSOR, Normals, check_num_neighbors, fit_planes, no_planes, towards
from edgel._neighbors.orientation import check_orient, outward_normals, who_knows
from edgel._neighbors.queries import anywhere, every_point
from edgel.cloud import as_cloud, as_vector, check_points, check_rows


def estimate_normals(
    points: Any,
    *,
    at: Any = None,
    num_neighbors: int = 16,
    viewpoint: Any = None,
    orient: Literal["auto", "outward"] = "auto",
) -> Normals:
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
        Where the sensor stood. Default: what the cloud knows of it.
    orient : {"auto", "outward"}
        The side the normals are on: that of the sensor, where its place is known, else that of the cloud's own normals
        (nx, ny, nz), else upwards (+Z), which on a surface all round is neither inside nor outside. "outward": they are
        carried from neighbour to neighbour over the whole surface, and look outwards at its outermost points.
        `Normals.orientation` says which it was.

    Returns
    -------
    Normals
        One row a point asked for; the same whatever the order of the points and the number of threads.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no coordinates or fewer than 3 finite ones, an option is out of its range, or a viewpoint is
        given beside ``orient="outward"``.

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
    check_orient(orient, has_viewpoint=viewpoint is not None)
    cloud = as_cloud(points)
    if viewpoint is None:
        viewpoint = cloud.viewpoint
    viewpoint = None if viewpoint is None else as_vector(viewpoint, "viewpoint")
    checked = check_points(cloud)
    index = build_index(checked.xyz)
    k = check_num_neighbors(num_neighbors, len(index))
    orientation, own = who_knows(orient, cloud, sensor=viewpoint is not None)
    if orientation == OUTWARD:
        own = np.full(cloud.xyz.shape, np.nan)
        own[checked.rows] = outward_normals(index)
    if at is None:
        count, put, rows, xyz = len(cloud), checked.rows, checked.rows, checked.xyz
        planes = fit_planes(index, every_point(index), k)
    else:
        asked = check_rows(at, len(cloud))
        put = np.flatnonzero(np.isfinite(cloud.xyz[asked]).all(axis=1))
        count, rows, xyz = len(asked), asked[put], cloud.xyz[asked[put]]
        planes = fit_planes(index, anywhere(xyz), k) if len(xyz) else no_planes(0)
    if orientation == SENSOR:
        planes = towards(planes, xyz, viewpoint)
    elif own is not None:
        planes = planes.flipped((planes.normals * own[rows]).sum(axis=1) < 0)
    return _put_back(replace(planes, orientation=orientation), put, count)


def _put_back(planes: Normals, rows: np.ndarray, count: int) -> Normals:
    """Put planes into some rows, ascending, of so many; NaN elsewhere."""
    if len(rows) == count:
        return planes
    full = replace(no_planes(count), orientation=planes.orientation)
    full.put(rows, planes)
    return full
