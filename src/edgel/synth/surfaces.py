"""Surfaces that a part is made of, each of which answers vertical rays in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, cos, floor, hypot, pi, sin
from typing import Protocol

import numpy as np


class Surface(Protocol):
    """What a part needs to know of each of its surfaces."""

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest x, y of the surface seen from above, (2, 2), mm."""
        ...

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Greatest z of the surface at x, y (both (N,), mm); NaN where the vertical ray misses it."""
        ...

    def normals(self, xyz: np.ndarray) -> np.ndarray:
        """Outward unit normals (N, 3) at points (N, 3) of the surface."""
        ...


@dataclass(frozen=True)
class Pipe:
    """The outside of a straight pipe whose axis lies in the plane z = 0; open at both ends.

    Parameters
    ----------
    start, end : (float, float)
        x, y of the two ends of the axis, mm.
    radius : float
        Outside radius, mm.

    Raises
    ------
    ValueError
        If the radius is not above 0, or the ends coincide.

    Examples
    --------
    >>> import numpy as np
    >>> Pipe((0.0, 0.0), (10.0, 0.0), 5.0).height(np.array([5.0, 5.0, 11.0]), np.array([0.0, 3.0, 0.0]))
    array([ 5.,  4., nan])
    """

    start: tuple[float, float]
    end: tuple[float, float]
    radius: float

    def __post_init__(self) -> None:
        if not self.radius > 0:
            raise ValueError(f"radius: expected a length above 0, got {self.radius}")
        if self.start == self.end:
            raise ValueError(f"end: expected a point other than start, got {self.end} for both")

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest x, y of the surface seen from above, (2, 2), mm."""
        ax, ay, _ = self._axis
        ends, margin = np.array([self.start, self.end]), self.radius * np.abs([ay, ax])
        return np.array([ends.min(axis=0) - margin, ends.max(axis=0) + margin])

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Greatest z of the surface at x, y (both (N,), mm); NaN where the vertical ray misses it."""
        ax, ay, length = self._axis
        dx, dy = x - self.start[0], y - self.start[1]
        along, across = ax * dx + ay * dy, ax * dy - ay * dx
        z = _half_circle(across, self.radius)
        z[(along < 0) | (along > length)] = np.nan
        return z

    def normals(self, xyz: np.ndarray) -> np.ndarray:
        """Outward unit normals (N, 3) at points (N, 3) of the surface."""
        ax, ay, _ = self._axis
        across = ax * (xyz[:, 1] - self.start[1]) - ay * (xyz[:, 0] - self.start[0])
        return np.column_stack([-ay * across, ax * across, xyz[:, 2]]) / self.radius

    @property
    def _axis(self) -> tuple[float, float, float]:
        dx, dy = self.end[0] - self.start[0], self.end[1] - self.start[1]
        length = hypot(dx, dy)
        return dx / length, dy / length, length


@dataclass(frozen=True)
class Bend:
    """The outside of a bent pipe, a piece of a torus whose axis circle lies in the plane z = 0; open at both ends.

    Parameters
    ----------
    centre : (float, float)
        x, y of the centre of the bend, mm.
    bend_radius : float
        Radius of the axis circle, mm; larger than `radius`.
    radius : float
        Outside radius of the pipe, mm.
    start, sweep : float
        Angle from the x axis where the bend begins, and how far it goes on counter-clockwise (at most pi), radians.

    Raises
    ------
    ValueError
        If the bend is tighter than the pipe is thick, or `sweep` is not within 0 to pi.

    Examples
    --------
    >>> import numpy as np
    >>> bend = Bend((0.0, 0.0), 20.0, 5.0, 0.0, np.pi / 2)
    >>> bend.height(np.array([20.0, 0.0, 20.0]), np.array([0.0, 23.0, -1.0]))
    array([ 5.,  4., nan])
    """

    centre: tuple[float, float]
    bend_radius: float
    radius: float
    start: float
    sweep: float

    def __post_init__(self) -> None:
        if not 0 < self.radius < self.bend_radius:
            raise ValueError(f"radius: expected a length between 0 and the bend radius, got {self.radius}")
        if not 0 < self.sweep <= pi:
            raise ValueError(f"sweep: expected an angle above 0 and at most pi, got {self.sweep}")

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest x, y of the surface seen from above, (2, 2), mm."""
        stop = self.start + self.sweep
        quarters = np.arange(ceil(self.start / (pi / 2)), floor(stop / (pi / 2)) + 1) * (pi / 2)
        turns = np.array([_direction(angle) for angle in (self.start, stop, *quarters)])
        corners = np.concatenate([turns * (self.bend_radius - self.radius), turns * (self.bend_radius + self.radius)])
        return np.array([corners.min(axis=0), corners.max(axis=0)]) + self.centre

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Greatest z of the surface at x, y (both (N,), mm); NaN where the vertical ray misses it."""
        dx, dy = x - self.centre[0], y - self.centre[1]
        z = _half_circle(np.hypot(dx, dy) - self.bend_radius, self.radius)
        # Signed distances to the two end planes: an angle would jump somewhere.
        (start_x, start_y), (stop_x, stop_y) = _direction(self.start), _direction(self.start + self.sweep)
        first, last = start_x * dy - start_y * dx, stop_y * dx - stop_x * dy
        z[(first < 0) | (last < 0)] = np.nan
        return z

    def normals(self, xyz: np.ndarray) -> np.ndarray:
        """Outward unit normals (N, 3) at points (N, 3) of the surface."""
        offset = xyz[:, :2] - self.centre
        distance = np.hypot(offset[:, 0], offset[:, 1])
        outward = (distance - self.bend_radius) / distance
        return np.column_stack([offset * outward[:, None], xyz[:, 2]]) / self.radius


def _half_circle(across: np.ndarray, radius: float) -> np.ndarray:
    """Height above the axis at a distance from it; NaN outside."""
    square = radius * radius - across * across
    return np.sqrt(np.where(square < 0, np.nan, square))


def _direction(angle: float) -> tuple[float, float]:
    """Cosine and sine, exactly 0 where they should be."""
    return round(cos(angle), 15), round(sin(angle), 15)
