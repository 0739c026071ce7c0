"""Edges of given sizes: a detector on thinned clouds, where what is small cannot be seen and what is soft is sharp."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import anywhere
from edgel._neighbors.spacing import median_spacing
from edgel._neighbors.thinning import thin
from edgel._stages import Stages
from edgel.cloud import as_cloud, check_points
from edgel.edges import Edges

E = TypeVar("E", bound=Edges)


APART = 1.5  # voxels: what is seen nearer to an edge of a finer scale is that edge again


def check_scale(scale: float) -> None:
    """Refuse a scale below 1."""
    if not (np.isfinite(scale) and scale >= 1):
        raise ValueError(f"scale: expected 1 (all points) or more, in median spacings, got {scale}")


def check_max_scale(max_scale: float | None, scale: float) -> float:
    """Return the largest scale, refusing one below the least."""
    if max_scale is None:
        return scale
    if not (np.isfinite(max_scale) and max_scale >= scale):
        raise ValueError(f"max_scale: expected the scale ({scale:g}) or more, in median spacings, got {max_scale}")
    return max_scale


def at_scale(
    find: Callable[..., E],
    points: Any,
    scale: float,
    *,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> E:
    """Find edges larger than some spacings: a detector on the cloud thinned to one point a voxel of that size.

    Parameters
    ----------
    find : callable
        `edgel.detect` or `edgel.paper.detect`.
    points, progress
        As it takes them.
    scale : float
        Side of the voxels, in median spacings, above 1.
    **options
        Of the detector.

    Returns
    -------
    Edges
        Their rows are those of the whole input, and so is `num_points`.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 30)]
    >>> edges = at_scale(edgel.detect, roof, 2.0, kinds="crease")
    >>> bool((abs(roof[edges.index, 0] - 30) < 2).all()), edges.num_points
    (True, 3600)
    """
    cloud, stages = as_cloud(points), Stages(progress)
    with stages("thinning"):
        rows = thin(cloud, scale * median_spacing(cloud))
    edges = find(cloud.take(rows), progress=progress, **options)
    return replace(
        edges,
        index=rows[edges.index],
        num_points=len(cloud),
        num_dropped=check_points(cloud).num_dropped,
        parameters={"scale": float(scale), **edges.parameters},
        seconds=stages.seconds | dict(edges.seconds),
    )


def over_scales(
    find: Callable[..., E],
    points: Any,
    scale: float,
    max_scale: float,
    *,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> E:
    """Find edges at a scale, at twice that, and so on; of an edge seen at several the finest counts.

    Parameters
    ----------
    find, points, progress, **options
        As `at_scale` takes them.
    scale, max_scale : float
        Of the first look, and what no other exceeds, in median spacings.

    Returns
    -------
    Edges
        Of all scales; what is not said by point is that of the finest.
    """
    cloud = as_cloud(points)
    found = find(cloud, scale=scale, progress=progress, **options)
    spacing, seconds = median_spacing(cloud), dict(found.seconds)
    while (scale := 2 * scale) <= max_scale:
        coarser = find(cloud, scale=scale, progress=progress, **options)
        if len(found) and len(coarser):
            nearest = knn(build_index(found.position), anywhere(coarser.position), 1).distances[:, 0]
            coarser = coarser.take(nearest > APART * scale * spacing)
        found = found.join(coarser)
        seconds = {name: seconds.get(name, 0.0) + time for name, time in coarser.seconds.items()}
    parameters = {**found.parameters, "max_scale": float(max_scale)}
    return replace(found, parameters=parameters, seconds=seconds)
