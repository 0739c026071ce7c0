"""Where clouds stand in the scene, side by side, and where they are first looked at from.

The scene's unit is half the size of the largest cloud, z is up, and clouds seen by a camera stand upright: numbers stay
small whatever the coordinates are, so that the browser's 32 bits are enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edgel._viewer.source import Source, reach
from edgel.cloud import in_box
from edgel.plot.camera import OBLIQUE

FIELD_OF_VIEW = 0.7  # of the page's camera, vertical, radians
_MARGIN = 1.05  # of the distance to the target
_GAP = 0.15  # between neighbours, scene units
_LEVEL = np.array([0.0, 1.0, 0.0])
_OBLIQUE = np.array(OBLIQUE) / np.linalg.norm(OBLIQUE)
_SAME_SCALE = 10.0  # clouds that differ more in size are each made to fit


@dataclass(frozen=True, eq=False)
class Placement:
    """How a cloud is placed in the scene: turned, scaled, moved.

    Attributes
    ----------
    rotation : (3, 3) float64
    centre : (3,) float64
        Of the cloud, in its own frame.
    unit : float
        Scene units a cloud unit.
    offset : (3,) float64
        Where the centre stands in the scene.
    half : (3,) float64
        Half the extent, in scene units.
    """

    rotation: np.ndarray
    centre: np.ndarray
    unit: float
    offset: np.ndarray
    half: np.ndarray

    def to_scene(self, xyz: np.ndarray) -> np.ndarray:
        """Move points (N, 3) of the cloud into the scene, (N, 3) float32."""
        return ((xyz - self.centre) @ self.rotation.T * self.unit + self.offset).astype(np.float32)

    def to_cloud(self, directions: np.ndarray) -> np.ndarray:
        """Turn directions (..., 3) of the scene into those of the cloud."""
        return directions @ self.rotation


@dataclass(frozen=True, eq=False)
class _Upright:
    """A cloud turned upright: the rotation (3, 3), its centre (3,) before it, and half its extent (3,) after it."""

    rotation: np.ndarray
    centre: np.ndarray
    half: np.ndarray

    @property
    def size(self) -> float:
        return float(self.half.max()) or 1.0


@dataclass(frozen=True, eq=False)
class View:
    """Where to look from: position and target, (3,) float64 each, in the scene."""

    position: np.ndarray
    target: np.ndarray


@dataclass(frozen=True, eq=False)
class Layout:
    """Places of the panes, in their order, and how they are first looked at.

    Attributes
    ----------
    placements : list of Placement
    points : (P, 3) float64
        Points of all clouds in the scene, without far ones: what the first view must show.
    away, right : (3,) float64
        Where it looks, and what is to its right.
    same_scale : bool
        Whether all clouds are drawn to the same scale.
    """

    placements: list[Placement]
    points: np.ndarray
    away: np.ndarray
    right: np.ndarray
    same_scale: bool

    def view(self, aspect: float) -> View:
        """Step back until all points are in a picture of this width by height."""
        target = (self.points.min(axis=0) + self.points.max(axis=0)) / 2
        points, up, reach_up = self.points - target, np.cross(self.right, self.away), np.tan(FIELD_OF_VIEW / 2)
        need = np.maximum(np.abs(points @ self.right) / (reach_up * aspect), np.abs(points @ up) / reach_up)
        return View(target - _MARGIN * float((need - points @ self.away).max()) * self.away, target)


def lay_out(sources: Sequence[Source]) -> Layout:
    """Place clouds, already read, in a row from left to right as seen in the first view."""
    upright = [_turned(source) for source in sources]
    sizes = [one.size for one in upright]
    same_scale = max(sizes) <= _SAME_SCALE * min(sizes)
    units = [1 / (max(sizes) if same_scale else size) for size in sizes]
    away = _LEVEL if all(source.camera.eye is not None for source in sources) else _OBLIQUE
    right = np.cross(away, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    widths = [2 * float(np.abs(right) @ one.half) * unit for one, unit in zip(upright, units, strict=True)]
    left = -(sum(widths) + _GAP * (len(widths) - 1)) / 2
    placements, points = [], []
    for source, one, unit, width in zip(sources, upright, units, widths, strict=True):
        placement = Placement(one.rotation, one.centre, unit, (left + width / 2) * right, one.half * unit)
        assert source.cloud is not None
        seen = placement.to_scene(source.cloud.xyz[source.shown[source.few]]).astype(float)
        points.append(seen[in_box(seen, placement.offset + 1.001 * placement.half * [[-1], [1]])])
        placements.append(placement)
        left += width + _GAP
    return Layout(placements, np.concatenate(points), away, right, same_scale)


def _turned(source: Source) -> _Upright:
    """Turn a cloud so that it stands upright: as its sensor saw it, if it is seen from there."""
    camera = source.camera
    rotation = np.eye(3) if camera.eye is None else np.stack([camera.right, -camera.back, camera.up])
    assert source.cloud is not None
    low, high = reach(source.cloud.xyz[source.shown] @ rotation.T)
    return _Upright(rotation, (low + high) / 2 @ rotation, (high - low) / 2)
