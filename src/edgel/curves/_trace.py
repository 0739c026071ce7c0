"""The whole way from edge points to curves on one screen."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel.cloud import as_cloud, check_points
from edgel.curves._assemble import assemble
from edgel.curves._curves import Curves
from edgel.curves._points import edge_points
from edgel.curves._shapes import find_shapes
from edgel.curves._strands import find_strands
from edgel.edges import Edges


def trace(points: Any, edges: Edges) -> Curves:
    """TODO."""
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
    strands = find_strands(find_shapes(xyz, found), xyz, found)
    return assemble(strands, found, edges, origin, cloud.crs)
