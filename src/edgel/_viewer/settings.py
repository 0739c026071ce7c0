"""What the user asked to see, and which detector runs it takes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from edgel._detect import DEFAULT_KINDS
from edgel._labels import LIKELY, PRESETS
from edgel.edges import EdgeKind

METHODS = {"edgel": ("default",), "paper": ("paper",), "side by side": PRESETS}
"""Presets shown by each choice of the page."""

MAX_SCALE = 10.0


class Coloring(Enum):
    """What the points of the cloud are colored by."""

    GREY = "grey"
    OWN = "its own colors"
    HEIGHT = "height"
    NORMALS = "normals"
    INTENSITY = "intensity"


@dataclass(frozen=True)
class Run:
    """One run of the detector: everything else only filters what it found.

    Attributes
    ----------
    source : int
        Which file.
    preset : {"default", "paper"}
    scale : float
        See `Settings`.
    color : bool
        Whether edges of the colors are looked for.
    """

    source: int
    preset: str
    scale: float = 1.0
    color: bool = False


@dataclass(frozen=True)
class Settings:
    """Everything on the page that decides what is seen.

    Attributes
    ----------
    method : str
        One of `METHODS`.
    scale : float
        Edges larger than this many times the median spacing are found: the detector runs on the cloud thinned to one
        point a voxel of that size. 1: on all points.
    strength : float
        Least strength of an edge point of the default detector.
    angle : float
        Least angle of a crease, in radians.
    kinds : EdgeKind
        Kinds shown. The published method's edges, of no kind, are always shown.
    crop : three pairs of float
        The part of the cloud's extent along x, y and z that is shown, from 0 to 1; at 0 and 1 there is no limit.
    coloring : Coloring
    by_strength : bool
        Whether edges are colored by strength, else by kind.
    tangents, normals : bool
        Whether they are drawn as segments.
    every_point : bool
        Whether all points of the cloud are drawn, however many, else an even part of them.
    size : float
        Size of the points, in their usual one.
    """

    method: str = "edgel"
    scale: float = 1.0
    strength: float = LIKELY
    angle: float = 0.0
    kinds: EdgeKind = DEFAULT_KINDS
    crop: tuple[tuple[float, float], ...] = ((0.0, 1.0),) * 3
    coloring: Coloring = Coloring.GREY
    by_strength: bool = False
    tangents: bool = False
    normals: bool = False
    every_point: bool = False
    size: float = 1.0

    @property
    def presets(self) -> tuple[str, ...]:
        """The presets shown."""
        return METHODS[self.method]

    @property
    def is_cropped(self) -> bool:
        """Whether anything is cut off."""
        return any(pair != (0.0, 1.0) for pair in self.crop)

    def run(self, source: int, preset: str, *, has_color: bool) -> Run:
        """Return the run that answers these settings for a file; `has_color`: whether it has any colors."""
        color = preset == "default" and has_color and EdgeKind.COLOR in self.kinds
        return Run(source, preset, self.scale, color)

    def box(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the crop box of a cloud that reaches from `low` to `high`, (2, 3); infinite where nothing is cut."""
        share = np.array(self.crop).T
        box = low + share * (high - low)
        box[0, share[0] <= 0] = -np.inf
        box[1, share[1] >= 1] = np.inf
        return box
