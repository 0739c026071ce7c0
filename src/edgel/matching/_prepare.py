"""What a cloud offers for matching: its half-edges, its surface, and what its sensor saw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from edgel._columns import make_room
from edgel._detect import detect
from edgel._neighbors.estimate import estimate_normals
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.normals import SENSOR, UNKNOWN, Normals
from edgel._neighbors.orientation import WORSE, outward_normals, who_knows
from edgel._neighbors.thinning import thin_to
from edgel._objects import NORMALS
from edgel._range_image import without_no_return
from edgel.cloud import Cloud, as_cloud, check_points
from edgel.edges import EdgeKind, Edges
from edgel.matching._cut_walls import without_cut_walls
from edgel.matching._half_edges import HalfEdges, of_edges
from edgel.matching._sight import Sight, build_sight, empty_rays, no_sight

MOST_SURFACE = 4000
"""Places of a surface that are kept, of a small cloud."""
_MOST_OF_LARGE = 16_000  # and of a large one: narrow faces of parts have to have some
_POINTS_EACH = 3  # for each of these
_PLANE = 24  # neighbours of a plane fit: noise of half a spacing leaves normals good to 3 degrees
_FEW = 8  # neighbours of a plane where those of `_PLANE` lie on both walls of a thin part, or on a bend
_ALONG_WALL = 0.9  # least cosine of both planes' normals
_CLEAR = 2.5  # spacings from any edge, from where on planes are those of one face
_SMOOTH = 4.0  # spacings from any edge, from where on a surface is seen to be smooth
_FEWEST = 50


@dataclass(frozen=True, eq=False)
class Prepared:
    """One side of a match.

    Attributes
    ----------
    half : HalfEdges
        In the order of their coordinates.
    surface, normals : (S, 3) float64
        Places on the surface, evenly thinned, and its normals.
    smooth : (S,) bool
        Where the surface is seen to have no edge.
    gap : float
        Distance between neighbours of these places, or a little more.
    spacing : float
        Root of the area per point; 0 of a model.
    size : float
        Diagonal of what holds 96 % of the points along each axis.
    sight : Sight
    """

    half: HalfEdges
    surface: np.ndarray
    normals: np.ndarray
    smooth: np.ndarray
    gap: float
    spacing: float
    size: float
    sight: Sight

    @property
    def has_sight(self) -> bool:
        """Whether the sensor's place is known."""
        return len(self.sight.near) > 1


def prepare(points: Any, edges: Edges | None, name: str) -> Prepared:
    """Find the edges of a cloud, unless they are given, and thin its surface.

    Raises
    ------
    ValueError
        If the edges, of the cloud of this name, are of another one, or nobody knows their sides.
    """
    cloud = as_cloud(points)
    given = cloud
    if nobody_knows := who_knows("auto", cloud, sensor=cloud.viewpoint is not None)[0] == UNKNOWN:
        cloud = _turned_outwards(cloud)
    if edges is None:
        edges = detect(cloud)
        if nobody_knows and edges.orientation == SENSOR:  # a detector's own view is not the outside
            edges = detect(given, orient="outward")
    _check_edges(edges, len(cloud), name)
    finite, _ = without_no_return(cloud, check_points(cloud), cloud.viewpoint)
    order = np.lexsort(finite.xyz.T[::-1])  # whatever is chosen below must not depend on the order of the input
    xyz = np.ascontiguousarray(finite.xyz[order])
    index = build_index(xyz)
    k = min(16, len(xyz))
    discs = knn(index, index.at(index.evenly_sampled(2000)), k).distances[:, -1]
    spacing = float(np.sqrt(np.pi / k) * np.median(discs))
    sure = without_cut_walls(edges, xyz, index, spacing) if cloud.viewpoint is None else edges
    size = float(np.linalg.norm(np.diff(np.quantile(xyz, (0.02, 0.98), axis=0), axis=0)))
    thinned = thin_to(xyz, int(np.clip(len(xyz) // _POINTS_EACH, MOST_SURFACE, _MOST_OF_LARGE)), spacing)
    rows = finite.rows[order][thinned]
    planes = _planes_of_faces(cloud, rows)
    kept = np.isfinite(planes.offset)
    normals, places = planes.normals[kept], xyz[thinned][kept]
    places = places - ((places * normals).sum(axis=1) - planes.offset[kept])[:, None] * normals
    away = away_from(places, edges.position, _SMOOTH * spacing)
    half = of_edges(sure, places, normals, spacing, cloud.viewpoint)
    half = half.take(np.lexsort((*half.frames.reshape(-1, 9).T, *half.places.T)))
    clear = away > _CLEAR * spacing
    clear |= clear.sum() < _FEWEST
    sight = no_sight()
    if cloud.viewpoint is not None:
        sight = build_sight(xyz, cloud.viewpoint, empty_rays(cloud.xyz, cloud.shape, finite.rows, cloud.viewpoint))
    smooth = away[clear] >= _SMOOTH * spacing
    gap = spacing * float(np.sqrt(len(xyz) / len(thinned)))
    return Prepared(half, places[clear], normals[clear], smooth, gap, spacing, size, sight)


def _planes_of_faces(cloud: Cloud, rows: np.ndarray) -> Normals:
    """Fit planes that keep to one face at some points of a cloud.

    Planes through both walls of a pipe lie inside it: a part of which a view shows one wall would be put .45 spacings
    too near to the sensor, which itself sees one wall only.
    """
    planes = estimate_normals(cloud, at=rows, num_neighbors=_PLANE)
    if cloud.viewpoint is not None:
        return planes
    of_few = estimate_normals(cloud, at=rows, num_neighbors=_FEW)
    spread, least = (np.sqrt(p.residual / (k - 3)) for p, k in ((planes, _PLANE), (of_few, _FEW)))
    # Few points of a scan line lie on any plane through it.
    alike = np.abs((planes.normals * of_few.normals).sum(axis=1)) > _ALONG_WALL
    worse = np.flatnonzero((spread > WORSE * least) & alike)
    planes.put(worse, of_few.take(worse))
    return planes


def _turned_outwards(cloud: Cloud) -> Cloud:
    """Give a cloud the normals of its whole surface, found once for all that asks for its sides."""
    finite, _ = without_no_return(cloud, check_points(cloud), None)
    normals = np.full((len(cloud), 3), np.nan)
    normals[finite.rows] = outward_normals(build_index(finite.xyz))
    return make_room(cloud, NORMALS).with_attributes(**dict(zip(NORMALS, normals.T, strict=True)))


def shared_planes(side: Prepared) -> float:
    """Return how many of the planes of a surface each point of a cloud belongs to, 1 at least; 1 of a model."""
    return max(_PLANE * (side.spacing / side.gap) ** 2, 1.0)


def away_from(places: np.ndarray, edges: np.ndarray, reach: float) -> np.ndarray:
    """Return the distance (S,) of places (S, 3) from the nearest edge, at most the reach."""
    edges = edges[np.isfinite(edges).all(axis=1)]
    if not len(edges):
        return np.full(len(places), reach)
    return np.minimum(knn(build_index(edges), places, 1).distances[:, 0], reach)


def _check_edges(edges: Edges, count: int, name: str) -> None:
    if edges.num_points != count:
        raise ValueError(
            f"{name}_edges: found in {edges.num_points:,} points, the {name} has {count:,}; find them in it"
        )
    if edges.orientation == UNKNOWN and (edges.kind & EdgeKind.CREASE).any():
        raise ValueError(
            f"{name}_edges: nobody knows which side of their faces is outside; find them with orient='outward', or "
            "give the cloud its viewpoint"
        )
