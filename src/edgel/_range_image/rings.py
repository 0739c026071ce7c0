"""Sweeps of spinning sensors: rings of shots at even steps of azimuth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._range_image.regrid import Grid, one_a_cell

_RINGS = (8, 256)  # how many lasers a spinning sensor has
_RING_SHOTS = 100  # least mean number of shots of each
_ON_RINGS = 0.95  # least share of the shots that lie on them
_GAP = 5e-4  # of the range of elevations: least gap between rings
_SHARP = 0.3  # of the gap between two rings: most that a ring is thick
_HIGH = 0.02  # radians: least range of elevations; what is far away is flatter
_WIDE = 0.2  # radians: least range of azimuths
_EVEN = 0.7  # least share of the steps along the rings that are the usual one
_NEAR_STEP = 0.3  # of the usual step, most that these differ from it


@dataclass(frozen=True, eq=False)
class Rings:
    """Rings of a spinning sensor, its axis +Z.

    Attributes
    ----------
    count : int
        Number of rings.
    points : (M,) int64
        The points that lie on them, ring by ring from the lowest, by azimuth within each.
    ring : (M,) int64
        The ring of each of these.
    azimuth : (M,) float64
        Its azimuth, radians from the ray opposite to the middle one, 0 to 2 pi.
    step : float
        The usual step of azimuth, radians.
    """

    count: int
    points: np.ndarray
    ring: np.ndarray
    azimuth: np.ndarray
    step: float

    def grid(self, xyz: np.ndarray, viewpoint: np.ndarray) -> Grid | None:
        """Put the points (N, 3) on a grid: rings from above, steps of azimuth to the right; None if they fill none.

        Every ring has its own first azimuth: lasers fire one after the other.
        """
        phase = np.exp(2j * np.pi * self.azimuth / self.step)
        starts = np.searchsorted(self.ring, np.arange(self.count))
        first = np.angle(np.add.reduceat(phase, starts)) / (2 * np.pi)
        cols = np.rint(self.azimuth / self.step - first[self.ring]).astype(np.int64)
        depth = np.linalg.norm(xyz[self.points] - viewpoint, axis=1)
        return one_a_cell(xyz, self.points, self.count - 1 - self.ring, -cols, depth)


def find_rings(xyz: np.ndarray, viewpoint: np.ndarray) -> Rings | None:
    """Find the rings of a spinning sensor at the viewpoint, its axis +Z; None where the points lie on none.

    Elevations that come in sharp levels are not enough: seen from afar, so do terraces. The shots of a sensor also
    follow each other at one step of azimuth, and spread over more than a few degrees.

    Parameters
    ----------
    xyz : (N, 3) float64
    viewpoint : (3,) float64

    Examples
    --------
    >>> azimuth, elevation = np.meshgrid(np.arange(0, 6.28, 0.01), np.radians(np.arange(-15, 16, 2)))
    >>> rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1).reshape(-1, 3)
    >>> rings = find_rings(rays * (5 + np.sin(rays[:, :1] * 9)), np.zeros(3))
    >>> rings is not None and (rings.count, round(rings.step, 6))
    (16, 0.01)
    """
    rays = xyz - viewpoint
    level = np.hypot(rays[:, 0], rays[:, 1])
    away = np.flatnonzero(level + np.abs(rays[:, 2]) > 0)
    elevation = np.arctan2(rays[away, 2], level[away])
    bounds = _levels(np.sort(elevation))
    if bounds is None:
        return None
    first, last = bounds
    ring = np.searchsorted(first, elevation, side="right") - 1
    on = np.flatnonzero((ring >= 0) & (elevation <= last[ring]))
    points, ring = away[on], ring[on]
    middle = rays[points].mean(axis=0)
    azimuth = np.arctan2(rays[points, 1], rays[points, 0]) - np.arctan2(middle[1], middle[0])
    azimuth = (azimuth + np.pi) % (2 * np.pi)
    order = np.lexsort((azimuth, ring))
    points, ring, azimuth = points[order], ring[order], azimuth[order]
    steps = np.diff(azimuth)[np.diff(ring) == 0]
    usual = np.abs(steps - np.median(steps)) < _NEAR_STEP * np.median(steps)
    if np.ptp(azimuth) < _WIDE or usual.mean() < _EVEN:
        return None
    return Rings(len(first), points, ring, azimuth, float(np.median(steps[usual])))


def _levels(elevation: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Lowest and highest elevation (R,) of each ring, from those of all points (N,), ascending; None without rings."""
    if len(elevation) < _RINGS[0] * _RING_SHOTS or elevation[-1] - elevation[0] < _HIGH:
        return None
    parted = np.flatnonzero(np.diff(elevation) > _GAP * (elevation[-1] - elevation[0]))
    first, last = np.append(0, parted + 1), np.append(parted, len(elevation) - 1)
    full = last - first + 1 >= _RING_SHOTS
    first, last = first[full], last[full]
    if not _RINGS[0] <= len(first) <= _RINGS[1] or (last - first + 1).sum() < _ON_RINGS * len(elevation):
        return None
    thick, apart = elevation[last] - elevation[first], elevation[first[1:]] - elevation[last[:-1]]
    return (elevation[first], elevation[last]) if np.median(thick) < _SHARP * np.median(apart) else None
