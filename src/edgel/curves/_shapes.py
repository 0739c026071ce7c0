"""From edge points to measured shapes: linked, split, measured on their faces, claimed, and measured again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel.curves._chains import Chains, link
from edgel.curves._circle import RADIUS
from edgel.curves._claim import claim
from edgel.curves._grow import grow
from edgel.curves._measure import Measured, circles_through, mean_of, measure, nearly_straight, noise_of
from edgel.curves._points import EdgePoints
from edgel.curves._rounds import with_rounds
from edgel.curves._rows import rows_of, rows_of_runs, take_rows
from edgel.curves._smooth import Smoothed, smooth
from edgel.curves._split import Pieces, split
from edgel.curves._straight import straighten

_NOISY = 0.15  # spacings, of points about faces
_OPEN = 1.5 * np.pi  # radians: an arc that goes round by more is as good as a circle


@dataclass(frozen=True, eq=False)
class Shapes:
    """Lines and circles, and the edge points of each; and runs of edge points that are neither.

    Attributes
    ----------
    measured : Measured
    spacing : (K,) float64
    rows : (R,) int64, (K + 1,) int64
        Edge points of each shape, and where each begins.
    runs : list of (P,) int64
        Edge points in order.
    run_closed : list of bool
    smoothed : Smoothed
    """

    measured: Measured
    spacing: np.ndarray
    rows: tuple[np.ndarray, np.ndarray]
    runs: list[np.ndarray]
    run_closed: list[bool]
    smoothed: Smoothed


def find_shapes(points: EdgePoints) -> Shapes:
    """Find the lines and circles of edge points, measured on the faces beside them."""
    smoothed = smooth(points.position, points.direction, points.spacing)
    chains = link(smoothed, points.spacing, points.kind)
    pieces = split(chains, smoothed.position, points.spacing, smoothed.spread)
    paths = _paths(chains, pieces)
    spacing = mean_of(points.spacing, paths)
    first = measure(points.index, pieces.shape, paths, points, smoothed.position, spacing)
    if noise_of(first, spacing) > _NOISY:
        first, paths, spacing = _with_bends(first, paths, pieces.chain, points, smoothed.position)
    first = grow(first, paths, points, smoothed.position, spacing)
    alive, owned, owner = _claimed(first, paths, spacing, smoothed, points)
    noise = noise_of(first, spacing)
    begun, owned, is_round = with_rounds(first.take(alive), owned, owner, points, smoothed.position, noise)
    # Again, on all that each has now, and from a place that is right.
    spacing = mean_of(points.spacing, owned)
    second = measure(points.index, begun.shape, owned, points, smoothed.position, spacing)
    lost = np.flatnonzero(_lost_arcs(begun, second, is_round, noise))
    second.put(lost, begun, lost)
    second = grow(second, owned, points, smoothed.position, spacing)
    kept, owned, owner = _claimed(second, owned, spacing, smoothed, points, is_round)
    second, spacing = second.take(kept), spacing[kept]
    runs, _ = _left(chains, owner >= 0)
    rough, apart, theirs = straighten(runs, points, smoothed, owner)
    owner[theirs[0]] = len(second.holds)
    runs, closed = _left(chains, owner >= 0)
    every = np.concatenate([owned[0], theirs[0]]), np.concatenate([owned[1], owned[1][-1] + theirs[1][1:]])
    return Shapes(second.and_(rough), np.concatenate([spacing, apart]), every, runs, closed, smoothed)


def _claimed(
    measured: Measured,
    rows: tuple[np.ndarray, np.ndarray],
    spacing: np.ndarray,
    smoothed: Smoothed,
    points: EdgePoints,
    is_round: np.ndarray | None = None,
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return which shapes have edge points left, these points, and which of those shapes has each (E,); -1 for none."""
    owner = np.full(len(points), -1)
    order = _surest_first(measured, spacing)
    if is_round is not None:  # lines that meet at a rounded corner would share its arc
        order = order[np.argsort(~is_round[order], kind="stable")]
    claim(measured.shape, order, measured.both, rows, smoothed, points.spacing, owner)
    alive = np.flatnonzero(np.bincount(owner[owner >= 0], minlength=len(spacing)) >= 3)
    number = np.full(len(spacing) + 1, -1)
    number[alive] = np.arange(len(alive))
    return alive, rows_of(owner, alive, len(spacing)), number[owner]


def _lost_arcs(first: Measured, second: Measured, is_round: np.ndarray, noise: float) -> np.ndarray:
    """Tell which arcs were sure, and are not on what they have now: points of other curves are among it."""
    arc = first.shape[:, RADIUS] > 0
    open_ = first.ranges[:, 1] - first.ranges[:, 0] < _OPEN * first.shape[:, RADIUS]
    sure = first.both & arc & open_ & ~second.holds & (noise <= _NOISY)
    return sure | is_round & ~(second.holds & (second.shape[:, RADIUS] > 0))


def _with_bends(
    measured: Measured,
    rows: tuple[np.ndarray, np.ndarray],
    chain: np.ndarray,
    points: EdgePoints,
    position: np.ndarray,
) -> tuple[Measured, tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Add the arcs through two and three pieces of a chain that follow each other, where faces confirm them.

    Under noise pieces are cut where there is no border, and a short piece of a wide arc passes for a line.
    """
    runs = [rows[0][rows[1][k] : rows[1][k + number]] for number in (2, 3) for k in _following(chain, number)]
    longer = rows_of_runs(runs)
    spacing = mean_of(points.spacing, longer)
    bends = measure(points.index, circles_through(longer, position), longer, points, position, spacing)
    kept = np.flatnonzero(bends.both & (bends.shape[:, RADIUS] > 0) & ~nearly_straight(bends, spacing))
    more = take_rows(longer, kept)
    every = np.concatenate([rows[0], more[0]]), np.concatenate([rows[1], rows[1][-1] + more[1][1:]])
    return measured.and_(bends.take(kept)), every, mean_of(points.spacing, every)


def _following(chain: np.ndarray, number: int) -> list[int]:
    """Return the first of each so many pieces in a row that are of one chain."""
    return np.flatnonzero(chain[: len(chain) - number + 1] == chain[number - 1 :]).tolist()


def _surest_first(measured: Measured, spacing: np.ndarray) -> np.ndarray:
    """Return the shapes that are good, the longest of those with both faces first."""
    length = (measured.ranges[:, 1] - measured.ranges[:, 0]) / spacing
    order = np.lexsort((*measured.shape[:, :3].T, -length, ~measured.both))
    return order[measured.holds[order]]


def _paths(chains: Chains, pieces: Pieces) -> tuple[np.ndarray, np.ndarray]:
    """Return the edge points of all pieces, and where each begins."""
    number = pieces.stop - pieces.start
    begin = np.concatenate([[0], np.cumsum(number)])
    piece = np.repeat(np.arange(len(pieces)), number)
    first = chains.start[pieces.chain][piece]
    length = np.diff(chains.start)[pieces.chain][piece]
    at = pieces.start[piece] + np.arange(begin[-1]) - begin[piece]
    return chains.points[first + (at - first) % length], begin


def _left(chains: Chains, taken: np.ndarray) -> tuple[list[np.ndarray], list[bool]]:
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
