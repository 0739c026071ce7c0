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
