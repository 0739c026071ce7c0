"""Chains split into lines and arcs, from the bottom up, at a cost a parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel.curves._chains import Chains
from edgel.curves._circle import RADIUS, SHAPE, fit_circle, fit_line

_PIECE = 4  # points of the pieces to begin with
_ALIKE = 2.0  # neighbouring places come from nearly the same points: so many count as one
_BORDER = 3.0  # what a border between pieces costs, in logs of the chain's points
_FAR = 9.0  # variances: a farther point costs no more
_LARGEST = 200.0  # radii, in spacings: a larger arc is told from a line by no chain
_FLOOR = 0.06  # spacings: no chain is smoother
_CLEAR = 4.0  # mean cost of a point, in variances, below which a closed chain is a circle
_FREE = 2.5  # deviations of the root mean square, beyond which neither a line nor an arc is it


@dataclass(frozen=True, eq=False)
class Pieces:
    """Stretches of chains that are lines or arcs, or neither.

    Attributes
    ----------
    start, stop : (K,) int64
        Their rows of `Chains.points`, stop excluded; of a closed chain they may run past its end, and go on at its
        beginning.
    chain : (K,) int64
    shape : (K, 13) float64
        See `_circle.SHAPE`.
    fits : (K,) bool
        Whether the shape is it.
    """

    start: np.ndarray
    stop: np.ndarray
    chain: np.ndarray
    shape: np.ndarray
    fits: np.ndarray

    def __len__(self) -> int:
        return len(self.start)


def split(chains: Chains, position: np.ndarray, spacing: np.ndarray, spread: np.ndarray) -> Pieces:
    """Split chains where a line or an arc each is worth more than the border between them."""
    lengths = np.diff(chains.start)
    room = lengths // _PIECE + 2  # at most so many pieces a chain
    slots = np.concatenate([[0], np.cumsum(room)])
    cuts, shape = np.zeros((slots[-1], 2), np.int64), np.zeros((slots[-1], SHAPE))
    fits, counts = np.zeros(slots[-1], np.bool_), np.zeros(len(chains), np.int64)
    arguments = (
        chains.points,
        chains.start,
        chains.closed,
        position,
        spacing,
        spread,
        slots,
        cuts,
        shape,
        fits,
        counts,
    )
    run_slices(_split_chains, len(chains), *arguments, size=16)
    chain = np.repeat(np.arange(len(chains)), counts)
    rows = np.concatenate([slots[:-1][i] + np.arange(counts[i]) for i in range(len(chains))] or [np.empty(0, np.int64)])
    rows = rows.astype(np.int64)
    return Pieces(cuts[rows, 0], cuts[rows, 1], chain, shape[rows], fits[rows])


@kernel
def _split_chains(start, stop, points, begin, closed, position, spacing, spread, slots, cuts, shape, fits, counts):
    for chain in range(start, stop):
        first, last = begin[chain], begin[chain + 1]
        count = last - first
        rows = points[first:last]
        h = noise = 0.0
        for i in rows:
            h, noise = h + spacing[i], noise + spread[i]
        h, noise = h / count, noise / count
        sigma = max(_FLOOR * h, 0.5 * noise)
        slot = slots[chain]
        shift = 0
        number = _merge(rows, position, h, sigma, cuts[slot:], shape[slot:], closed[chain])
        if closed[chain] and number > 1:  # begin at a border, so that no piece is cut where the walk began
            shift = cuts[slot, 1]
            number = _merge(
                np.concatenate((rows[shift:], rows[:shift])), position, h, sigma, cuts[slot:], shape[slot:], False
            )
        counts[chain] = number
        for k in range(number):
            a, b = cuts[slot + k, 0] + shift, cuts[slot + k, 1] + shift
            cuts[slot + k, 0], cuts[slot + k, 1] = first + a, first + b
            square = 0.0
            for q in range(a, b):
                i = rows[q % count]
                square += _squared(shape[slot + k], position, i)
            fits[slot + k] = square / (b - a) < max(_FREE * sigma, 0.25 * h) ** 2


@routine
def _squared(shape, position, i):
    x, y, z = position[i, 0] - shape[0], position[i, 1] - shape[1], position[i, 2] - shape[2]
    a = x * shape[3] + y * shape[4] + z * shape[5]
    b = x * shape[6] + y * shape[7] + z * shape[8]
    if shape[RADIUS] == 0.0:
        return a * a + b * b
    c = x * shape[9] + y * shape[10] + z * shape[11]
    return (math.sqrt(a * a + b * b) - shape[RADIUS]) ** 2 + c * c


@routine
def _best(rows, position, h, sigma, shape):
    """Write the line or the arc that explains some rows at less cost, and return the cost."""
    penalty = math.log(max(len(rows), 3))
    fit_line(position, rows, shape)
    cost = _cost(rows, position, sigma, shape) + 4.0 * penalty
    if len(rows) >= 6:
        arc = np.empty(SHAPE)
        if fit_circle(position, rows, arc) < math.inf and arc[RADIUS] < _LARGEST * h:
            price = _cost(rows, position, sigma, arc) + 7.0 * penalty
            if price < cost:
                shape[:] = arc
                cost = price
    return cost


@routine
def _cost(rows, position, sigma, shape):
    total = 0.0
    for i in rows:
        total += min(_squared(shape, position, i) / (sigma * sigma), _FAR)
    return total / _ALIKE


@routine
def _merge(rows, position, h, sigma, cuts, shape, closed):
    """Write the pieces of a chain and their shapes, and return how many there are."""
    count = len(rows)
    whole = np.empty(SHAPE)
    pieces = max(count // _PIECE, 1)
    costs, gains, merged = np.empty(pieces), np.full(pieces, -math.inf), np.empty(pieces)
    for k in range(pieces):
        cuts[k, 0], cuts[k, 1] = k * _PIECE, (k + 1) * _PIECE if k < pieces - 1 else count
        costs[k] = _best(rows[cuts[k, 0] : cuts[k, 1]], position, h, sigma, shape[k])
    border = _BORDER * math.log(count)
    if closed:  # one circle round, before its pieces find lines
        cost = _best(rows, position, h, sigma, whole)
        if whole[RADIUS] > 0.0 and cost < _CLEAR * count / _ALIKE:
            cuts[0, 0], cuts[0, 1] = 0, count
            shape[0] = whole
            return 1
    for k in range(pieces - 1):
        merged[k] = _best(rows[cuts[k, 0] : cuts[k + 1, 1]], position, h, sigma, whole)
        gains[k] = costs[k] + costs[k + 1] + border - merged[k]
    while pieces > 1:
        k = np.argmax(gains[: pieces - 1])
        if not gains[k] > 0.0:
            break
        cuts[k, 1], costs[k] = cuts[k + 1, 1], merged[k]
        for j in range(k + 1, pieces - 1):
            cuts[j], costs[j], gains[j - 1], merged[j - 1] = cuts[j + 1], costs[j + 1], gains[j], merged[j]
        pieces -= 1
        for j in (k - 1, k):
            if 0 <= j < pieces - 1:
                merged[j] = _best(rows[cuts[j, 0] : cuts[j + 1, 1]], position, h, sigma, whole)
                gains[j] = costs[j] + costs[j + 1] + border - merged[j]
    for k in range(pieces):
        _best(rows[cuts[k, 0] : cuts[k, 1]], position, h, sigma, shape[k])
    _move_borders(rows, position, h, sigma, pieces, cuts, shape)
    return pieces


@routine
def _move_borders(rows, position, h, sigma, pieces, cuts, shape):
    """Move each border to where the shapes beside it explain most."""
    for k in range(pieces - 1):
        low, high = max(cuts[k, 0] + 2, cuts[k, 1] - 8), min(cuts[k + 1, 1] - 2, cuts[k, 1] + 8)
        best, at, total = math.inf, cuts[k, 1], 0.0
        for q in range(low, high):
            i = rows[q]
            if total < best:
                best, at = total, q
            far = _FAR * sigma * sigma
            total += min(_squared(shape[k], position, i), far) - min(_squared(shape[k + 1], position, i), far)
        if total < best:
            at = high
        if at != cuts[k, 1] and low < high:
            cuts[k, 1] = cuts[k + 1, 0] = at
            for s in (k, k + 1):
                _best(rows[cuts[s, 0] : cuts[s, 1]], position, h, sigma, shape[s])
