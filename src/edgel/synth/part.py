"""Part: surfaces and the true edges between them, seen from above."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from edgel.synth.edges import EdgeCurve
from edgel.synth.surfaces import Surface


@dataclass(frozen=True, eq=False)
class Hits:
    """What vertical rays from above meet first.

    Attributes
    ----------
    z : float64, the shape of the rays
        Height, mm; NaN where nothing is hit.
    normals : float64, the shape of the rays and (3,)
        Outward unit normal of the surface there; NaN where nothing is hit.
    surface : int64, the shape of the rays
        Which of the part's surfaces it is, -1 where none.
    """

    z: np.ndarray
    normals: np.ndarray
    surface: np.ndarray


@dataclass(frozen=True, eq=False)
class Part:
    """A part lying flat, described analytically.

    To make a new part, list its surfaces and draw the edges that are visible from above; everything else follows.

    Attributes
    ----------
    name : str
    surfaces : tuple of Surface
        The highest one at x, y is the one seen.
    edges : tuple of EdgeCurve
        The true edges visible from above (+Z).
    num_points : int
        How many points a scan of it has unless told otherwise.
    dimensions : mapping of str to float
        The lengths it was made from, mm.

    Examples
    --------
    >>> import numpy as np
    >>> from edgel import synth
    >>> hits = synth.tee().look(np.array([0.0, 0.0, 90.0]), np.array([0.0, 100.0, 90.0]))
    >>> hits.z
    array([57.15, 57.15,   nan])
    >>> hits.surface
    array([ 0,  1, -1])
    """

    name: str
    surfaces: tuple[Surface, ...]
    edges: tuple[EdgeCurve, ...]
    num_points: int
    dimensions: Mapping[str, float] = field(default_factory=dict)

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest x, y of the part seen from above, (2, 2), mm."""
        boxes = np.array([surface.bounds for surface in self.surfaces])
        return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Height z (mm) of the part at x, y (mm, any one shape); NaN where nothing is hit."""
        return self._highest(np.asarray(x, float), np.asarray(y, float))[0]

    def look(self, x: np.ndarray, y: np.ndarray) -> Hits:
        """Follow vertical rays at x, y (mm, any one shape) from above to what they meet first."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        z, surface = self._highest(x, y)
        normals = np.full((*z.shape, 3), np.nan)
        for number, one in enumerate(self.surfaces):
            seen = surface == number
            normals[seen] = one.normals(np.column_stack([x[seen], y[seen], z[seen]]))
        return Hits(z, normals, surface)

    def _highest(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if x.shape != y.shape:
            raise ValueError(f"x and y: expected one shape, got {x.shape} and {y.shape}")
        best, surface = np.full(x.size, -np.inf), np.full(x.size, -1)
        for number, one in enumerate(self.surfaces):
            z = one.height(x.ravel(), y.ravel())
            higher = z > best  # false for NaN
            best[higher] = z[higher]
            surface[higher] = number
        best[surface < 0] = np.nan
        return best.reshape(x.shape), surface.reshape(x.shape)
