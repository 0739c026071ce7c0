"""From where to where along shapes their edge points lie."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel.curves._circle import RADIUS, along_of


def ranges_of(shapes: np.ndarray, owned: tuple[np.ndarray, np.ndarray], position: np.ndarray) -> np.ndarray:
    """Return from where to where (K, 2) along shapes (K, 13) their edge points lie; past pi r where an arc does."""
    ranges = np.zeros((len(shapes), 2))
    run_slices(_ranges, len(shapes), shapes, *owned, position, ranges, size=64)
    return ranges


@kernel
def _ranges(start, stop, shapes, rows, first, position, ranges):
    for k in range(start, stop):
        own = rows[first[k] : first[k + 1]]
        if len(own) == 0:
            continue
        along = np.empty(len(own))
        low, high = np.inf, -np.inf
        for q in range(len(own)):
            along[q] = along_of(shapes[k], position[own[q], 0], position[own[q], 1], position[own[q], 2])
            low, high = min(low, along[q]), max(high, along[q])
        around = 2.0 * np.pi * shapes[k, RADIUS]
        if around > 0.0:  # an arc begins behind the largest gap
            _sort(along)
            gap = low + around - high
            for q in range(len(along) - 1):
                if along[q + 1] - along[q] > gap:
                    gap = along[q + 1] - along[q]
                    low, high = along[q + 1], along[q] + around
        ranges[k, 0], ranges[k, 1] = low, high


@routine
def _sort(values):
    """Sort in place (Shell 1959): a third of what Numba's own sort takes to compile."""
    step = len(values) // 2
    while step > 0:
        for i in range(step, len(values)):
            value, at = values[i], i
            while at >= step and values[at - step] > value:
                values[at] = values[at - step]
                at -= step
            values[at] = value
        step = step * 5 // 11 if step > 2 else step - 1
