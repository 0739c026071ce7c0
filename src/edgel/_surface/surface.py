"""The surface of a cloud, looked at from any side: each step is taken when it is first asked for, and timed."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from edgel._faces import Faces
from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.scan_lines import scan_line_stretch
from edgel._neighbors.spacing import cloud_spacing
from edgel._stages import Stages
from edgel._surface.classify import Classification, classify
from edgel._surface.coarser import CELL, FAINT, FEWEST, Carried, apart, carry, means_of_cells
from edgel._surface.faces import fit_locally
from edgel._surface.line import Strengths, strengths
from edgel._surface.plane_scales import SCALES
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
    coarsest : bool
        Whether no coarser look is taken, however noisy the cloud is.
    """

    def __init__(self, xyz: np.ndarray, stages: Stages, *, coarsest: bool = False) -> None:
        self.xyz = xyz
        self._stages, self._coarsest = stages, coarsest

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
    def stretch(self) -> np.ndarray | None:
        """What makes neighbourhoods on scan lines round, (3, N) by place of the smoothed tree; None without lines."""
        index = self.smoothed
        with self._stages("screening"):
            return scan_line_stretch(index)

    @cached_property
    def screening(self) -> Screening:
        """Where an edge could be."""
        index, stretch = self.smoothed, self.stretch
        with self._stages("screening"):
            return screen(index, cloud_statistics(index, stretch), stretch=stretch)

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

    def probabilities(self) -> np.ndarray:
        """How likely a crease and an outline are at every point, (N, 2), by the most that the detector asks of it."""
        index, screening, every = self.smoothed, self.screening, np.zeros((2, len(self.xyz)))
        with self._stages("classification"):
            classify(index, screening, every=every)
        return every.T

    @cached_property
    def _own_strengths(self) -> Strengths:
        """How marked the edges are by their own neighbours."""
        index, found = self.smoothed, self.classified
        with self._stages("classification"):
            return Strengths(found.points, *(strengths(index, found.points, p) for p in (found.crease, found.outline)))

    @cached_property
    def strengths(self) -> Strengths:
        """How marked the edges are there."""
        found = self._own_strengths
        return found if self._carried is None else found.join(self._carried.strengths)

    @cached_property
    def _cell(self) -> float:
        """Side of the cells of the coarser look."""
        return CELL * cloud_spacing(self.index)

    @cached_property
    def _coarser(self) -> Surface | None:
        """The means of cells, where the noise asks for them."""
        if self._coarsest or self.smoothed is self.index:
            return None
        xyz, _ = means_of_cells(self.smoothed.by_point(), self._cell)
        return Surface(xyz, self._stages, coarsest=True) if len(xyz) >= FEWEST else None

    @cached_property
    def _carried(self) -> Carried | None:
        """What the coarser look shows where this one shows nothing."""
        if (coarser := self._coarser) is None:
            return None
        index, found = self.smoothed, self._own_strengths
        seen = coarser.strengths
        seen = seen.take(seen.strongest >= FAINT)
        faces = coarser.faces(seen.points, seen.kinds(FAINT), SCALES[1], None)
        with self._stages("coarser look"):
            return apart(index, self._cell, found, carry(index, self._cell, seen, faces))

    def faces(self, edge: np.ndarray, kind: np.ndarray, num_neighbors: int, viewpoint: np.ndarray | None) -> Faces:
        """Say where the edge runs at points (E,), ascending, of kinds (E,), and how the surface lies on either side.

        Normals are turned towards the viewpoint, or upwards (+Z) without one.
        """
        of_cloud = (self.index, self.smoothed, self.stretch, self.classified)
        creases, ends = (kind & EdgeKind.CREASE) > 0, (kind & OUTLINES) > 0
        fits = fit_locally(*of_cloud, edge, creases, ends, num_neighbors, viewpoint)
        outermost = self.xyz[self.classified.points[self.classified.outline > SURE]]
        faces = fits.faces(kind, outermost, viewpoint)
        self._put_carried(faces, edge, num_neighbors, viewpoint)
        return faces

    def _put_carried(self, faces: Faces, edge: np.ndarray, num_neighbors: int, viewpoint: np.ndarray | None) -> None:
        """Put what the coarser look says of the edge points that it alone shows."""
        coarser, carried = self._coarser, self._carried
        if coarser is None or carried is None:
            return
        rows, sources = carried.seen_at(edge, self._own_strengths)
        asked, of_source = np.unique(sources, return_inverse=True)
        kinds = coarser.strengths.take(np.searchsorted(coarser.strengths.points, asked)).kinds(FAINT)
        found = coarser.faces(asked, kinds, num_neighbors, viewpoint)
        faces.put(rows, found.along(self.xyz[edge[rows]], of_source), slice(None))
