"""`edgel.Model`: a part to be found, prepared once."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from edgel._neighbors.thinning import thin_to
from edgel._objects import NORMALS
from edgel._stages import Stages
from edgel.cloud import Cloud
from edgel.edges import Edges
from edgel.matching._files import read_part
from edgel.matching._instances import find_instances
from edgel.matching._mesh import creases_of, spread_over, triangles_of
from edgel.matching._prepare import MOST_SURFACE, Prepared, away_from, prepare
from edgel.matching._registration import Registration
from edgel.matching._sight import no_sight
from edgel.matching._symmetry import symmetries_of

_SMOOTH = 0.03  # of the size from any edge, from where on the surface is smooth


class Model:
    """A part to be found in scenes: exact edges and surface of a mesh or STEP file.

    Parameters
    ----------
    part : path, or (vertices, triangles), or an object that carries `vertices` and `faces`
        A closed mesh, its triangles counterclockwise seen from outside, in the unit of the scenes. Files: STL, PLY, OBJ
        or OFF (``pip install 'edgel[mesh]'``), STEP (``pip install 'edgel[step]'``; its unit is the millimetre).
    scale : float
        By which lengths are multiplied: .001 takes millimetres to scenes in metres.
    symmetries : (S, 4, 4) array_like, optional
        Moves that leave the part as it is. Default: they are found.

    Attributes
    ----------
    corners, normals : (T, 3, 3) float64
        Of the triangles; normals are those of the surface: of a STEP file's faces, or of a mesh's triangles.

    Raises
    ------
    FormatError
        If a file is no mesh or STEP, is damaged, or what reads it is not installed.
    TypeError, ValueError
        If it is no mesh, or an option is out of its range.

    Examples
    --------
    >>> from edgel import Model, synth
    >>> solid = synth.stepped_block()
    >>> model = Model((solid.vertices, solid.triangles))
    >>> scene = synth.view(solid, projection="pinhole", spacing=1.5)
    >>> found = model.find(scene.cloud)
    >>> len(found), bool(abs(found[0].T_target_source - scene.pose).max() < 0.5)
    (1, True)
    """

    def __init__(self, part: Any, *, scale: float = 1.0, symmetries: Any = None) -> None:
        if not 0 < scale < np.inf:
            raise ValueError(f"scale: expected a number above 0, got {scale}")
        if isinstance(part, str | os.PathLike):
            self.name = Path(part).stem
            corners, normals = read_part(part)
        else:
            self.name = type(part).__name__
            corners, normals = triangles_of(*_parts_of(part))
        self.corners, self.normals = scale * corners, normals
        self._symmetries = None if symmetries is None else _as_moves(symmetries)

    def __repr__(self) -> str:
        return f"Model({self.name}: {len(self.corners):,} triangles, size {self.prepared.size:.4g})"

    @cached_property
    def prepared(self) -> Prepared:
        """What is looked for: half-edges and surface."""
        half = creases_of(self.corners, self.normals)
        size = float(np.linalg.norm(np.ptp(self.corners.reshape(-1, 3), axis=0)))
        places, normals = spread_over(self.corners, self.normals, MOST_SURFACE)
        area = float(np.linalg.norm(np.cross(*np.diff(self.corners, axis=1).transpose(1, 0, 2)), axis=1).sum() / 2)
        rows = thin_to(places, MOST_SURFACE, np.sqrt(area / len(places)))
        places, normals = places[rows], normals[rows]
        smooth = away_from(places, half.places, _SMOOTH * size) >= _SMOOTH * size
        gap = float(np.sqrt(area / len(places)))
        return Prepared(half, places, normals, smooth, gap, 0.0, size, no_sight())

    @cached_property
    def symmetries(self) -> np.ndarray:
        """Moves (S, 4, 4) that leave the part as it is, the identity first; any turn about an axis as 72 of them."""
        return self._symmetries if self._symmetries is not None else symmetries_of(self.prepared)

    def to_cloud(self) -> Cloud:
        """Return places evenly over the surface as a cloud with its normals (nx, ny, nz)."""
        columns = {name: self.prepared.normals[:, i].astype(np.float32) for i, name in enumerate(NORMALS)}
        return Cloud(self.prepared.surface, columns)

    def creases(self, lift: float = 0.0) -> np.ndarray:
        """Return places closely along the creases, (M, 3), lifted off the faces beside them, as to draw them."""
        half = self.prepared.half
        turn = np.nan_to_num(half.turn)[:, None] / 2
        between = np.cos(turn) * half.frames[:, 1] - np.sin(turn) * half.frames[:, 0]  # of the two faces' normals
        return half.places + lift * half.bend[:, None] * between

    def find(
        self, scene: Any, *, edges: Edges | None = None, most: int = 1, max_correspondence_distance: float | None = None
    ) -> list[Registration]:
        """Find the part in a scene, the surest first.

        Parameters
        ----------
        scene : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        edges : Edges, optional
            What `edgel.detect` found in it.
        most : int
            How many instances are looked for, at least 1.
        max_correspondence_distance : float, optional
            See `edgel.register`.

        Returns
        -------
        list of Registration
            Those found, of which no two explain the same places of the scene; empty where there are none.

        Raises
        ------
        TypeError, ValueError
            See `edgel.register`.
        """
        if most < 1:
            raise ValueError(f"most: expected a number of instances of at least 1, got {most}")
        stages = Stages()
        with stages("target"):
            target = prepare(scene, edges, "scene")
        return find_instances(self.prepared, target, self.symmetries, most, max_correspondence_distance, stages)


def _parts_of(part: Any) -> tuple[Any, Any]:
    if isinstance(part, tuple | list) and len(part) == 2:
        return part[0], part[1]
    vertices, faces = getattr(part, "vertices", None), getattr(part, "faces", None)
    if vertices is not None and faces is not None:
        return vertices, faces
    raise TypeError(f"part: expected a file, (vertices, triangles) or a mesh, got {type(part).__name__}")


def _as_moves(symmetries: Any) -> np.ndarray:
    moves = np.asarray(symmetries, np.float64)
    if moves.ndim != 3 or moves.shape[1:] != (4, 4) or not np.isfinite(moves).all():
        raise ValueError(f"symmetries: expected moves of shape (S, 4, 4), got {moves.shape}")
    return np.concatenate([np.eye(4)[None], moves])
