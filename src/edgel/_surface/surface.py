"""The surface of a cloud, looked at from any side: each step is taken when it is first asked for, and timed."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from edgel._faces import Faces
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.normals import fit_planes, towards
from edgel._neighbors.queries import at_points
from edgel._stages import Stages
from edgel._surface.classify import Classification, classify
from edgel._surface.faces import localize
from edgel._surface.screen import Screening, screen
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
    def screening(self) -> Screening:
        """Where an edge could be."""
        index = self.index
        with self._stages("screening"):
            return screen(index, cloud_statistics(index))

    @cached_property
    def classified(self) -> Classification:
        """How likely an edge is there."""
        index, screening = self.index, self.screening
        with self._stages("classification"):
            return classify(index, screening)

    def faces(self, edge: np.ndarray, kind: np.ndarray, num_neighbors: int, viewpoint: np.ndarray | None) -> Faces:
        """Say where the edge runs at points (E,), ascending, of kinds (E,), and how the surface lies on either side.

        Normals are turned towards the viewpoint, or upwards (+Z) without one.
        """
        planes = fit_planes(self.index, at_points(self.index, edge), num_neighbors)
        planes = towards(planes, self.xyz[edge], viewpoint)
        creases = self.classified.take(np.isin(self.classified.points, edge[(kind & EdgeKind.CREASE) > 0]))
        ends = (kind & OUTLINES) > 0
        outermost = self.classified.points[self.classified.outline > SURE]
        return localize(self.index, self.xyz, edge, planes, num_neighbors, creases, ends, outermost, viewpoint)
