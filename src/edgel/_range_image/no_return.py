"""Shots without a return that a sensor wrote as points: many at one coordinate where no surface is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel.cloud import Cloud, Points

_SHARE = 1e-3  # least share of the points
_FEWEST = 3  # and least number, in a grid, where no two pixels see the same place
_FEWEST_LISTED = 10  # in a list
_NUMBERS = 64  # least number of other depths, where depth 0 alone is to say that there was no return


def without_no_return(cloud: Cloud, finite: Points, viewpoint: np.ndarray | None) -> tuple[Points, str]:
    """Leave out the points that stand for no return.

    In a grid those are many points at one coordinate whose parts are equal (0 0 0, -1 -1 -1, 9999 9999 9999), or at
    depth 0 where everything else is farther off than it is deep. In a list: many points at 0 0 0 or in the viewpoint.

    Parameters
    ----------
    cloud : Cloud
    finite : Points
        Its finite points.
    viewpoint : (3,) float64 or None

    Returns
    -------
    Points
        The others.
    str
        What was left out, to follow a reason; empty if nothing was.

    Examples
    --------
    >>> from edgel.cloud import check_points
    >>> x, y = np.meshgrid(np.arange(1.0, 9), np.arange(1.0, 7))
    >>> frame = Cloud(np.stack([x, y, 0 * x + 5], axis=-1) * (x + y > 5)[..., None])
    >>> left, said = without_no_return(frame, check_points(frame), None)
    >>> len(left.xyz), said
    (38, '; 10 at 0 0 0 taken as no return')
    """
    gridded = cloud.shape is not None and min(cloud.shape) > 1
    xyz = finite.xyz
    least = max(_SHARE * len(xyz), _FEWEST if gridded else _FEWEST_LISTED)
    missing, said = np.zeros(len(xyz), bool), []
    for place in _flags(xyz, least) if gridded else _own_places(viewpoint):
        there = (xyz == place).all(axis=1)
        if there.sum() >= least:
            missing |= there
            said.append(f"{there.sum():,} at {' '.join(f'{part:g}' for part in place)}")
    if gridded and (flat := (xyz[:, 2] == 0) & ~missing).sum() >= least:
        depth = xyz[~flat & ~missing, 2]
        nearest = np.abs(depth).min(initial=np.inf)
        if len(np.unique(depth)) >= _NUMBERS and nearest > np.ptp(depth):
            missing |= flat
            said.append(f"{flat.sum():,} at z = 0")
    if not missing.any() or len(xyz) - missing.sum() < _FEWEST:
        return finite, ""
    left = replace(finite, xyz=np.ascontiguousarray(xyz[~missing]), rows=finite.rows[~missing])
    return left, f"; {' and '.join(said)} taken as no return"


def _flags(xyz: np.ndarray, least: float) -> list[np.ndarray]:
    """Places of three equal coordinates at which at least so many points lie, the most crowded first."""
    equal = xyz[(xyz[:, 0] == xyz[:, 1]) & (xyz[:, 1] == xyz[:, 2]), 0] + 0.0  # no negative zero
    values, counts = np.unique(equal, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return [np.full(3, value) for value in values[order[counts[order] >= least]]]


def _own_places(viewpoint: np.ndarray | None) -> list[np.ndarray]:
    """Places at which a sensor lists shots without a return: its frame's origin, and where it stands."""
    origin = np.zeros(3)
    return [origin] if viewpoint is None or not viewpoint.any() else [origin, viewpoint]
