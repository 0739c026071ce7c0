"""From edge points to measured shapes: linked, split, measured on their faces, claimed, and measured again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel.curves import _fit
from edgel.curves._chains import Chains, link
from edgel.curves._circle import RADIUS
from edgel.curves._claim import claim
from edgel.curves._extent import ranges_of
from edgel.curves._measure import Measured, measure
from edgel.curves._points import EdgePoints
from edgel.curves._smooth import Smoothed, smooth
from edgel.curves._split import Pieces, split

_ROUGH = 0.15  # spacings: a face is that rough without the cloud being noisy
_ROUGHER = 1.35  # times the noise of the cloud: no plane, cylinder or cone is rougher
_COVERED = 0.2  # of the points that a face of full depth would have
_DEEP = 3.9  # spacings: full depth
_ROUND = 1.5  # spacings: no circle is smaller
_LARGEST = 200.0  # spacings: a larger arc is told from a line by no cloud
_LOOSE = 0.45  # spacings: edge points of a shape with one face scatter less


@dataclass(frozen=True, eq=False)
class Shapes:
    """Lines and circles, and the edge points of each; and runs of edge points that are neither.

    Attributes
    ----------
    measured : Measured
    spacing : (K,) float64
    rows : (R,) int64, (K + 1,) int64
        Edge points of each shape, and where each begins.
    ranges : (K, 2) float64
        From where to where along it they lie.
    runs : list of (P,) int64
        Edge points in order.
    run_closed : list of bool
    smoothed : Smoothed
    """

    measured: Measured
    spacing: np.ndarray
    rows: tuple[np.ndarray, np.ndarray]
    ranges: np.ndarray
    runs: list[np.ndarray]
    run_closed: list[bool]
    smoothed: Smoothed


def find_shapes(xyz: np.ndarray, points: EdgePoints) -> Shapes:
    """Find the lines and circles of edge points, measured on the points (N, 3) of the faces beside them."""
    smoothed = smooth(points.position, points.direction, points.spacing)
    chains = link(smoothed, points.spacing, points.kind)
    pieces = split(chains, smoothed.position, points.spacing, smoothed.spread)
    paths = _paths(chains, pieces)
    index = points.index
    edge = (points.position, points.normals)
    spacing = _mean_of(points.spacing, paths)
    first = measure(index, xyz, pieces.shape, paths, ranges_of(pieces.shape, paths, smoothed.position), edge, spacing)
    good = accepted(first, ranges_of(first.shape, paths, smoothed.position), spacing)
    owner = np.full(len(points), -1)
    order = _surest_first(first, good, paths)
    claim(first.shape, order, paths, smoothed, points.spacing, owner)
    alive = np.flatnonzero(np.bincount(owner[owner >= 0], minlength=len(pieces)) >= 3)
    owned = _rows_of(owner, alive, len(pieces))
    # Again, on all that each has now, and from a place that is right.
    spacing = _mean_of(points.spacing, owned)
    shapes = first.shape[alive]
    second = measure(index, xyz, shapes, owned, ranges_of(shapes, owned, smoothed.position), edge, spacing)
    ranges = ranges_of(second.shape, owned, smoothed.position)
    good = accepted(second, ranges, spacing)
    runs, closed = _left(chains, pieces, paths, np.isin(owner, alive[good]), points)
    kept = np.flatnonzero(good)
    return Shapes(
        _take(second, kept), spacing[kept], _take_rows(owned, kept), ranges[kept], runs, closed, smoothed
    )


def accepted(measured: Measured, ranges: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Tell which shapes (K,) their faces confirm: smooth ones, along all of it, as lines and circles have."""
    fit, radius = measured.fit, measured.shape[:, RADIUS]
    state = fit[:, _fit.STATE]
    counts, sigma = fit[:, _fit.COUNTS : _fit.COUNTS + 2], fit[:, _fit.SIGMA : _fit.SIGMA + 2]
    both = state == _fit.MEASURED
    noise = float(np.median(sigma[both] / spacing[both, None])) if both.any() else 0.0
    with np.errstate(invalid="ignore"):
        rough = sigma / spacing[:, None] > np.maximum(_ROUGH, _ROUGHER * noise)
        length = np.maximum((ranges[:, 1] - ranges[:, 0]) / spacing, 2.0)
        enough = counts.min(axis=1) > _COVERED * _DEEP * length
        turn = np.abs(_cross(fit))
    plausible = (radius == 0) | ((radius > _ROUND * spacing) & (radius < _LARGEST * spacing))
    measured_well = both & ~rough.any(axis=1) & enough & (turn > 0.15)
    alone = (state == _fit.EDGE_ALONE) & (np.nanmax(np.nan_to_num(sigma), axis=1) < np.maximum(_LOOSE, 1.5 * noise) * spacing)
    return plausible & (measured_well | alone)


