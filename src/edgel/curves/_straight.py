"""Rough lines: edge points that scatter about a line which no two faces confirm, as eaves of airborne scans."""

from __future__ import annotations

import numpy as np

from edgel.curves import _fit
from edgel.curves._chains import Chains
from edgel.curves._circle import RADIUS
from edgel.curves._claim import claim
from edgel.curves._measure import Measured, lines_through, mean_of
from edgel.curves._points import EdgePoints
from edgel.curves._ranges import ranges_of
from edgel.curves._rows import rows_of_runs, take_rows
from edgel.curves._smooth import Smoothed
from edgel.curves._split import split

_ROUGH = 0.08  # spacings: edge points that scatter less show their curve as it is, straight or not
_LONG, _POINTS = 3.0, 4
"""Spacings, and edge points, of a line at least."""
_STRENGTH, _STRONGEST = 0.38, 0.5
"""Mean and largest strength of edge points that no face confirms."""
_CORRELATED = 2.0  # neighbouring edge points come from nearly the same points: so many count as one


def straighten(
    runs: list[np.ndarray], points: EdgePoints, smoothed: Smoothed, owner: np.ndarray
) -> tuple[Measured, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Return the lines that rough runs of edge points follow, the spacing there and the edge points of each.

    A smoothed run winds where its points scatter, since neighbours are moved alike. So lines are fitted to the points
    as they were found, those beside the run too. `owner` (E,) tells what has taken edge points, -1 for nothing.
    """
    chains = Chains(*rows_of_runs(runs), np.zeros(len(runs), np.bool_))
    # A split takes half the spread; points as they were found scatter by all of it, and by more where few take part.
    pieces = split(chains, points.position, points.spacing, 3 * smoothed.spread)
    number = pieces.stop - pieces.start
    chosen = np.flatnonzero((pieces.shape[:, RADIUS] == 0) & pieces.fits & (number >= _POINTS))
    rows = take_rows((chains.points, np.append(pieces.start, len(chains.points))), chosen)
    rough = mean_of(smoothed.spread / points.spacing, rows) > _ROUGH
    rows, shape = take_rows(rows, np.flatnonzero(rough)), pieces.shape[chosen[rough]]
    length = np.diff(ranges_of(shape, rows, points.position))[:, 0] / mean_of(points.spacing, rows)
    order = np.lexsort((*shape[:, :3].T, -length))
    taken = np.where(owner >= 0, len(shape), -1)
    claim(shape, order[length[order] > _LONG], np.zeros(len(shape), np.bool_), rows, smoothed, points.spacing, taken)
    mine = np.flatnonzero((taken >= 0) & (taken < len(shape)))
    mine = mine[np.argsort(taken[mine], kind="stable")]
    counts = np.bincount(taken[mine], minlength=len(shape))
    rows = take_rows((mine, np.concatenate([[0], np.cumsum(counts)])), np.flatnonzero(counts >= _POINTS))
    rows = take_rows(rows, np.flatnonzero(are_strong(rows, points.strength)))
    lines = lines_through(rows, points.position)
    return _as_measured(lines, rows, points.position), mean_of(points.spacing, rows), rows


def are_strong(rows: tuple[np.ndarray, np.ndarray], strength: np.ndarray) -> np.ndarray:
    """Tell which sets of edge points (K,), given as rows and where each begins, are strong enough without faces."""
    largest = np.maximum.reduceat(strength[rows[0]], rows[1][:-1]) if len(rows[0]) else np.empty(0)
    return (mean_of(strength, rows) > _STRENGTH) & (largest >= _STRONGEST)


def _as_measured(lines: np.ndarray, rows: tuple[np.ndarray, np.ndarray], position: np.ndarray) -> Measured:
    """Return lines through edge points alone: across them they are as sure as the mean of so many."""
    count, number = len(lines), np.diff(rows[1]) / _CORRELATED
    of = np.repeat(np.arange(count), np.diff(rows[1]))
    offset = position[rows[0]] - lines[of, :3]
    along = np.einsum("ij,ij->i", offset, lines[of, 9:12])
    square = np.bincount(of, (offset**2).sum(axis=1) - along**2, count) / np.diff(rows[1])
    fit = np.full((count, _fit.FIT), np.nan)
    fit[:, _fit.STATE] = _fit.EDGE_ALONE
    fit[:, _fit.NORMALS : _fit.NORMALS + 4] = 0.0  # no face: both planes of an end lie across the line
    fit[:, _fit.INWARD : _fit.INWARD + 4] = 1.0, 0.0, 0.0, 1.0
    sigma = np.sqrt(np.maximum(square, 0.0))
    fit[:, _fit.OFFSETS] = fit[:, _fit.OFFSETS + 1] = sigma / np.sqrt(2 * number)
    fit[:, _fit.POSITION_STD] = sigma / np.sqrt(number)
    spread = np.sqrt(np.bincount(of, along**2, count) / np.diff(rows[1]))
    fit[:, _fit.TURN_STD] = fit[:, _fit.POSITION_STD] / spread
    ranges = ranges_of(lines, rows, position)
    covariance = np.zeros((count, _fit.UNKNOWNS, _fit.UNKNOWNS))
    return Measured(lines, fit, covariance, ranges, np.ones(count, bool))
