"""Curves: what `trace` answers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np


class CurveKind(IntEnum):
    """What a curve is."""

    LINE = 1
    """A straight line between two places."""
    ARC = 2
    """Part of a circle."""
    CIRCLE = 3
    """A whole circle."""
    POLYLINE = 4
    """None of these: a run of places."""


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves along the edges of a cloud, and the corners where they meet: a graph.

    Lengths in the cloud's unit, angles in radians; NaN where something is unknown or has no meaning.

    Attributes
    ----------
    kind : (K,) uint8
        `CurveKind`.
    edge : (K,) uint8
        `EdgeKind` of most of its edge points.
    vertices : (V, 3) float64
        Places along the curves, in order, curve after curve: a line's two ends; of an arc or a circle so many that no
        chord is off by more than a hundredth of `spacing`, a circle's first again at the end.
    start : (K + 1,) int64
        Where each curve begins in `vertices`.
    rows : (R,) int64
        Edge points of the curves, as rows of the `Edges`, curve after curve, in order along each.
    row_start : (K + 1,) int64
        Where each curve begins in `rows`.
    closed : (K,) bool
        Whether it ends where it begins.
    length, length_std : (K,) float64
        Along the curve, and how sure that is (standard deviation).
    position_std : (K,) float64
        How sure its place is, across: root of the mean squared distance from the true curve.
    centre : (K, 3) float64
        Of circles and arcs.
    direction : (K, 3) float64
        Unit direction of lines, unit axis of circles and arcs.
    direction_std : (K,) float64
        How sure that is, in radians.
    radius, radius_std : (K,) float64
        Of circles and arcs.
    angle, angle_std : (K,) float64
        By how much the surface turns along the curve, 0 where it is smooth.
    convex : (K,) int8
        As in `Edges`.
    measured : (K,) bool
        Whether it lies where the fitted faces beside it meet; else where its edge points do.
    nodes : (K, 2) int64
        The node at its beginning and at its end; -1 for none.
    node_position : (M, 3) float64
        Where curves meet.
    node_std : (M,) float64
        Root of the mean squared distance from the true place.
    is_corner : (M,) bool
        Whether the curves of a node meet at an angle; else one goes smoothly over into the other.
    through : (T, 2) int64
        Curves that pass through a node without ending there: node and curve.
    loop : (K,) int64
        Closed outlines, of boundaries and occluding edges alone, are numbered from 0; -1 for all else.
    is_hole : (L,) bool
        Of each loop, whether the surface lies outside of it, as around a hole; else it is the rim of the scan.
    spacing : (K,) float64
        Of the cloud along the curve.
    crs : str or None
        That of the cloud.
    """

    kind: np.ndarray
    edge: np.ndarray
    vertices: np.ndarray
    start: np.ndarray
    rows: np.ndarray
    row_start: np.ndarray
    closed: np.ndarray
    length: np.ndarray
    length_std: np.ndarray
    position_std: np.ndarray
    centre: np.ndarray
    direction: np.ndarray
    direction_std: np.ndarray
    radius: np.ndarray
    radius_std: np.ndarray
    angle: np.ndarray
    angle_std: np.ndarray
    convex: np.ndarray
    measured: np.ndarray
    nodes: np.ndarray
    node_position: np.ndarray
    node_std: np.ndarray
    is_corner: np.ndarray
    through: np.ndarray
    loop: np.ndarray
    is_hole: np.ndarray
    spacing: np.ndarray
    crs: str | None

    def __len__(self) -> int:
        return len(self.kind)

    def __repr__(self) -> str:
        counts = ", ".join(f"{n} {name}{'s' * (n != 1)}" for name, n in self.count_kinds().items()) or "none"
        return f"Curves({len(self)}: {counts}; {int(self.is_corner.sum())} corners)"

    def count_kinds(self) -> dict[str, int]:
        """Count the curves by the kinds that occur, by lower-case name."""
        counts = {kind.name.lower(): int((self.kind == kind).sum()) for kind in CurveKind}
        return {name: number for name, number in counts.items() if number}

    def points_of(self, curve: int) -> np.ndarray:
        """Return the places along a curve, (P, 3)."""
        return self.vertices[self.start[curve] : self.start[curve + 1]]

    def rows_of(self, curve: int) -> np.ndarray:
        """Return the edge points of a curve, as rows of the `Edges`."""
        return self.rows[self.row_start[curve] : self.row_start[curve + 1]]

    @property
    def corners(self) -> np.ndarray:
        """Where curves meet at an angle, (C, 3)."""
        return self.node_position[self.is_corner]

    @property
    def diameter(self) -> np.ndarray:
        """Twice the radius, (K,); its standard deviation is twice `radius_std`."""
        return 2 * self.radius

    def curves_at(self, node: int) -> np.ndarray:
        """Return the curves that meet at a node, ascending: those that end there and those that pass through."""
        ending = np.flatnonzero((self.nodes == node).any(axis=1))
        return np.union1d(ending, self.through[self.through[:, 0] == node, 1])