def _cross(fit: np.ndarray) -> np.ndarray:
    a, b, c, d = fit[:, _fit.NORMALS : _fit.NORMALS + 4].T
    return a * d - b * c


def _surest_first(measured: Measured, good: np.ndarray, rows: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the shapes that are good, those with most edge points and both faces first."""
    number = np.diff(rows[1])
    both = measured.fit[:, _fit.STATE] == _fit.MEASURED
    order = np.lexsort((*measured.shape[:, :3].T, -number, ~both))
    return order[good[order]]


def _paths(chains: Chains, pieces: Pieces) -> tuple[np.ndarray, np.ndarray]:
    """Return the edge points of all pieces, and where each begins."""
    number = pieces.stop - pieces.start
    begin = np.concatenate([[0], np.cumsum(number)])
    piece = np.repeat(np.arange(len(pieces)), number)
    first = chains.start[pieces.chain][piece]
    length = np.diff(chains.start)[pieces.chain][piece]
    at = pieces.start[piece] + np.arange(begin[-1]) - begin[piece]
    return chains.points[first + (at - first) % length], begin


def _rows_of(owner: np.ndarray, alive: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the edge points of those shapes that are alive, and where each begins."""
    order = np.argsort(owner, kind="stable")
    order = order[owner[order] >= 0]
    start = np.concatenate([[0], np.cumsum(np.bincount(owner[order], minlength=count))])
    return _take_rows((order, start), alive)


def _take_rows(rows: tuple[np.ndarray, np.ndarray], kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values, start = rows
    number = np.diff(start)[kept]
    begin = np.concatenate([[0], np.cumsum(number)])
    at = np.repeat(start[kept] - begin[:-1], number) + np.arange(begin[-1])
    return values[at], begin


def _take(measured: Measured, kept: np.ndarray) -> Measured:
    points, start = _take_rows((measured.beside.points, measured.beside.start), kept)
    beside = type(measured.beside)(points, start)
    return Measured(measured.shape[kept], measured.fit[kept], measured.covariance[kept], beside)


def _mean_of(values: np.ndarray, rows: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    if not len(rows[0]):
        return np.empty(len(rows[1]) - 1)
    return np.add.reduceat(values[rows[0]], rows[1][:-1]) / np.diff(rows[1])


def _left(
    chains: Chains, pieces: Pieces, paths: tuple[np.ndarray, np.ndarray], taken: np.ndarray, points: EdgePoints
) -> tuple[list[np.ndarray], list[bool]]:
    """Return the runs of edge points along chains that no shape has taken, gaps of three and fewer bridged."""
    runs, closed = [], []
    for chain in range(len(chains)):
        rows = chains.points[chains.start[chain] : chains.start[chain + 1]]
        free = ~taken[rows]
        if not free.any():
            continue
        if free.all():
            runs.append(rows)
            closed.append(bool(chains.closed[chain]))
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(np.int8)))
        for begin, stop in edges.reshape(-1, 2):
            if stop - begin >= 3:
                runs.append(rows[begin:stop])
                closed.append(False)
    return runs, closed
