"""The surface of a cloud, looked at from any side: each step is taken when it is first asked for, and timed."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from edgel._faces import Faces
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.normals import fit_nearest, towards
from edgel._neighbors.queries import at_points
from edgel._stages import Stages
from edgel._surface.classify import Classification, classify
from edgel._surface.faces import localize
from edgel._surface.line import Strengths, strengths
from edgel._surface.screen import Screening, screen
from edgel._surface.smoothing import smoothed
from edgel._surface.statistics import cloud_statistics
from edgel.edges import OUTLINES, EdgeKind

SURE = 0.45  # probability of points that tell those beside them where the surface ends


class Surface:
    """Neighbourhoods of a cloud and what they tell.

    Parameters
    ----------
    xyz : (N, 3) float64, finite
    stages : Stages
    """

    def __init__(self, xyz: np.ndarray, stages: Stages) -> None:
        self.xyz = xyz
        self._stages = stages

    @cached_property
    def index(self) -> NeighborIndex:
        """The one tree over all points."""
        with self._stages("index"):
            return build_index(self.xyz)

    @cached_property
    def smoothed(self) -> NeighborIndex:
        """The tree over the points where the detector looks at them: moved as far as the noise asks for."""
        index = self.index
        with self._stages("smoothing"):
            return smoothed(index)

    @cached_property
    def screening(self) -> Screening:
        """Where an edge could be."""
        index = self.smoothed
        with self._stages("screening"):
            return screen(index, cloud_statistics(index))

    @property
    def normals(self) -> np.ndarray:
        """Normals of the screening's middle scale by point, (N, 3) float64; NaN where there is none."""
        return self.screening.normals_of_points(self.smoothed)

    @cached_property
    def classified(self) -> Classification:
        """How likely an edge is there."""
        index, screening = self.smoothed, self.screening
        with self._stages("classification"):
            return classify(index, screening)

    @cached_property
    def strengths(self) -> Strengths:
        """How marked the edges are there."""
        index, found = self.smoothed, self.classified
        with self._stages("classification"):
            return Strengths(found.points, *(strengths(index, found.points, p) for p in (found.crease, found.outline)))

    def faces(self, edge: np.ndarray, kind: np.ndarray, num_neighbors: int, viewpoint: np.ndarray | None) -> Faces:
        """Say where the edge runs at points (E,), ascending, of kinds (E,), and how the surface lies on either side.

        Normals are turned towards the viewpoint, or upwards (+Z) without one.
        """
        outermost = self.xyz[self.classified.points[self.classified.outline > SURE]]
        return locate(self.index, self.smoothed, self.classified, outermost, edge, kind, num_neighbors, viewpoint)


def locate(
    index: NeighborIndex,
    smoothed: NeighborIndex,
    classified: Classification,
    outermost: np.ndarray,
    edge: np.ndarray,
    kind: np.ndarray,
    num_neighbors: int,
    viewpoint: np.ndarray | None,
) -> Faces:
    """Say what `Surface.faces` does, of a cloud or a part of it; the surface ends at `outermost` (K, 3)."""
    planes = fit_nearest(index, at_points(index, edge), num_neighbors)
    planes = towards(planes, index.at(index.places_of(edge)), viewpoint)
    creases = classified.take(np.isin(classified.points, edge[(kind & EdgeKind.CREASE) > 0]))
    ends = (kind & OUTLINES) > 0
    return localize(index, smoothed, edge, planes, num_neighbors, creases, ends, outermost, viewpoint)
