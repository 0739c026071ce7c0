"""Strands: stretches of shapes, and runs of edge points that are no shape; what becomes curves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from edgel.curves import _fit
from edgel.curves._circle import RADIUS, SHAPE, locals_of
from edgel.curves._corners import Ends
from edgel.curves._extent import extents
from edgel.curves._gather import on_shapes
from edgel.curves._leftover import leftover_paths
from edgel.curves._measure import mean_of
from edgel.curves._points import EdgePoints
from edgel.curves._rows import rows_of_runs, take_rows
from edgel.curves._shapes import Shapes
from edgel.curves._straight import are_strong

_LIKELY = 1.1  # logarithm of the odds that a shape is an edge
_TOTAL, _MEAN, _LONG = 2.6, 1.3, 0.5
"""How much each says of that: logarithms of the edge points' strength a spacing, their mean one, and the length."""
_ADDED = 2.8  # to them
_TURN, _FACES = 1.2, -2.1
"""And faces: the logarithm of the turn between them in its deviations, and that there are two."""
_FAINT, _NO_TURN, _CLEAR_TURN = 0.02, 0.1, 1e3  # strength, and deviations: less, or more, says no more
_RUN_POINTS = 4
_STEP = 0.5  # spacings between the places of curves that are looked at
_SURE = 0.02  # spacings: no face is surer


@dataclass(frozen=True, eq=False)
class Strands:
    """Stretches of shapes first, then runs.

    Attributes
    ----------
    shape : (N, 13) float64
        Of a run the line at its middle, with the radius NaN.
    fit : (N, 22) float64
    covariance : (N, 10, 10) float64
    along : (N, 2) float64
        From where to where along the shape.
    closed : (N,) bool
    spacing : (N,) float64
    rows : (R,) int64, (N + 1,) int64
        Edge points of each, in order along it, and where each begins.
    places : (R, 3) float64
        Where they are, smoothed.
    """

    shape: np.ndarray
    fit: np.ndarray
    covariance: np.ndarray
    along: np.ndarray
    closed: np.ndarray
    spacing: np.ndarray
    rows: tuple[np.ndarray, np.ndarray]
    places: np.ndarray

    def __len__(self) -> int:
        return len(self.closed)

    @property
    def is_run(self) -> np.ndarray:
        """Which are no shape, (N,) bool."""
        return np.isnan(self.shape[:, RADIUS])

    def take(self, kept: np.ndarray) -> Self:
        """Return some (int)."""
        rows, start = take_rows((np.arange(len(self.rows[0])), self.rows[1]), kept)
        names = ("shape", "fit", "covariance", "along", "closed", "spacing")
        parts = {name: getattr(self, name)[kept] for name in names}
        return replace(self, rows=(self.rows[0][rows], start), places=self.places[rows], **parts)

    def and_runs(self, runs: list[tuple[np.ndarray, bool]], position: np.ndarray, spacing: np.ndarray) -> Strands:
        """Add runs of edge points, and whether each is closed, given the places (E, 3) and spacing (E,) of all."""
        number = len(runs)
        fit = np.full((number, _fit.FIT), np.nan)
        fit[:, _fit.STATE] = _fit.NONE
        rows, start = rows_of_runs([run for run, _ in runs])
        return Strands(
            np.concatenate([self.shape, np.full((number, SHAPE), np.nan)]),
            np.concatenate([self.fit, fit]),
            np.concatenate([self.covariance, np.zeros((number, _fit.UNKNOWNS, _fit.UNKNOWNS))]),
            np.concatenate([self.along, np.zeros((number, 2))]),
            np.concatenate([self.closed, np.array([is_closed for _, is_closed in runs], bool)]),
            np.concatenate([self.spacing, mean_of(spacing, (rows, start))]),
            (np.concatenate([self.rows[0], rows]), np.concatenate([self.rows[1], self.rows[1][-1] + start[1:]])),
            np.concatenate([self.places, position[rows]]),
        )

    def path_of(self, strand: int) -> np.ndarray:
        """Return the places of the edge points of a strand, (P, 3)."""
        return self.places[self.rows[1][strand] : self.rows[1][strand + 1]]


