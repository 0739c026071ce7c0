"""Edges of a given size: a detector on a thinned cloud, where what is smaller cannot be seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from edgel._neighbors.spacing import median_spacing
from edgel._neighbors.thinning import thin
from edgel._stages import Stages
from edgel.cloud import as_cloud, check_points
from edgel.edges import Edges

E = TypeVar("E", bound=Edges)


def check_scale(scale: float) -> None:
    """Refuse a scale below 1."""
    if not (np.isfinite(scale) and scale >= 1):
        raise ValueError(f"scale: expected 1 (all points) or more, in median spacings, got {scale}")


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
