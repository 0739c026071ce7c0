"""What a rival is: its parameters, and how to run it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

import edgel
from edgel.edges import EdgeKind

OUTLINE = EdgeKind.BOUNDARY | EdgeKind.OCCLUDING | EdgeKind.OCCLUDED
"""Where the surface that was seen ends. A detector that knows of no view calls all three a boundary."""

THREADS = 2


@dataclass(frozen=True, eq=False)
class Found:
    """What a rival found.

    Attributes
    ----------
    mask : (N,) bool
        The edge points; never a point that is not finite.
    kind : (N,) uint8
        `EdgeKind` flags, 0 where there is no edge.
    seconds : float
        Computing alone, the search index included; reading, writing and conversion of arrays left out.
    normals : (N, 3) float64, optional
    """

    mask: np.ndarray
    kind: np.ndarray
    seconds: float
    normals: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Rival:
    """A detector of edges.

    Attributes
    ----------
    name : str
    finds : EdgeKind
        The kinds it claims to find; the others are not asked of it.
    organized_only : bool
    defaults : mapping
        Its documented parameters. Lengths are in point spacings.
    grid : tuple of mappings
        What to choose from, besides the defaults, on scenes set apart for it.
    missing : callable
        None, or a line that says how to get it.
    run : callable
        ``run(cloud, spacing, parameters)``; the cloud and the spacing in mm.
    """

    name: str
    finds: EdgeKind
    organized_only: bool
    defaults: Mapping
    grid: tuple[Mapping, ...]
    missing: Callable[[], str | None]
    run: Callable[[edgel.Cloud, float, Mapping], Found]


@dataclass(frozen=True, eq=False)
class NormalsRival:
    """An estimator of the normals of all points: ``run(points, k) -> (normals (N, 3), seconds with the index)``."""

    name: str
    missing: Callable[[], str | None]
    run: Callable[[np.ndarray, int], tuple[np.ndarray, float]]


def found(mask: np.ndarray, kind: EdgeKind, seconds: float) -> Found:
    """Return what a detector of one kind found."""
    return Found(mask, np.where(mask, int(kind), 0).astype(np.uint8), seconds)


def finite_rows(cloud: edgel.Cloud) -> np.ndarray:
    """Return the rows of the points that can be computed with, (M,) int64."""
    return np.flatnonzero(np.isfinite(cloud.xyz).all(axis=1))


def spread(rows: np.ndarray, flags: np.ndarray, num_points: int) -> np.ndarray:
    """Return flags of some rows as a mask of all points."""
    mask = np.zeros(num_points, bool)
    mask[rows] = flags
    return mask


def grid(defaults: Mapping, *changes: Mapping) -> tuple[Mapping, ...]:
    """Return the defaults with each set of changes."""
    return tuple({**defaults, **change} for change in changes)
