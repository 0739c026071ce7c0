"""A hash grid in which each cell lists everything within reach of it: one look answers "what is near here?"."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from edgel._kernels.parallel import kernel

_OFFSETS = np.array(list(itertools.product((-1, 0, 1), repeat=3)))
_MIX = np.array([73856093, 19349663, 83492791])  # Teschner et al. 2003; places that share a key are told apart later
_STEP = 0x9E3779B1  # odd, for the table


class Grid(NamedTuple):
    """What lies near each cell, as kernels take it; made by `build_grid`.

    Attributes
    ----------
    keys : (T,) int64
        Open addressing; -1 where a slot is free.
    first : (T,) int64
        Where the list of a slot begins in `members`.
    last : (T,) int64
        And where it ends.
    members : (L,) int64
        Rows of the places.
    cell : float
        Side of a cell, in the cloud's unit: the reach.
    """

    keys: np.ndarray
    first: np.ndarray
    last: np.ndarray
    members: np.ndarray
    cell: float


def build_grid(places: np.ndarray, reach: float) -> Grid:
    """List the places (M, 3) within reach of each cell, in the order of their rows.

    Examples
    --------
    >>> import numpy as np
    >>> grid = build_grid(np.array([[0.0, 0, 0], [1.5, 0, 0], [9.0, 0, 0]]), 1.0)
    >>> slot = find_cell(grid, 0.4, 0.0, 0.0)
    >>> grid.members[grid.first[slot] : grid.last[slot]].tolist()
    [0, 1]
    """
    cell = np.floor(places / reach).astype(np.int64)
    within = places - cell * reach
    keys, rows = [], []
    for offset in _OFFSETS:
        away = np.where(offset > 0, reach - within, np.where(offset < 0, within, 0.0))
        near = np.flatnonzero((away**2).sum(axis=1) <= reach**2)
        keys.append(_key(cell[near] + offset))
        rows.append(near)
    key, row = np.concatenate(keys), np.concatenate(rows)
    order = np.lexsort((row, key))
    key, row = key[order], row[order]
    once = (np.diff(key, prepend=-1) != 0) | (np.diff(row, prepend=-1) != 0)  # cells of one key may share a place
    key, row = key[once], row[once]
    start = np.flatnonzero(np.diff(key, prepend=-1))
    size = 1 << max(int(4 * len(start)).bit_length(), 4)
    table = (np.full(size, -1), np.zeros(size, np.int64), np.zeros(size, np.int64))
    _fill(key[start], start, np.append(start[1:], len(key)), *table)
    return Grid(*table, row, float(reach))


def _key(cell: np.ndarray) -> np.ndarray:
    return np.bitwise_xor.reduce(cell * _MIX, axis=1) & np.int64(0x7FFFFFFFFFFFFFFF)


@kernel
def _fill(key, start, stop, keys, first, last):
    """Put keys (C,) into the table, with where their lists begin and end."""
    mask = len(keys) - 1
    for c in range(len(key)):
        slot = (key[c] * _STEP >> 8) & mask
        while keys[slot] != -1:
            slot = (slot + 1) & mask
        keys[slot], first[slot], last[slot] = key[c], start[c], stop[c]


@kernel
def find_cell(grid, x, y, z):
    """Return the slot of the cell at a place; its list is empty if nothing is near."""
    i, j, k = int(np.floor(x / grid.cell)), int(np.floor(y / grid.cell)), int(np.floor(z / grid.cell))
    key = ((i * 73856093) ^ (j * 19349663) ^ (k * 83492791)) & 0x7FFFFFFFFFFFFFFF
    mask = len(grid.keys) - 1
    slot = (key * _STEP >> 8) & mask
    while grid.keys[slot] != -1 and grid.keys[slot] != key:
        slot = (slot + 1) & mask
    return slot