def find_strands(shapes: Shapes, points: EdgePoints) -> Strands:
    """Find where shapes are edges, and which runs are worth keeping."""
    measured, position = shapes.measured, shapes.smoothed.position
    found = extents(measured, points.index, shapes.rows, position, measured.ranges, shapes.spacing)
    on = found.shape
    length = np.bincount(on, (found.ends[:, 1] - found.ends[:, 0]) / shapes.spacing[on], len(shapes.spacing))
    kept = _evident(measured.fit, shapes.rows, points.strength, np.maximum(length, 1.0))[on]
    on, ends, closed = on[kept], found.ends[kept], found.closed[kept]
    rows, start = _rows_within(shapes, position, on, ends, closed)
    strong = are_strong(rows_of_runs(shapes.runs), points.strength).tolist()
    runs = [
        (run, is_closed)
        for run, is_closed, is_strong in zip(shapes.runs, shapes.run_closed, strong, strict=True)
        if len(run) >= _RUN_POINTS and is_strong
    ]
    spacing = shapes.spacing[on]
    parts = measured.shape[on], measured.fit[on], measured.covariance[on], ends, closed, spacing
    strands = Strands(*parts, (rows, start), position[rows]).and_runs(runs, position, points.spacing)
    paths = leftover_paths(position, points.strength, points.kind, points.spacing, _places_along(strands))
    return strands.and_runs([(path, False) for path in paths], position, points.spacing)


def _places_along(strands: Strands) -> np.ndarray:
    """Return places along all strands; of runs their edge points, and midway between them."""
    shaped, runs = np.flatnonzero(~strands.is_run), np.flatnonzero(strands.is_run)
    paths = [strands.path_of(run) for run in runs.tolist()]
    return np.concatenate([places_on(strands, shaped)[0], *paths, *(0.5 * (path[1:] + path[:-1]) for path in paths)])


