"""The whole way from edge points to curves on one screen."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel.cloud import as_cloud, check_points
from edgel.curves._assemble import assemble
from edgel.curves._curves import Curves
from edgel.curves._outermost import along_outermost
from edgel.curves._points import edge_points
from edgel.curves._shapes import find_shapes
from edgel.curves._strands import find_strands
from edgel.edges import Edges

FAINT = 0.15
"""A `min_strength` for `edgel.detect` that gives `trace` most to go by: what the faces do not confirm it leaves out."""


def trace(points: Any, edges: Edges) -> Curves:
    """Link the edge points of a cloud into lines, arcs, circles and polylines, and measure them on the faces beside.

    Edge points say where a curve runs; where exactly, the points of the two faces beside it say: a line lies where two
    planes meet, a circle where surfaces of revolution meet (a plane, a cylinder, a cone), a corner where all faces
    around it meet. A circle through the edge points of a hole would be wrong by a tenth of the spacing and more.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        The cloud in which the edges were found. Points more than about 6 spacings from edge points are
        looked at only where an arc may go on beyond its own.
    edges : Edges
        Best with faint ones, ``edgel.detect(points, min_strength=edgel.curves.FAINT)``. The far side of a jump and the
        frame of what a sensor sees are left out.

    Returns
    -------
    Curves
        None where there are no edge points.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no coordinates, or other points than those in which the edges were found.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    >>> lines = edgel.curves.trace(roof, edgel.detect(roof, kinds="crease"))
    >>> len(lines), lines.length.round(1).tolist()
    (1, [39.1])
    """
    cloud = as_cloud(points)
    if len(cloud) != edges.num_points:
        raise ValueError(
            f"edges: found in a cloud of {edges.num_points:,} points, and this one has {len(cloud):,}; pass the cloud "
            "that was given to edgel.detect"
        )
    finite = check_points(cloud)
    origin = finite.xyz.mean(axis=0)
    xyz = finite.xyz - origin
    found = edge_points(xyz, np.searchsorted(finite.rows, edges.index), edges, origin)
    strands = along_outermost(find_strands(find_shapes(found), found), found)
    return assemble(strands, found, edges, origin, cloud.crs)
