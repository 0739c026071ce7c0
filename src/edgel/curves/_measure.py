"""Curves measured on the faces beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import NeighborIndex
from edgel.curves import _fit, _rims
from edgel.curves._circle import RADIUS
from edgel.curves._gather import Beside, gather
from edgel.curves._lines import fit_line_faces
from edgel.curves._rims import fit_rim_faces


@dataclass(frozen=True, eq=False)
class Measured:
    """Shapes moved to where their faces meet.

    Attributes
    ----------
    shape : (K, 13) float64
    fit : (K, 23) float64
        See `_fit`.
    covariance : (K, 10, 10) float64
        Of circles, see `_rims`.
    beside : Beside
        The points of the cloud that they were measured on.
    """

    shape: np.ndarray
    fit: np.ndarray
    covariance: np.ndarray
    beside: Beside


def measure(
    index: NeighborIndex,
    xyz: np.ndarray,
    shapes: np.ndarray,
    rows: tuple[np.ndarray, np.ndarray],
    ranges: np.ndarray,
    edge: tuple[np.ndarray, np.ndarray],
    spacing: np.ndarray,
) -> Measured:
    """Fit the faces beside shapes (K, 13).

    Takes the edge points of each shape (as rows, and where each shape's begin), from where to where along it they lie
    (K, 2), places (E, 3) and normals (E, 2, 3) of all edge points, and the spacing (K,) of the cloud at the shapes.
    """
    beside = gather(index, xyz, shapes, ranges, spacing)
    shape, fit = shapes.copy(), np.full((len(shapes), _fit.FIT), np.nan)
    fit[:, _fit.STATE] = _fit.NONE
    covariance = np.zeros((len(shapes), _rims.UNKNOWNS, _rims.UNKNOWNS))
    arguments = (shape, beside.points, beside.start, xyz, *rows, *edge, spacing, ranges, fit, covariance)
    run_slices(_fit_faces, len(shapes), *arguments, size=8)
    return Measured(shape, fit, covariance, beside)


@kernel
def _fit_faces(start, stop, shape, beside, begin, xyz, rows, first, position, normals, spacing, ranges, fit, covariance):
    for k in range(start, stop):
        near, own = beside[begin[k] : begin[k + 1]], rows[first[k] : first[k + 1]]
        h, low, high = spacing[k], ranges[k, 0], ranges[k, 1]
        if shape[k, RADIUS] == 0.0:
            fit_line_faces(shape[k], near, xyz, own, position, normals, h, low, high, fit[k])
        else:
            fit_rim_faces(shape[k], near, xyz, own, position, normals, h, low, high, fit[k], covariance[k])
