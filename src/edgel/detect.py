"""The whole method on one screen: what `edgel.detect` does with a cloud."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from edgel import paper
from edgel.boundary import boundary_gaps
from edgel.cloud import as_cloud, as_vector, check_points
from edgel.crease import crease_angles
from edgel.edges import EdgeKind, Edges
from edgel.kdtree import build_index
from edgel.normals import check_num_neighbors, fit_planes, towards
from edgel.stages import Stages

PRESETS = ("default", "paper")
MIN_CREASE_ANGLE = math.radians(25.0)  # a smaller turn is taken for a bend
MIN_BOUNDARY_GAP = math.radians(110.0)  # a smaller empty sector is taken for uneven sampling


def detect(
    points: Any,
    *,
    preset: Literal["default", "paper"] = "default",
    num_neighbors: int = 16,
    viewpoint: Any = None,
    progress: Callable[[str], None] | None = None,
) -> Edges:
    """Find the edge points of a cloud, their kind, and their normals.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        Points with a NaN or infinite coordinate are left out and counted.
    preset : {"default", "paper"}
        "default" tests every point for a crease or a boundary among its neighbours in 3D, from any side. "paper" is the
        published method as it stands, with its defaults: Canny on a projection along Z. `edgel.paper.detect` has its
        options.
    num_neighbors : int
        k of the plane fits that give the normals, the point itself among them; at least 3.
    viewpoint : (3,) array_like, optional
        Normals are turned towards it. Default: the sensor's position when the cloud knows it, else from above (+Z).
        With "paper" they have ``D > 0`` and no viewpoint can be given.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Returns
    -------
    Edges
        The same whatever the order of the points and the number of threads.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no coordinates or fewer than 3 finite ones, or lies on one line or spot, where no surface
        is; if an option is out of its range.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    >>> edges = edgel.detect(roof)
    >>> ridge = edges.index[edges.kind == edgel.EdgeKind.CREASE]
    >>> set(roof[ridge, 0].tolist())
    {20.0}
    """
    if preset not in PRESETS:
        raise ValueError(f"preset: expected one of {', '.join(PRESETS)}, got {preset!r}")
    if preset == "paper":
        if viewpoint is not None:
            raise ValueError("viewpoint: the paper turns normals by D > 0; leave it out, or use the default preset")
        return paper.detect(points, num_neighbors=num_neighbors, progress=progress)
    cloud = as_cloud(points)
    viewpoint = cloud.viewpoint if viewpoint is None else as_vector(viewpoint, "viewpoint")
    checked = check_points(cloud)
    k = check_num_neighbors(num_neighbors, len(checked.xyz))

    stages = Stages(progress)
    with stages("index"):
        index = build_index(checked.xyz)
    with stages("normals"):
        planes = fit_planes(index, index, k)
    if planes.num_undefined == len(planes):
        raise ValueError("points: all lie on one line or spot, so there is no surface whose edges could be found")
    with stages("creases"):
        angles = crease_angles(index, checked.xyz, MIN_CREASE_ANGLE)
    with stages("boundaries"):
        gaps = boundary_gaps(index, planes.normals, MIN_BOUNDARY_GAP)
    kind = np.where(angles > 0, EdgeKind.CREASE, 0) | np.where(gaps > 0, EdgeKind.BOUNDARY, 0)
    rows = np.flatnonzero(kind)
    strength = np.maximum(angles / (math.pi / 2), gaps / (2 * math.pi))[rows]
    return Edges(
        index=checked.rows[rows],
        kind=kind[rows].astype(np.uint8),
        strength=strength,
        planes=towards(planes.take(rows), checked.xyz[rows], viewpoint),
        num_points=checked.num_input,
        num_dropped=checked.num_dropped,
        preset=preset,
        parameters={"num_neighbors": k},
        seconds=stages.seconds,
    )
