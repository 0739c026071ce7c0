"""Curves measured on the faces beside them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import NeighborIndex
from edgel.curves import _fit
from edgel.curves._circle import RADIUS, SHAPE, fit_circle, fit_line
from edgel.curves._faces import fit_faces
from edgel.curves._points import EdgePoints
from edgel.curves._ranges import ranges_of
from edgel.edges import EdgeKind

REACH = 4.5
"""Spacings: so far from a curve its faces are measured."""
_SHORT, _SHORTEST = 2.4, 1.5  # of faces too small for that
_ROUGH = 0.15  # spacings: a face is that rough without the cloud being noisy
_ROUGHER = 1.35  # times the noise of the cloud: no plane, cylinder or cone is rougher
_COVERED = 0.2  # of the points that a face of full depth would have
_DEEP = 3.9  # spacings: full depth
_TURN = 0.15  # sine of the angle between faces, at least
_SMALLEST, _LARGEST = 1.5, 200.0  # spacings: of radii; a larger arc is told from a line by no cloud
_LOOSE = 0.45  # spacings: edge points of a shape with one face scatter less
_ROUND, _MOSTLY = 0.12, 4.0
"""Spacings, and radians: edge points of an arc with one face scatter less, or it goes round by more."""
_RIPPLE = 0.05  # spacings
_SAGITTA = 1.5  # spacings: an arc that rises less may be a line


@dataclass(frozen=True, eq=False)
class _Attempt:
    shape: np.ndarray
    fit: np.ndarray
    covariance: np.ndarray
    ranges: np.ndarray

    def put(self, which: np.ndarray, other: _Attempt, rows: np.ndarray) -> None:
        """Write some rows of others in place of some (int), as far as the others know."""
        for field in fields(other):
            getattr(self, field.name)[which] = getattr(other, field.name)[rows]


@dataclass(frozen=True, eq=False)
class Measured(_Attempt):
    """Shapes moved to where their faces meet.

    Attributes
    ----------
    shape : (K, 13) float64
    fit : (K, 22) float64
        See `_fit`.
    covariance : (K, 10, 10) float64
        Of the unknowns of `_fit`.
    ranges : (K, 2) float64
        From where to where along each its edge points lie.
    holds : (K,) bool
        Whether its faces confirm it.
    """

    holds: np.ndarray

    @property
    def both(self) -> np.ndarray:
        """Which lie where two faces meet, (K,) bool."""
        return self.holds & (self.fit[:, _fit.STATE] == _fit.MEASURED)

    def take(self, kept: np.ndarray) -> Measured:
        """Return some (int)."""
        return Measured(*(getattr(self, field.name)[kept] for field in fields(self)))

    def and_(self, other: Measured) -> Measured:
        """Return these and others."""
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(self))
        return Measured(*(np.concatenate(pair) for pair in pairs))


def measure(
    index: NeighborIndex,
    shapes: np.ndarray,
    rows: tuple[np.ndarray, np.ndarray],
    points: EdgePoints,
    position: np.ndarray,
    spacing: np.ndarray,
) -> Measured:
    """Fit the faces beside shapes (K, 13), and tell which fits hold.

    Takes the edge points of each shape (as rows, and where each shape's begin), all edge points and their smoothed
    places (E, 3), and the spacing (K,) of the cloud at the shapes. A shape whose faces are too rough is tried on less
    of them, since small parts have small faces, and an arc that is no arc as a line.
    """
    ranges = ranges_of(shapes, rows, position)
    outline = _outlines(points, rows)
    best = _attempt(shapes, np.arange(len(shapes)), REACH, index, rows, points, spacing, ranges)
    noise = noise_of(best, spacing)
    good = _holds(best, noise, spacing, outline)
    lines = lines_through(rows, position)
    for reach, straight in ((_SHORT, False), (REACH, True), (_SHORT, True), (_SHORTEST, False), (_SHORTEST, True)):
        curved = shapes[:, RADIUS] > 0
        which = np.flatnonzero((~good | nearly_straight(best, spacing)) & (curved | (not straight)))
        if not len(which):
            continue
        begin = lines if straight else shapes
        along = ranges_of(begin, rows, position) if straight else ranges
        other = _attempt(begin, which, reach, index, rows, points, spacing, along)
        holds = _holds(other, noise, spacing[which], outline[which])
        better = holds & (
            ~good[which] | (straight & (_rough(other) < 1.15 * _rough(best)[which] + 0.02 * spacing[which]))
        )
        best.put(which[better], other, better)
        good[which[better]] = True
    return Measured(best.shape, best.fit, best.covariance, ranges_of(best.shape, rows, position), good)


def refit(
    measured: Measured,
    which: np.ndarray,
    ranges: np.ndarray,
    reach: float,
    rows: tuple[np.ndarray, np.ndarray],
    points: EdgePoints,
    spacing: np.ndarray,
) -> np.ndarray:
    """Measure some shapes again over other ranges (W, 2), keep what holds, and return which do, (W,) bool."""
    along = measured.ranges.copy()
    along[which] = ranges
    other = _attempt(measured.shape, which, reach, points.index, rows, points, spacing, along)
    noise = noise_of(measured, spacing)
    better = _holds(other, noise, spacing[which], np.zeros(len(which), bool))
    better &= _rough(other) < 1.15 * _rough(measured)[which] + 0.02 * spacing[which]
    measured.put(which[better], other, better)
    return better


def _attempt(
    shapes: np.ndarray,
    which: np.ndarray,
    reach: float,
    index: NeighborIndex,
    rows: tuple[np.ndarray, np.ndarray],
    points: EdgePoints,
    spacing: np.ndarray,
    ranges: np.ndarray,
) -> _Attempt:
    """Fit the faces beside some shapes, as far from the edge as a reach, in spacings."""
    shape, fit = shapes[which], np.full((len(which), _fit.FIT), np.nan)
    fit[:, _fit.STATE] = _fit.NONE
    covariance = np.zeros((len(which), _fit.UNKNOWNS, _fit.UNKNOWNS))
    arguments = (which, reach, shape, index.xyz, index.boxes, *rows, points.position, points.normals)
    run_slices(fit_faces, len(which), *arguments, spacing, ranges, fit, covariance, size=8)
    return _Attempt(shape, fit, covariance, ranges[which].copy())


def _rough(fitted: _Attempt) -> np.ndarray:
    return np.nan_to_num(fitted.fit[:, _fit.SIGMA : _fit.SIGMA + 2], nan=np.inf).max(axis=1)


def noise_of(fitted: Any, spacing: np.ndarray) -> float:
    """Return how far points lie from faces, in spacings, in the middle of all fits."""
    both = fitted.fit[:, _fit.STATE] == _fit.MEASURED
    return float(np.median(fitted.fit[both, _fit.SIGMA : _fit.SIGMA + 2] / spacing[both, None])) if both.any() else 0.0


def nearly_straight(fitted: _Attempt, spacing: np.ndarray) -> np.ndarray:
    """Tell which arcs (K,) are so short that lines may be meant."""
    radius = fitted.shape[:, RADIUS]
    length = fitted.ranges[:, 1] - fitted.ranges[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return (radius > 0) & (length < 1.6 * radius) & (length**2 / (8 * radius) < _SAGITTA * spacing)


def _holds(fitted: _Attempt, noise: float, spacing: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Tell which shapes (K,) their faces confirm: smooth ones, along all of it, as lines and circles have."""
    fit, radius = fitted.fit, fitted.shape[:, RADIUS]
    counts, sigma = fit[:, _fit.COUNTS : _fit.COUNTS + 2], fit[:, _fit.SIGMA : _fit.SIGMA + 2] / spacing[:, None]
    a, b, c, d = fit[:, _fit.NORMALS : _fit.NORMALS + 4].T
    length = np.maximum((fitted.ranges[:, 1] - fitted.ranges[:, 0]) / spacing, 2.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        smooth = (sigma < np.maximum(_ROUGH, _ROUGHER * noise)).all(axis=1)
        measured = smooth & (counts.min(axis=1) > _COVERED * _DEEP * length) & (np.abs(a * d - b * c) > _TURN)
        alone = outline & (np.nan_to_num(sigma).max(axis=1) < max(_LOOSE, 1.5 * noise))
        # Scattered points round a corner, or along a straight eave, lie near some arc too.
        turns = (fitted.ranges[:, 1] - fitted.ranges[:, 0]) / radius
        alone &= (radius == 0) | (turns > _MOSTLY) | (np.nan_to_num(sigma).max(axis=1) < _ROUND)
        # A wall that goes in and out as it goes round is several flat ones.
        measured &= ~(fit[:, _fit.RIPPLE] > _RIPPLE * spacing)
    state = fit[:, _fit.STATE]
    plausible = (radius == 0) | ((radius > _SMALLEST * spacing) & (radius < _LARGEST * spacing))
    return plausible & ((state == _fit.MEASURED) & measured | (state == _fit.EDGE_ALONE) & alone)


def _outlines(points: EdgePoints, rows: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Tell which shapes (K,) have more edge points where a surface ends than where two meet."""
    return mean_of((points.kind & np.uint8(EdgeKind.CREASE) == 0).astype(np.float64), rows) > 0.5


def mean_of(values: np.ndarray, rows: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the means (K,) of values over rows, given as rows and where each mean's begin."""
    if not len(rows[0]):
        return np.empty(len(rows[1]) - 1)
    return np.add.reduceat(values[rows[0]], rows[1][:-1]) / np.diff(rows[1])


def circles_through(rows: tuple[np.ndarray, np.ndarray], position: np.ndarray) -> np.ndarray:
    """Return the circles (K, 13) through edge points, given as rows of `position` and where each circle's begin."""
    shapes = np.zeros((len(rows[1]) - 1, SHAPE))
    run_slices(_fit_shapes, len(shapes), shapes, *rows, position, True, size=64)
    return shapes


def lines_through(rows: tuple[np.ndarray, np.ndarray], position: np.ndarray) -> np.ndarray:
    """Return the lines (K, 13) through edge points, as `circles_through`."""
    shapes = np.zeros((len(rows[1]) - 1, SHAPE))
    run_slices(_fit_shapes, len(shapes), shapes, *rows, position, False, size=64)
    return shapes


@kernel
def _fit_shapes(start, stop, shapes, rows, first, position, are_round):
    for k in range(start, stop):
        own = rows[first[k] : first[k + 1]]
        if are_round:
            fit_circle(position, own, shapes[k])
        else:
            fit_line(position, own, shapes[k])
