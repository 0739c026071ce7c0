"""Rows of several things, one after the other, and where each thing's begin."""

from __future__ import annotations

import numpy as np


def take_rows(rows: tuple[np.ndarray, np.ndarray], kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of some of several things, given as rows and where each thing's begin, in the same way."""
    values, start = rows
    number = np.diff(start)[kept]
    begin = np.concatenate([[0], np.cumsum(number)])
    at = np.repeat(start[kept] - begin[:-1], number) + np.arange(begin[-1])
    return values[at], begin


def rows_of(owner: np.ndarray, alive: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows that some of so many things own, in the same way, given the owner of each row; -1 for none."""
    order = np.argsort(owner, kind="stable")
    order = order[owner[order] >= 0]
    start = np.concatenate([[0], np.cumsum(np.bincount(owner[order], minlength=count))])
    return take_rows((order, start), alive)


def rows_of_runs(runs: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of all runs, and where each begins."""
    start = np.concatenate([[0], np.cumsum([len(run) for run in runs])]).astype(np.int64)
    return np.concatenate([np.empty(0, np.int64), *runs]), start
