"""How likely an edge runs through each point: what strengths are drawn from, for those who draw the line themselves."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel._stages import Stages
from edgel._surface import Surface
from edgel.cloud import as_cloud, check_points


def probabilities(points: Any) -> np.ndarray:
    """Say how likely each point of a cloud is an edge point, as features for whatever is learned of it.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points

    Returns
    -------
    (N, 2) float64
        Probability that a crease runs through the cell of each point, and that the surface ends there (a boundary), by
        its neighbourhood on the surface, however the cloud was seen. No threshold and no `min_strength` is applied; 0
        where a first look at the smooth surroundings rules an edge out, NaN where the point is not finite.

    Raises
    ------
    TypeError, ValueError
        As `detect` does.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    >>> crease, boundary = edgel.probabilities(roof).T
    >>> float(roof[crease.argmax(), 0])
    20.0
    """
    finite = check_points(as_cloud(points))
    found = np.full((finite.num_input, 2), np.nan)
    found[finite.rows] = Surface(finite.xyz, Stages()).probabilities()
    return found
