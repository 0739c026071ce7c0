"""Edges of a given size: the detector on a thinned cloud, where what is smaller cannot be seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np

from edgel import paper
from edgel.cloud import as_cloud, check_points
from edgel.detect import detect
from edgel.edges import Edges
from edgel.kdtree import build_index
from edgel.neighbors import knn
from edgel.stages import Stages

_SAMPLE = 20_000  # points whose nearest neighbours are looked for
_MOST_CELLS = 2.0**52  # that a float64 tells apart


def median_spacing(points: Any) -> float:
    """Return the median distance of points to their nearest neighbour, in the cloud's unit; of many points a sample.

    Points at the very place of another do not count; 0 where all are.

    Examples
    --------
    >>> import numpy as np
    >>> x, y = np.meshgrid(np.arange(10.0), np.arange(10.0))
    >>> median_spacing(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()])
    1.0
    """
    index = build_index(check_points(points).xyz)
    nearest = knn(index, index.at(index.strewn(_SAMPLE)), 2).distances[:, 1]
    nearest = nearest[nearest > 0]
    return float(np.median(nearest)) if len(nearest) else 0.0


def thin(points: Any, size: float) -> np.ndarray:
    """Choose one point of each voxel: the one nearest to its middle.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
    size : float
        Side of a voxel, in the cloud's unit, above 0; the voxels begin at the cloud's smallest coordinates.

    Returns
    -------
    (M,) int64
        Rows of the input, ascending. Which places are chosen does not depend on the order of the points.

    Raises
    ------
    TypeError, ValueError
        If `points` carries fewer than 3 finite points, or the size is not above 0.

    Examples
    --------
    >>> import numpy as np
    >>> thin(np.array([[0.0, 0, 0], [0.4, 0, 0], [2.5, 0, 0], [3.0, 3.0, 0]]), 1.0)
    array([1, 2, 3])
    """
    if not (np.isfinite(size) and size > 0):
        raise ValueError(f"size: expected a length above 0, in the cloud's unit, got {size}")
    checked = check_points(points)
    xyz = checked.xyz
    place = (xyz - xyz.min(axis=0)) / size
    cell = np.floor(place)
    voxel = _voxels(cell)
    away = ((place - cell - 0.5) ** 2).sum(axis=1)
    least = np.full(voxel.max() + 1, np.inf)
    np.minimum.at(least, voxel, away)
    best = np.flatnonzero(away <= least[voxel])
    shared = np.bincount(voxel[best])[voxel[best]] > 1
    alone, tied = best[~shared], best[shared]
    order = tied[np.lexsort((tied, xyz[tied, 2], xyz[tied, 1], xyz[tied, 0], voxel[tied]))]
    _, first = np.unique(voxel[order], return_index=True)
    return checked.rows[np.sort(np.concatenate([alone, order[first]]))]


def _voxels(cell: np.ndarray) -> np.ndarray:
    """Number the voxels that are occupied, of each point's cell along the axes (N, 3), at least 0; (N,) int64."""
    counts = cell.max(axis=0) + 1
    if counts.prod() < _MOST_CELLS:
        along = cell @ np.array([counts[1] * counts[2], counts[2], 1.0])
    else:  # numbered anew axis by axis, so that the numbers stay small
        along = np.zeros(len(cell), np.int64)
        for axis in range(3):
            _, places = np.unique(cell[:, axis], return_inverse=True)
            _, along = np.unique(along * (places.max() + 1) + places, return_inverse=True)
    return np.unique(along, return_inverse=True)[1]


def thin_to(xyz: np.ndarray, number: int, spacing: float) -> np.ndarray:
    """Choose at most this many of the points (N, 3), all finite, that lie evenly: one a voxel, as small as will do.

    Examples
    --------
    >>> import numpy as np
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    >>> len(thin_to(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()], 225, 1.0))
    225
    """
    rows = np.arange(len(xyz))
    size = (spacing or 1.0) * float(np.sqrt(len(rows) / number))
    while len(rows) > number:
        rows = rows[thin(xyz[rows], size)]
        size *= max(float(np.sqrt(len(rows) / number)), 1.05)
    return rows


def detect_at_scale(
    points: Any,
    scale: float = 1.0,
    *,
    preset: Literal["default", "paper"] = "default",
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Edges:
    """Find edges larger than some spacings: `edgel.detect` on the cloud thinned to one point a voxel of that size.

    Parameters
    ----------
    points, preset, progress
        As for `edgel.detect`.
    scale : float
        Side of the voxels, in median spacings, 1 or more. At 1 the cloud is not thinned.
    **options
        Of the preset: those of `edgel.detect`, or of `edgel.paper.detect`.

    Returns
    -------
    Edges
        Their rows are those of the whole input, and so is `num_points`.

    Raises
    ------
    TypeError, ValueError
        As for the preset's function, and if the scale is below 1.

    Examples
    --------
    >>> import numpy as np
    >>> x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 30)]
    >>> edges = detect_at_scale(roof, 2.0, kinds="crease")
    >>> bool((abs(roof[edges.index, 0] - 30) < 2).all()), edges.num_points
    (True, 3600)
    """
    if not (np.isfinite(scale) and scale >= 1):
        raise ValueError(f"scale: expected 1 (all points) or more, in median spacings, got {scale}")
    find: Callable[..., Edges] = paper.detect if preset == "paper" else partial(detect, preset=preset)
    cloud, stages = as_cloud(points), Stages(progress)
    if scale == 1:
        return find(cloud, progress=progress, **options)
    with stages("thinning"):
        rows = thin(cloud, scale * median_spacing(cloud))
    edges = find(cloud.take(rows), progress=progress, **options)
    return replace(
        edges,
        index=rows[edges.index],
        num_points=len(cloud),
        num_dropped=len(cloud) - len(check_points(cloud).rows),
        parameters={"scale": float(scale), **edges.parameters},
        seconds=stages.seconds | dict(edges.seconds),
    )
