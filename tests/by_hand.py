"""Clouds and edges made by hand, for tests of what is drawn and told of them."""

from typing import Any

import numpy as np

from edgel import Cloud, EdgeKind, Edges
from edgel._faces import Faces


def grid(columns=60, rows=40, step=1.0):
    """Points (N, 3) of a level grid, x from 0 to columns - step, y from 0 to rows - step, row by row."""
    x, y = np.meshgrid(np.arange(0, columns, step), np.arange(0, rows, step))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def tee(num_points):
    """The paper's tee as seen from above: half pipes of radius 57.15 along x (210 long) and towards +y, (M, 3)."""
    radius, half, end = 57.15, 105.0, 105.0
    step = np.sqrt((2 * half) * (radius + end) / num_points)
    x, y = np.meshgrid(np.arange(-half, half + step / 2, step), np.arange(-radius, end + step / 2, step))
    with np.errstate(invalid="ignore"):
        run = np.sqrt(radius**2 - y**2)
        branch = np.where(y >= 0, np.sqrt(radius**2 - x**2), np.nan)
    z = np.fmax(run, branch)
    known = np.isfinite(z)
    return np.column_stack([x[known], y[known], z[known]])


def edges_at(cloud, rows, kind: Any = EdgeKind.CREASE, *, strength: Any = 1.0, normals: Any = (0.0, 0.0, 1.0)):
    """Edges in these rows (E,) int, or (N,) bool, of a cloud, as a detector would answer them."""
    cloud = cloud if isinstance(cloud, Cloud) else Cloud(cloud)
    rows = np.asarray(rows)
    rows = np.flatnonzero(rows) if rows.dtype == bool else rows.astype(np.int64)
    return Edges(
        index=rows,
        kind=np.broadcast_to(np.asarray(kind, np.uint8), len(rows)),
        strength=np.broadcast_to(np.asarray(strength, float), len(rows)),
        **vars(Faces.of_points(cloud.xyz[rows], np.broadcast_to(np.asarray(normals, float), (len(rows), 3)))),
        orientation="unknown",
        num_points=len(cloud),
        num_dropped=int((~np.isfinite(cloud.xyz).all(axis=1)).sum()),
        method="surface",
        reason="asked for",
        parameters={"num_neighbors": 16, "viewpoint": None},
        seconds={"index": 0.125, "normals": 0.25},
    )
