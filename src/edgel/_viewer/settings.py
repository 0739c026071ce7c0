"""What the user asked to see, and which detector runs it takes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from edgel._detect import DEFAULT_KINDS
from edgel._kinds import LIKELY
from edgel._viewer.runs import Method, Run
from edgel.edges import EdgeKind

MAX_SCALE = 10.0


class Coloring(Enum):
    """What the points of the cloud are colored by."""

    GREY = "grey"
    OWN = "its own colors"
    HEIGHT = "height"
    NORMALS = "normals"
    INTENSITY = "intensity"


@dataclass(frozen=True)
class Settings:
    """Everything on the page that decides what is seen.

    Attributes
    ----------
    methods : tuple of {"edgel", "paper"}
        The methods whose edges are shown, side by side.
    scale : float
        Edges larger than this many times the median spacing are found: the detector runs on the cloud thinned to one
        point a voxel of that size. 1: on all points.
    strength : float
        Least strength of an edge point that `edgel.detect` found.
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
    curves : bool
        Whether curves are traced and drawn.
    every_point : bool
        Whether all points of the cloud are drawn, however many, else an evenly sampled part of them.
    size : float
        Size of the points, in their usual one.
    """

    methods: tuple[Method, ...] = ("edgel",)
    scale: float = 1.0
    strength: float = LIKELY
    angle: float = 0.0
    kinds: EdgeKind = DEFAULT_KINDS
    crop: tuple[tuple[float, float], ...] = ((0.0, 1.0),) * 3
    coloring: Coloring = Coloring.GREY
    by_strength: bool = False
    tangents: bool = False
    normals: bool = False
    curves: bool = False
    every_point: bool = False
    size: float = 1.0

    @property
    def is_cropped(self) -> bool:
        """Whether anything is cut off."""
        return any(pair != (0.0, 1.0) for pair in self.crop)

    def run(self, source: int, method: Method, *, has_color: bool) -> Run:
        """Return the run that answers these settings for a file; `has_color`: whether it has any colors."""
        more = self.kinds & (EdgeKind.FRAME | EdgeKind.COLOR if has_color else EdgeKind.FRAME)
        return Run(source, method, self.scale, more if method == "edgel" else EdgeKind(0))

    def box(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the crop box of a cloud that reaches from `low` to `high`, (2, 3); infinite where nothing is cut."""
        share = np.array(self.crop).T
        box = low + share * (high - low)
        box[0, share[0] <= 0] = -np.inf
        box[1, share[1] >= 1] = np.inf
        return box
