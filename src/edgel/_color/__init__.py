"""Color edges: Canny's five steps on the surface, on the rgb or the intensity that the points carry.

Canny 1986, doi:10.1109/TPAMI.1986.4767851; the gradient of several channels is Di Zenzo's (1986,
doi:10.1016/0734-189X(86)90223-9). Weights of neighbours vanish at the farthest one: which of several equally far
points is taken, a matter of coordinates, then changes nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._color.chains import hysteresis, non_maximum_suppression
from edgel._color.channels import color_channels
from edgel._color.gradient import color_gradient, smooth_colors
from edgel._color.step import color_step
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import at_places, every_place

__all__ = ["ColorEdges", "color_channels", "color_edges"]

_NOISE_FLOOR = 1.0 / 1024.0  # of a channel: rounding to 8 bits
_WEAK, _STRONG = 3.0, 6.0  # significance of points: the step over the standard error of the difference of its sides
_STEP_RESPONSE = math.sqrt(2.0 * math.pi) / 2.0  # a step over its gradient times radius: weights of sigma r / 2 in all


@dataclass(frozen=True, eq=False)
class ColorEdges:
    """Where the color of a cloud has a step.

    Attributes
    ----------
    strength : (N,) float64
        The step's contrast, the length of its difference over the channels, at most 1; 0 where there is no edge.
    direction : (N, 3) float64
        Unit tangent of the edge, its sign arbitrary; NaN where there is no edge.
    noise : (C,) float64
        Standard deviation of each channel's noise, estimated from the data.
    """

    strength: np.ndarray
    direction: np.ndarray
    noise: np.ndarray


def color_edges(
    index: NeighborIndex,
    xyz: np.ndarray,
    normals: np.ndarray,
    channels: np.ndarray,
    *,
    low: float = 0.1,
    high: float = 0.2,
    num_neighbors: int = 24,
) -> ColorEdges:
    """Find the points at which the color of a surface has a step.

    Smooth: weighted means of the neighbours. Gradient: a plane fitted to each channel over the tangent plane. Thin: the
    gradient's profile across the edge has its peak nearer to the point than to others abreast, and is a peak, not the
    plateau of a ramp. Double threshold: on the contrast of the raw colors on either side, which has to stand out from
    their noise as well, the whole cloud's and that about the point. Hysteresis: along chains of edge points.

    Parameters
    ----------
    index : NeighborIndex
        Of the points.
    xyz : (N, 3) float64
        The points themselves.
    normals : (N, 3) float64
        Unit normals, their sign arbitrary; points without one (NaN) are no edge.
    channels : (N, C) float64
        Colors in [0, 1], as made by `color_channels`; NaN where there is none.
    low, high : float
        Least contrast of an edge's points and of its strongest, ``0 < low <= high``. Sobel's operator on an 8-bit
        image gives 102 and 204 there, near the 100 and 200 that are habitual for Canny's.
    num_neighbors : int
        Neighbourhood of each step, the point among them; at least 8. More average more noise and lose finer detail.

    Returns
    -------
    ColorEdges
        In the order of the input, and the same whatever that is.

    Examples
    --------
    >>> import numpy as np
    >>> from edgel._neighbors.kdtree import build_index
    >>> x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    >>> xyz = np.c_[x.ravel(), y.ravel(), 0 * x.ravel()]
    >>> found = color_edges(build_index(xyz), xyz, np.tile([0.0, 0, 1], (400, 1)), 0.5 * (xyz[:, :1] > 9))
    >>> set(xyz[found.strength > 0, 0].tolist()), float(found.strength.max())
    ({10.0}, 0.5)
    """
    if not 0 < low <= high:
        raise ValueError(f"low, high: expected 0 < low <= high, got low={low}, high={high}")
    if num_neighbors < 8:
        raise ValueError(f"num_neighbors: expected at least 8, got {num_neighbors}")
    k = min(num_neighbors, len(index))
    raw, sorted_normals = channels[index.order], np.nan_to_num(normals[index.order])
    smooth, residuals = np.empty_like(raw), np.empty_like(raw)
    visit_neighbors(smooth_colors, every_place(index), index, k, raw, smooth, residuals)
    noise = _noise(residuals)
    gradients = np.zeros((len(index), 4))
    visit_neighbors(color_gradient, every_place(index), index, k, sorted_normals, smooth, gradients)

    found = ColorEdges(np.zeros(len(index)), np.full((len(index), 3), np.nan), noise)
    # What follows is needed only where the gradient could belong to a step of half the lower threshold.
    places = np.flatnonzero(gradients[:, 0] * _STEP_RESPONSE > low / 2)
    if len(places) == 0:
        return found
    steps = np.zeros((len(places), 7))
    visit_neighbors(
        color_step, at_places(index, places), index, k, places, raw, noise, sorted_normals, gradients, steps
    )
    weak = (steps[:, 0] >= low) & (steps[:, 1] >= _WEAK)
    if not weak.any():
        return found
    places, steps = places[weak], steps[weak]
    rows = index.order[places]
    ridge = non_maximum_suppression(xyz[rows], gradients[places, 1:], steps[:, 2], steps[:, 3])
    rows, steps = rows[ridge], steps[ridge]
    kept = hysteresis(xyz[rows], steps[:, 2], (steps[:, 0] >= high) & (steps[:, 1] >= _STRONG))
    found.strength[rows[kept]] = np.minimum(steps[kept, 0], 1.0)
    found.direction[rows[kept]] = steps[kept, 4:]
    return found


def _noise(residuals: np.ndarray) -> np.ndarray:
    """Standard deviation of each channel from the median deviation, which edges, being few, leave as it is."""
    known = residuals[~np.isnan(residuals[:, 0])]
    if len(known) == 0:
        return np.full(residuals.shape[1], _NOISE_FLOOR)
    return np.maximum(1.4826 * np.median(known, axis=0), _NOISE_FLOOR)
