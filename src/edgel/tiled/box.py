"""Boxes in plan: of any height, bounded in x and y."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Box:
    """A box in plan, its lower sides its own and its upper sides not: ``low <= x < high``.

    Attributes
    ----------
    low, high : tuple of float
        Two each.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]

    @staticmethod
    def around(xyz: np.ndarray) -> Box:
        """Return the smallest box that holds some points (N, 3), N > 0."""
        low, high = xyz[:, :2].min(axis=0), np.nextafter(xyz[:, :2].max(axis=0), np.inf)
        return Box(tuple(low.tolist()), tuple(high.tolist()))

    def touches(self, low: Any, high: Any) -> Any:
        """Whether something between two corners (..., 2), both its own, may have a point in the box."""
        return (np.asarray(high) >= self.low).all(axis=-1) & (np.asarray(low) < self.high).all(axis=-1)

    def holds(self, xyz: np.ndarray) -> np.ndarray:
        """Whether each point (N, 3) lies in the box, (N,) bool."""
        inside: np.ndarray = (xyz[:, :2] >= self.low) & (xyz[:, :2] < self.high)
        return np.asarray(inside.all(axis=1))

    def grown(self, halo: float, step: float) -> Box:
        """Return the box with a halo around it, its sides moved outwards to multiples of a step."""
        low = np.floor((np.array(self.low) - halo) / step) * step
        high = np.ceil((np.array(self.high) + halo) / step) * step
        return Box(tuple(low.tolist()), tuple(high.tolist()))

    def without_end(self, low: Any, high: Any) -> Box:
        """Return the box with those sides moved to infinity beyond which a cloud with these corners has no points."""
        return Box(
            tuple(-np.inf if mine <= least else mine for mine, least in zip(self.low, low, strict=True)),
            tuple(np.inf if mine > most else mine for mine, most in zip(self.high, high, strict=True)),
        )

    @property
    def endless(self) -> bool:
        """Whether the box holds everything."""
        return not np.isfinite([*self.low, *self.high]).any()

    def depth(self, xyz: np.ndarray) -> np.ndarray:
        """Return how far inside each point (N, 3) lies, (N,) float64."""
        return np.minimum(xyz[:, :2] - self.low, self.high - xyz[:, :2]).min(axis=1)
