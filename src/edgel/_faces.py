"""Faces: where exactly an edge runs, and the surface on either side, whatever found it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np


@dataclass(frozen=True, eq=False)
class Faces:
    """The geometry of edges at some points; NaN where no fit explains the point.

    Attributes
    ----------
    position : (M, 3) float64
        Foot of the point on the line in which the faces meet, or on that along which the surface ends.
    position_std : (M,) float64
        Root of the mean squared distance, in the cloud's unit, at which that line is to be expected from there.
    scale : (M,) float64
        Radius, in the cloud's unit, of the smallest neighbourhood that shows most of the edge.
    direction : (M, 3) float64
        Unit tangent of that line.
    normals : (M, 2, 3) float64
        Unit normals of both planes, on the side the viewer is on.
    angle : (M,) float64
        Turn from one plane to the other, radians, 0 to pi.
    convex : (M,) int8
        1 where the side of the normals is the outside of the wedge, -1 where it is the inside, 0 where unknown.
    """

    position: np.ndarray
    position_std: np.ndarray
    scale: np.ndarray
    direction: np.ndarray
    normals: np.ndarray
    angle: np.ndarray
    convex: np.ndarray

    @classmethod
    def of_points(cls, xyz: np.ndarray, normals: np.ndarray) -> Self:
        """Faces where one plane alone is known, its normals (M, 3): the position is the point itself."""
        return cls(
            position=xyz.copy(),
            position_std=np.full(len(xyz), np.nan),
            scale=np.full(len(xyz), np.nan),
            direction=np.full((len(xyz), 3), np.nan),
            normals=np.stack([normals, np.full_like(normals, np.nan)], axis=1),
            angle=np.full(len(xyz), np.nan),
            convex=np.zeros(len(xyz), np.int8),
        )

    def put(self, rows: np.ndarray, other: Faces, which: np.ndarray | slice) -> None:
        """Overwrite some rows (K,) with rows `which` (K,) of other faces."""
        for name in Faces.__dataclass_fields__:
            getattr(self, name)[rows] = getattr(other, name)[which]

    def along(self, xyz: np.ndarray, rows: np.ndarray) -> Self:
        """Return the faces of rows (K,) at points (K, 3) beside them: the line is straight, all else is the same."""
        taken = type(self)(*(getattr(self, name)[rows] for name in Faces.__dataclass_fields__))
        on = ((xyz - taken.position) * np.nan_to_num(taken.direction)).sum(axis=1, keepdims=True)
        return replace(taken, position=taken.position + on * np.nan_to_num(taken.direction))


def inside_of(out: np.ndarray, xyz: np.ndarray, viewpoint: np.ndarray | None) -> np.ndarray:
    """Whether vectors (M, 3) at points (M, 3) point away from the viewpoint, or down (-Z) without one; (M,) bool."""
    if viewpoint is None:
        return (out[:, 2] < 0) | ((out[:, 2] == 0) & ((out[:, 1] < 0) | ((out[:, 1] == 0) & (out[:, 0] < 0))))
    return ((viewpoint - xyz) * out).sum(axis=1) < 0


def facing(
    xyz: np.ndarray, normals: tuple[np.ndarray, np.ndarray], viewpoint: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Turn both normals of each edge, which lie on the outside of its wedge, to the viewer; the one seen better first.

    Returns
    -------
    (M, 2, 3) float64, (M,) float64
        The normals, and 1 where that side is the outside, -1 where it is the inside.
    """
    a, b = normals
    sign = np.where(inside_of(a + b, xyz, viewpoint), -1.0, 1.0)
    sight = np.array([0.0, 0.0, 1.0]) if viewpoint is None else viewpoint - xyz
    swap = sign[:, None] * ((b - a) * sight).sum(axis=1, keepdims=True) > 0
    a, b = np.where(swap, b, a), np.where(swap, a, b)
    return np.stack([a, b], axis=1) * sign[:, None, None], sign
