"""Creases one of whose faces has no points: the ends of thin walls that were cut, where both walls look like one."""

from __future__ import annotations

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import knn
from edgel.edges import EdgeKind, Edges

_FROM, _TO, _HALF, _OFF = 0.5, 1.5, 1.5, 0.6
"""Spacings: from where to where into a face it has to have points, along the edge to either side, and off the face."""
_AROUND = 40  # points about an edge point: all within that on two faces
_ALONG, _ALIKE, _MEAN = 5.0, 0.8, 16
"""Spacings along an edge over which counts are averaged, the cosine of tangents of one edge, and points at most."""
_FEWEST = 5  # edge points in a row: fewer are no edge of a part
_SHARE = 0.75  # of what is usual in the cloud


def without_cut_walls(edges: Edges, xyz: np.ndarray, index: NeighborIndex, spacing: float) -> Edges:
    """Leave out creases of which one face has fewer points beside the edge than creases of the cloud have."""
    told = np.isfinite(edges.normals).all(axis=(1, 2)) & np.isfinite(edges.direction).all(axis=1)
    crease = np.flatnonzero(told & ((edges.kind & EdgeKind.CREASE) > 0) & (edges.convex != 0))
    if len(crease) < _MEAN:
        return edges
    creases = edges.take(crease)
    fewer = _fewer_points(creases, xyz, index, spacing)
    near = knn(build_index(creases.position), creases.position, _MEAN)
    alike = np.abs(np.einsum("ei,eki->ek", creases.direction, creases.direction[near.points])) > _ALIKE
    alike &= near.distances < _ALONG * spacing
    mean = (fewer[near.points] * alike).sum(axis=1) / alike.sum(axis=1)
    kept = np.ones(len(edges), bool)
    kept[crease] = (mean >= _SHARE * np.median(mean)) & (alike.sum(axis=1) >= _FEWEST)
    return edges.take(np.flatnonzero(kept))


def _fewer_points(creases: Edges, xyz: np.ndarray, index: NeighborIndex, spacing: float) -> np.ndarray:
    """Return how many points (C,) the face of each crease has that has fewer, beside the edge."""
    around = xyz[knn(index, creases.position, min(_AROUND, len(index))).points] - creases.position[:, None]
    along = np.abs(np.einsum("eki,ei->ek", around, creases.direction)) < _HALF * spacing
    counts = []
    for face in range(2):
        normal, other = creases.normals[:, face], creases.normals[:, 1 - face]
        into = np.cross(normal, creases.direction)
        # Faces of a ridge go away from each other's outside, of a valley towards it.
        into *= -(np.sign((into * other).sum(axis=1)) * creases.convex)[:, None]
        deep = np.einsum("eki,ei->ek", around, into) / spacing
        off = np.abs(np.einsum("eki,ei->ek", around, normal)) < _OFF * spacing
        counts.append((along & off & (deep > _FROM) & (deep < _TO)).sum(axis=1))
    return np.minimum(*counts)
