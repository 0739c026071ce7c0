"""Edges: what every detector answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag
from typing import Any

import numpy as np

from edgel.cloud import Cloud, as_cloud
from edgel.normals import Normals


class EdgeKind(IntFlag):
    """Why a point is an edge point; a point can be several at once."""

    BOUNDARY = 1
    """The surface ends, with nothing behind."""
    OCCLUDING = 2
    """The near side of a depth jump, seen from a view."""
    OCCLUDED = 4
    """The far side of a depth jump, seen from a view."""
    CREASE = 8
    """Two faces meet."""
    COLOR = 16
    """A step in color or intensity."""
    IMAGE = 32
    """An edge of the projected image, of a kind not told apart (the published method)."""


@dataclass(frozen=True, eq=False)
class Edges:
    """The edge points of a cloud, each once, in the order of the cloud.

    Attributes
    ----------
    index : (E,) int64
        Rows of the input, flat where it is organized, ascending.
    kind : (E,) uint8
        `EdgeKind` flags.
    strength : (E,) float64
        How marked the edge is, in (0, 1].
    planes : Normals
        Best-fit plane of each edge point's neighbours in the whole cloud.
    num_points : int
        Number of points of the input, finite or not.
    num_dropped : int
        How many of them were left out because a coordinate was NaN or infinite.
    preset : str
        The method that found them.
    parameters : mapping
        Its parameters, those it chose itself included.
    seconds : mapping of str to float
        Time by stage, in seconds.
    """

    index: np.ndarray
    kind: np.ndarray
    strength: np.ndarray
    planes: Normals
    num_points: int
    num_dropped: int
    preset: str
    parameters: Mapping[str, Any]
    seconds: Mapping[str, float]

    def __len__(self) -> int:
        return len(self.index)

    def __repr__(self) -> str:
        dropped = f", {self.num_dropped:,} not finite" if self.num_dropped else ""
        return f"Edges({len(self):,} of {self.num_points:,} points, {self.share:.1%}{dropped}; preset {self.preset})"

    @property
    def normals(self) -> np.ndarray:
        """Unit normals of the edge points, (E, 3) float64; NaN where the neighbours span no plane."""
        return self.planes.normals

    @property
    def share(self) -> float:
        """Edge points among the finite points of the input, 0 to 1."""
        return len(self) / (self.num_points - self.num_dropped)

    def cloud(self, points: Any) -> Cloud:
        """Return the edge points of the input as a cloud: all its attributes, and kind, strength and normal."""
        return self._describe(as_cloud(points).take(self.index), np.arange(len(self)))

    def label(self, points: Any) -> Cloud:
        """Return the whole input with the same attributes added; ``edge_kind`` is 0 where there is no edge."""
        return self._describe(as_cloud(points), self.index)

    def _describe(self, cloud: Cloud, rows: np.ndarray) -> Cloud:
        kind = np.zeros(len(cloud), np.uint8)
        strength = np.zeros(len(cloud), np.float32)
        normals = np.full((len(cloud), 3), np.nan, np.float32)
        kind[rows], strength[rows], normals[rows] = self.kind, self.strength, self.normals
        nx, ny, nz = normals.T
        return cloud.with_attributes(edge_kind=kind, edge_strength=strength, nx=nx, ny=ny, nz=nz)
