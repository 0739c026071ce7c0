"""How much of a simulated part's true edges the published method finds, and how far off its edge points lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.cloud import Cloud
from edgel.paper import PaperEdges
from edgel.synth import EdgeCurve, Solid, nearest_edge

_FLAT = np.array([1.0, 1.0, 0.0])  # as the viewer above sees it, in x and y alone


@dataclass(frozen=True)
class FoundLength:
    """How much of the true edges of one name was found.

    Attributes
    ----------
    name : str
        ``"rim"``, ``"outline"`` or ``"seam"``.
    length : float
        Their length in 3D, mm.
    with_pixel : float
        Share of it with an edge pixel's centre near it in x, y.
    with_point : float
        Share of it with an edge point near it in x, y.
    """

    name: str
    length: float
    with_pixel: float
    with_point: float


@dataclass(frozen=True)
class Offsets:
    """How far the edge points lie from the nearest true edge in x, y, mm."""

    median: float
    most: float
    """95 % of them lie nearer."""
    largest: float


def found_lengths(solid: Solid, cloud: Cloud, edges: PaperEdges, *, reach: float = 1.0) -> tuple[FoundLength, ...]:
    """Measure how much of the true edges was found, by their names.

    Parameters
    ----------
    solid : Solid
    cloud : Cloud
        A scan of it from above.
    edges : PaperEdges
        Of the cloud.
    reach : float
        How near in x, y an edge pixel or point has to be, mm.

    Examples
    --------
    >>> from edgel import paper, synth
    >>> solid = synth.elbow()
    >>> cloud = synth.scan(solid, num_points=50_000).cloud
    >>> found = found_lengths(solid, cloud, paper.detect(cloud), reach=4.0)
    >>> [(one.name, one.with_point > 0.9) for one in found]
    [('rim', True), ('outline', True)]
    """
    rows, columns = np.nonzero(edges.edge_map)
    pixels = np.column_stack([edges.grid.centres(rows, columns), np.zeros(len(rows))])
    points = cloud.xyz[edges.index] * _FLAT
    found = []
    for name in dict.fromkeys(curve.name for curve in (*solid.boundaries, *solid.creases)):
        middles, lengths = _segments([curve for curve in solid.edges if curve.name == name])
        total = lengths.sum()
        shares = [lengths[_is_near(middles * _FLAT, those, reach)].sum() / total for those in (pixels, points)]
        found.append(FoundLength(name, float(total), float(shares[0]), float(shares[1])))
    return tuple(found)


def offsets(solid: Solid, cloud: Cloud, edges: PaperEdges) -> Offsets:
    """Measure how far the edge points lie from the nearest true edge as the viewer sees it; NaN if there are none."""
    if len(edges) == 0:
        return Offsets(np.nan, np.nan, np.nan)
    flat = [replace(curve, points=curve.points * _FLAT) for curve in solid.edges]
    distance = nearest_edge(cloud.xyz[edges.index] * _FLAT, flat).distance
    median, most, largest = np.percentile(distance, [50, 95, 100])
    return Offsets(float(median), float(most), float(largest))


def _segments(curves: Sequence[EdgeCurve]) -> tuple[np.ndarray, np.ndarray]:
    """Middles (S, 3) and lengths (S,) of the pieces of curves."""
    middles = [(curve.points[:-1] + curve.points[1:]) / 2 for curve in curves]
    lengths = [np.linalg.norm(np.diff(curve.points, axis=0), axis=1) for curve in curves]
    return np.concatenate(middles), np.concatenate(lengths)


def _is_near(queries: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    if len(points) == 0:
        return np.zeros(len(queries), bool)
    return knn(build_index(points), queries, 1).distances[:, 0] <= reach
