"""How much of a simulated part's true edges the published method finds, and how far off its edge points lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.paper import PaperEdges
from edgel.synth import EDGE_KINDS, Part, Scan


@dataclass(frozen=True)
class FoundLength:
    """How much of the true edges of one kind was found.

    Attributes
    ----------
    kind : str
        ``"boundary"``, ``"occluding"`` or ``"crease"``.
    length : float
        Their length in 3D, mm.
    with_pixel : float
        Share of it with an edge pixel's centre near it in x, y.
    with_point : float
        Share of it with an edge point near it in x, y.
    """

    kind: str
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


def found_lengths(scan: Scan, edges: PaperEdges, *, reach: float = 1.0) -> tuple[FoundLength, ...]:
    """Measure how much of the true edges was found, by kind.

    Parameters
    ----------
    scan : Scan
    edges : PaperEdges
        Of the scan's cloud.
    reach : float
        How near in x, y an edge pixel or point has to be, mm.

    Examples
    --------
    >>> from edgel import paper, synth
    >>> scan = synth.scan(synth.elbow(), num_points=50_000)
    >>> found = found_lengths(scan, paper.detect(scan.cloud), reach=4.0)
    >>> [(one.kind, one.with_point > 0.9) for one in found]
    [('boundary', True), ('occluding', True)]
    """
    flat = np.array([1.0, 1.0, 0.0])
    rows, columns = np.nonzero(edges.edge_map)
    pixels = np.column_stack([edges.grid.centres(rows, columns), np.zeros(len(rows))])
    points = scan.cloud.xyz[edges.index] * flat
    found = []
    for kind in EDGE_KINDS:
        middles, lengths = _segments(scan.part, kind)
        if len(lengths):
            total = lengths.sum()
            shares = [lengths[_is_near(middles * flat, those, reach)].sum() / total for those in (pixels, points)]
            found.append(FoundLength(kind, float(total), float(shares[0]), float(shares[1])))
    return tuple(found)


def offsets(scan: Scan, edges: PaperEdges) -> Offsets:
    """Measure how far the edge points lie from the nearest true edge as the viewer sees it; NaN if there are none."""
    distance = scan.nearest_seen.distance[edges.index]
    if len(distance) == 0:
        return Offsets(np.nan, np.nan, np.nan)
    median, most, largest = np.percentile(distance, [50, 95, 100])
    return Offsets(float(median), float(most), float(largest))


def _segments(part: Part, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Middles (S, 3) and lengths (S,) of the pieces of all edges of a kind."""
    curves = [edge.points for edge in part.edges if edge.kind == kind]
    middles = [(points[:-1] + points[1:]) / 2 for points in curves]
    lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1) for points in curves]
    return np.concatenate([np.empty((0, 3)), *middles]), np.concatenate([np.empty(0), *lengths])


def _is_near(queries: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    if len(points) == 0:
        return np.zeros(len(queries), bool)
    return knn(build_index(points), queries, 1).distances[:, 0] <= reach
