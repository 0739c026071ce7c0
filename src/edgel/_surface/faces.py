"""Where exactly an edge runs, and the surface on either side: from the best of the fits of two planes."""

from __future__ import annotations

import math

import numpy as np

from edgel._faces import Faces, facing
from edgel._surface import hinge
from edgel._surface.classify import Classification
from edgel._surface.evidence import MIN_TURN, Evidence


def localize(
    creases: Classification, edge: np.ndarray, xyz: np.ndarray, normals: np.ndarray, viewpoint: np.ndarray | None
) -> Faces:
    """Say where exactly the edge runs at each edge point, and how the surface lies on either side.

    Parameters
    ----------
    creases : Classification
        Of those edge points that lie on a crease.
    edge : (E,) int64
        The edge points, ascending.
    xyz : (N, 3) float64
        All points.
    normals : (E, 3) float64
        Of one plane fitted at each edge point: the first normal where no crease is known.
    viewpoint : (3,) float64 or None
        Normals are turned towards it, or upwards (+Z) without one.

    Returns
    -------
    Faces
        One row an edge point; where no crease is known the position is the point itself.
    """
    found = crease_faces(creases.evidence, xyz[creases.points], viewpoint)
    known = found.convex != 0
    at = np.searchsorted(edge, creases.points[known])
    faces = Faces.of_points(xyz[edge], normals)
    faces.put(at, found, known)
    return faces


def crease_faces(evidence: Evidence, xyz: np.ndarray, viewpoint: np.ndarray | None) -> Faces:
    """Describe the crease at each point (M, 3) by the fit that places it best (`Evidence.fit`).

    Normals are turned towards the viewpoint, or upwards (+Z) without one.
    """
    found = evidence.fit.astype(np.float64)
    a, b, line, foot, middle_a, middle_b = (
        found[:, i : i + 3]
        for i in (
            hinge.FIRST_NORMAL,
            hinge.SECOND_NORMAL,
            hinge.LINE,
            hinge.FOOT,
            hinge.FIRST_CENTROID,
            hinge.SECOND_CENTROID,
        )
    )
    wing_a, wing_b = _wing(middle_a - foot, line), _wing(middle_b - foot, line)
    turn = math.pi - np.arccos(np.clip((wing_a * wing_b).sum(axis=1), -1, 1))
    known = evidence.placed & (turn > MIN_TURN)
    # Turned so that each normal points away from the other face's wing, both lie on the outside of the wedge.
    a, b = _away_from(a, wing_b), _away_from(b, wing_a)
    normals, sign = facing(xyz, (a, b), viewpoint)
    unknown = np.where(known, 1.0, np.nan)[:, None]
    return Faces(
        position=xyz + foot * unknown,
        direction=line * unknown,
        normals=normals * unknown[:, None],
        angle=turn * unknown[:, 0],
        convex=np.where(known, sign, 0).astype(np.int8),
    )


def _wing(into: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Unit vectors from the line into a face."""
    across = into - (into * line).sum(axis=1, keepdims=True) * line
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return across / np.where(length > 0, length, np.nan)


def _away_from(normals: np.ndarray, wing: np.ndarray) -> np.ndarray:
    return np.where((normals * wing).sum(axis=1, keepdims=True) > 0, -normals, normals)
