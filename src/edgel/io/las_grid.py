"""The grid of integers on which LAS keeps coordinates: steps of a scale, counted from an offset."""

from __future__ import annotations

from decimal import Decimal

import numpy as np

_MAX_INT32 = 2**31 - 1
_MOST_DECIMALS = 12


def on_grid(column: np.ndarray, scale: float, offset: float) -> bool:
    """Whether coordinates (N,) are what the grid holds, but for the rounding of doubles."""
    with np.errstate(all="ignore"):
        steps = (column - offset) / scale
        tolerance = 1e-9 + np.finfo(float).eps * 8 * np.abs(column).max() / abs(scale)
        off = np.abs(steps - np.rint(steps)).max()
        return bool(np.abs(steps).max() <= _MAX_INT32 and tolerance < 0.5 and off <= tolerance)


def _finest(low: float, high: float) -> tuple[float, float]:
    """Return the smallest power of ten that reaches `high` in 31 bits, and the round offset that it counts from."""
    extent = max(high - low, np.finfo(float).eps * max(abs(low), abs(high)), 1e-12)
    unit = 10.0 ** np.ceil(np.log10(extent))
    offset = float(np.floor(low / unit) * unit)
    exponent = int(np.ceil(np.log10(max(high - offset, extent) / _MAX_INT32)))
    # Below the spacing of doubles at these coordinates there is nothing to keep.
    exponent = max(exponent, int(np.floor(np.log10(max(np.spacing(max(abs(low), abs(high))), 1e-300)))))
    return float(f"1e{exponent}"), offset


def choose_grid(
    xyz: np.ndarray, scales: np.ndarray, offsets: np.ndarray, *, new: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return scales and offsets (3,): those given where all points lie on their grid, else the finest that fits."""
    scales, offsets = np.array(scales, float), np.array(offsets, float)
    for axis in range(3 if len(xyz) else 0):
        column = xyz[:, axis]
        if new or not on_grid(column, scales[axis], offsets[axis]):
            scales[axis], offsets[axis] = _finest(float(column.min()), float(column.max()))
    return scales, offsets


def decimals_of(scale: float, offset: float) -> int | None:
    """Return how many decimals every number of a grid has, None where they are too many to be meant.

    Examples
    --------
    >>> decimals_of(0.01, 500000.0), decimals_of(0.00025, 0.0), decimals_of(1 / 3, 0.0)
    (2, 5, None)
    """
    exponents = (Decimal(repr(number)).normalize().as_tuple().exponent for number in (scale, offset))
    number = max(0, *(-exponent for exponent in exponents if isinstance(exponent, int)))
    return number if number <= _MOST_DECIMALS else None
