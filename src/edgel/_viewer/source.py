"""A file in the viewer: its cloud or why it cannot be read, and what is needed to show it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import edgel
from edgel._color import color_channels
from edgel._neighbors.spacing import median_spacing
from edgel._neighbors.thinning import thin_to
from edgel._viewer.settings import Settings
from edgel.cloud import Cloud, check_points, in_box
from edgel.io.errors import describe_error, printable
from edgel.plot.camera import Camera, choose_camera

MAX_SHOWN = 3_000_000  # points that a browser turns without stutter
FEW = 100_000  # points that are drawn in software without a delay to be felt
_TAIL = 2.5  # percent of the points at either end that do not count for how far the cloud reaches: a sweep's far ones
_SLACK = 0.25  # of the reach without them: a cloud without outliers reaches as far as it does
_SAMPLE = 200_000  # points that are enough to tell how far a cloud reaches


@dataclass(frozen=True, eq=False)
class Drawn:
    """The points of a cloud that are drawn.

    Attributes
    ----------
    at : (D,) int64
        Indices into `Source.shown`.
    spacing : float
        Median distance to the nearest neighbour that is drawn too, in the cloud's unit.
    whole : bool
        Whether none is left out of those in the crop box.
    """

    at: np.ndarray
    spacing: float
    whole: bool


class Source:
    """A file, read by `load`; until then, and when it cannot be read, `cloud` is None.

    Parameters
    ----------
    path : path
    reading : mapping, optional
        Options of `edgel.read`.
    read : callable
        Reads a cloud, as `edgel.read` does.

    Attributes
    ----------
    cloud : Cloud or None
    error : str
        Why it cannot be read; empty if it can.
    shown : (S,) int64
        Rows that can be drawn: the finite ones, or a random part of them.
    few : (F,) int64
        Indices into `shown` of at most `FEW`, evenly sampled, which are drawn until all are asked for.
    normals : (S, 3) float32 or None
        Of the rows `shown`; None until `estimate_normals` was called.
    spacing : float
        Median distance of the points `shown` to the nearest of them, in the cloud's unit.
    camera : Camera
        From where the cloud alone is best looked at.
    low, high : (3,) float64
        How far it reaches along its axes, without a few outliers.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        reading: Mapping[str, Any] | None = None,
        read: Callable[..., Cloud] = edgel.read,
    ) -> None:
        self.path, self.name, self.reading = os.fspath(path), printable(Path(path).name), dict(reading or {})
        self._read = read
        self.cloud: Cloud | None = None
        self.error = ""
        self.shown = self.few = np.empty(0, np.int64)
        self.normals: np.ndarray | None = None
        self.spacing = self._few_spacing = 0.0
        self._last: tuple[Any, Drawn] | None = None
        self.camera: Camera
        self.low, self.high = np.zeros(3), np.ones(3)

    @property
    def is_done(self) -> bool:
        """Whether it was read, or failed to be."""
        return self.cloud is not None or bool(self.error)

    def drawn(self, settings: Settings) -> Drawn:
        """Return which of the points are drawn: all in the crop box, or, of too many, some evenly sampled."""
        key = (settings.crop, settings.every_point)
        last = self._last
        if last is None or last[0] != key:
            last = self._last = key, self._drawn(settings)
        return last[1]

    def _drawn(self, settings: Settings) -> Drawn:
        assert self.cloud is not None
        inside = np.ones(len(self.shown), bool)
        if settings.is_cropped:
            inside = in_box(self.cloud.xyz[self.shown], settings.box(self.low, self.high))
        number = int(inside.sum())
        if settings.every_point or number <= FEW:
            return Drawn(np.flatnonzero(inside), self.spacing, whole=len(self.shown) < MAX_SHOWN)
        return Drawn(self.few[inside[self.few]], self._few_spacing, whole=False)

    @cached_property
    def has_color(self) -> bool:
        """Whether the cloud, already read, has colors or an intensity whose edges could be found."""
        return self.cloud is not None and color_channels(self.cloud) is not None

    def load(self) -> None:
        """Read the file; what is wrong with it becomes `error`, whatever it is."""
        try:
            cloud = self._read(self.path, **self.reading)
            rows = check_points(cloud).rows
            if len(rows) > MAX_SHOWN:
                chosen = np.random.default_rng(0).choice(len(rows), MAX_SHOWN, replace=False, shuffle=False)
                rows = rows[np.sort(chosen)]
            self.shown = rows
            xyz = cloud.xyz[rows]
            self.spacing = median_spacing(xyz)
            self.few = thin_to(xyz, FEW, self.spacing)
            self._few_spacing = self.spacing * float(np.sqrt(len(rows) / len(self.few)))
            self.camera = choose_camera(cloud, "auto")
            self.low, self.high = reach(xyz)
            self.cloud = cloud
        except MemoryError:
            self.error = "not enough memory; thin the cloud or cut it into parts"
        except Exception as error:
            self.error = describe_error(error)

    def estimate_normals(self) -> None:
        """Fit the normals of the points shown, which the grey is shaded by."""
        if self.cloud is not None and self.normals is None:
            self.normals = edgel.estimate_normals(self.cloud, at=self.shown).normals.astype(np.float32)


def reach(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and the upper corner of points (N, 3), (3,) each, far outliers left out."""
    sample = xyz[:: -(-len(xyz) // _SAMPLE)]
    low, high = np.percentile(sample, [_TAIL, 100.0 - _TAIL], axis=0)
    slack = _SLACK * (high - low)
    return np.maximum(xyz.min(axis=0), low - slack), np.minimum(xyz.max(axis=0), high + slack)
