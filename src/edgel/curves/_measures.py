"""What people ask curves for: lengths, diameters, angles and distances, with how sure they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel.curves._curves import CurveKind, Curves
from edgel.edges import EdgeKind

COLUMNS = (
    "name", "kind", "edge", "length", "length_std", "diameter", "diameter_std", "radius", "radius_std", "angle",
    "angle_std", "convex", "position_std", "x", "y", "z", "dx", "dy", "dz", "loop", "hole", "measured",
)  # fmt: skip
"""Of `measures`; lengths in the cloud's unit, angles in degrees."""

_PARALLEL = np.radians(3.0)


@dataclass(frozen=True, eq=False)
class Parallels:
    """Pairs of parallel lines that lie side by side.

    Attributes
    ----------
    curves : (P, 2) int64
        Which lines, the lower number first.
    distance, distance_std : (P,) float64
        Between them, half way along what they have in common; in the cloud's unit.
    """

    curves: np.ndarray
    distance: np.ndarray
    distance_std: np.ndarray


def measures(curves: Curves) -> dict[str, np.ndarray]:
    """Return a table of what is known of each curve, a column an array.

    ``name`` (``line 3``), ``kind``, ``edge``, ``length``, ``diameter``, ``radius``, ``angle`` (degrees, 0 where the
    surface is smooth) with their standard deviations, ``x y z`` (a line's middle, a circle's centre), ``dx dy dz`` (a
    line's direction, a circle's axis), ``loop`` and whether that is a ``hole``; NaN where something has no meaning.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    >>> lines = edgel.curves.trace(roof, edgel.detect(roof, kinds="crease"))
    >>> edgel.curves.measures(lines)["angle"].round(1).tolist()
    [90.0]
    """
    middle = np.array([_middle_of(curves, k) for k in range(len(curves))]).reshape(-1, 3)
    place = np.where(np.isfinite(curves.centre), curves.centre, middle)
    holes = np.append(curves.is_hole, False)[curves.loop]
    values = (
        names(curves),
        np.array([CurveKind(k).name.lower() for k in curves.kind], str),
        np.array([str(EdgeKind(int(k)).name).lower() for k in curves.edge], str),
        curves.length, curves.length_std, curves.diameter, 2 * curves.radius_std, curves.radius, curves.radius_std,
        np.degrees(curves.angle), np.degrees(curves.angle_std), curves.convex, curves.position_std, *place.T,
        *curves.direction.T, curves.loop, holes, curves.measured,
    )  # fmt: skip
    return dict(zip(COLUMNS, values, strict=True))


def names(curves: Curves) -> np.ndarray:
    """Return a name for each curve, (K,) str: its kind and its number among all."""
    return np.array([f"{CurveKind(kind).name.lower()} {k + 1}" for k, kind in enumerate(curves.kind)], str)


def parallels(curves: Curves, *, within: float) -> Parallels:
    """Find the lines that run side by side, parallel but for 3 degrees, and measure the distance between them.

    Parameters
    ----------
    within : float
        The largest distance, in the cloud's unit.

    Raises
    ------
    ValueError
        If that is no length.
    """
    if not within > 0:
        raise ValueError(f"within: expected a length above 0, got {within}")
    lines = np.flatnonzero(curves.kind == CurveKind.LINE)
    first, last = curves.vertices[curves.start[lines]], curves.vertices[curves.start[lines + 1] - 1]
    direction, half = curves.direction[lines], 0.5 * curves.length[lines]
    middle = 0.5 * (first + last)
    pairs, distance, std = [], [], []
    for a in range(len(lines)):
        offset = middle[a + 1 :] - middle[a]
        along = offset @ direction[a]
        alike = np.abs(direction[a + 1 :] @ direction[a]) > np.cos(_PARALLEL)
        low, high = np.maximum(-half[a], along - half[a + 1 :]), np.minimum(half[a], along + half[a + 1 :])
        common = 0.5 * (low + high)[:, None]
        sign = np.sign(direction[a + 1 :] @ direction[a])[:, None]
        there = middle[a + 1 :] + (common - along[:, None]) * sign * direction[a + 1 :]
        apart = there - (middle[a] + common * direction[a])
        apart -= (apart @ direction[a])[:, None] * direction[a]
        far = np.linalg.norm(apart, axis=1)
        spacing = np.maximum(curves.spacing[lines[a]], curves.spacing[lines[a + 1 :]])
        for b in np.flatnonzero(alike & (high > low) & (far < within) & (far > spacing)):
            pairs.append((lines[a], lines[a + 1 + b]))
            distance.append(far[b])
            one, two = pairs[-1]
            swing = (curves.direction_std[[one, two]] * common[b]) ** 2
            std.append(np.sqrt(0.5 * (curves.position_std[[one, two]] ** 2 + swing).sum()))
    return Parallels(np.array(pairs, np.int64).reshape(-1, 2), np.array(distance, float), np.array(std, float))


def _middle_of(curves: Curves, curve: int) -> np.ndarray:
    """Return the place half way along a curve."""
    path = curves.points_of(curve)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return np.array([np.interp(0.5 * along[-1], along, path[:, axis]) for axis in range(3)])