def places_on(strands: Strands, which: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places on some strands with shapes, the strand of each, and how far along it is."""
    span = strands.along[which, 1] - strands.along[which, 0]
    number = np.maximum(np.ceil(span / (_STEP * strands.spacing[which])), 1).astype(np.int64)
    at = np.repeat(np.arange(len(which)), number)
    share = (np.arange(len(at)) - np.repeat(np.cumsum(number) - number, number) + 0.5) / number[at]
    owner, along = which[at], strands.along[which[at], 0] + share * span[at]
    return on_shapes(strands.shape[owner], along), owner, along


def _evident(
    fit: np.ndarray, rows: tuple[np.ndarray, np.ndarray], strength: np.ndarray, length: np.ndarray
) -> np.ndarray:
    """Tell which shapes (K,) are edges, by their edge points and faces, over all their lengths (K,) in spacings.

    A logistic regression on shapes that were found in 13 parts at noise 0, 0.1 and 0.3 (`docs/decisions.md`).
    """
    number = np.maximum(np.diff(rows[1]), 1)
    total = np.add.reduceat(strength[rows[0]], rows[1][:-1]) if len(rows[0]) else np.empty(0)
    a, b, c, d = fit[:, _fit.NORMALS : _fit.NORMALS + 4].T
    turn = np.arcsin(np.clip(np.abs(a * d - b * c), 0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.log(np.clip(turn / fit[:, _fit.ANGLE_STD], _NO_TURN, _CLEAR_TURN))
    faces = np.where(fit[:, _fit.STATE] == _fit.MEASURED, _TURN * turns + _FACES, 0.0)
    points = _TOTAL * np.log(total / length + _FAINT) + _MEAN * np.log(total / number + _FAINT)
    return points + _LONG * np.log(length) + faces + _ADDED > _LIKELY


def along_of_all(shape: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return how far along shapes (N, 13) places (N, 3) are, each along its own."""
    x, y, z = locals_of(shape, places)
    return np.where(shape[:, RADIUS] == 0, z, shape[:, RADIUS] * np.arctan2(y, x))


def past(along: np.ndarray, low: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Return how far along shapes places are, counted on round circles so that it is no less than `low`."""
    around = 2 * np.pi * shape[:, RADIUS]
    is_arc = around > 0
    turns = np.floor((along - low) / np.where(is_arc, around, 1.0))
    return np.where(is_arc, along - around * turns, along)


def _rows_within(
    shapes: Shapes, position: np.ndarray, on: np.ndarray, ends: np.ndarray, closed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the edge points of each stretch, in order along it, and where each begins."""
    rows, start = take_rows(shapes.rows, on)
    stretch = np.repeat(np.arange(len(on)), np.diff(start))
    shape, h = shapes.measured.shape[on[stretch]], shapes.spacing[on[stretch]]
    low, high = ends[stretch, 0] - 0.5 * h, ends[stretch, 1] + 0.5 * h
    along = past(along_of_all(shape, position[rows]), low, shape)
    kept = (along >= low) & (along <= high) | closed[stretch]
    order = np.lexsort((along, stretch))
    order = order[kept[order]]
    counts = np.bincount(stretch[order], minlength=len(on))
    return rows[order], np.concatenate([[0], np.cumsum(counts)])


def ends_of(strands: Strands) -> Ends:
    """Return the ends of strands, and the planes in which they lie there."""
    count = len(strands)
    place, tangent = np.zeros((count, 2, 3)), np.zeros((count, 2, 3))
    normals, std = np.zeros((count, 2, 2, 3)), np.ones((count, 2, 2))
    shaped, runs = np.flatnonzero(~strands.is_run), np.flatnonzero(strands.is_run)
    for end, sign in ((0, -1.0), (1, 1.0)):
        parts = planes_at(strands, shaped, strands.along[shaped, end])
        place[shaped, end], tangent[shaped, end], normals[shaped, end], std[shaped, end] = parts
        tangent[shaped, end] *= sign
        for run in runs.tolist():
            path = strands.path_of(run)[:: -1 if end == 0 else 1]
            away = path[-1] - path[-min(4, len(path))]
            away /= np.linalg.norm(away)
            place[run, end], tangent[run, end] = path[-1], away
            across = np.linalg.svd(away[None])[2][1:]
            normals[run, end], std[run, end] = across, 0.3 * strands.spacing[run]
    return Ends(place, tangent, normals, std, ~strands.closed)


def planes_at(
    strands: Strands, which: np.ndarray, along: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return places, tangents, and both planes with their deviations, so far along some strands with shapes."""
    shape, fit, h = strands.shape[which], strands.fit[which], strands.spacing[which]
    u, v, w = shape[:, 3:6], shape[:, 6:9], shape[:, 9:12]
    is_line = shape[:, RADIUS] == 0
    turn = (along / np.where(is_line, 1.0, shape[:, RADIUS]))[:, None]
    line = is_line[:, None]
    tangent = np.where(line, w, np.cos(turn) * v - np.sin(turn) * u)
    first, second = np.where(line, u, np.cos(turn) * u + np.sin(turn) * v), np.where(line, v, w)
    faces = fit[:, _fit.NORMALS : _fit.NORMALS + 4].reshape(-1, 2, 2)
    # Where there is one face alone, the edge points stand in for the other: across it, where they end.
    inward = fit[:, _fit.INWARD : _fit.INWARD + 4].reshape(-1, 2, 2)
    faces = np.where((faces == 0).all(axis=2, keepdims=True), inward[:, ::-1], faces)
    normals = faces[..., :1] * first[:, None] + faces[..., 1:] * second[:, None]
    off = np.where(line, fit[:, _fit.OFFSETS : _fit.OFFSETS + 2], fit[:, _fit.POSITION_STD, None])
    swing = np.where(is_line, along * fit[:, _fit.TURN_STD], 0.0)
    std = np.sqrt(off**2 + swing[:, None] ** 2 + (_SURE * h[:, None]) ** 2)
    return on_shapes(shape, along), tangent, normals, np.where(np.isfinite(std), std, 0.3 * h[:, None])
