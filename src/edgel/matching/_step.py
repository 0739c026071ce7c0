"""STEP files as parts, by build123d (``pip install 'edgel[step]'``): triangles of each face, with its true normals."""

from __future__ import annotations

import os
from importlib import import_module
from typing import Any

import numpy as np

from edgel.io import FormatError
from edgel.matching._mesh import triangles_of

_CHORD, _BEND = 1e-3, 0.2  # of the size, and radians: by which facets may lie off the faces
_SINGULAR = 1e-9


def read_step(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Read the triangles of a STEP file and the normals of its faces at their corners, both (T, 3, 3), mm."""
    if not os.path.isfile(name):
        raise FormatError(f"{name}: no such file")
    try:
        cad: Any = import_module("build123d")
    except ImportError as error:
        raise FormatError(f"{name}: STEP needs build123d; install it with `pip install 'edgel[step]'`") from error
    try:
        shape = cad.import_step(name)
        faces, size = shape.faces(), shape.bounding_box().diagonal
    except Exception as error:  # the kernel raises whatever a damaged file leads it to
        raise FormatError(f"{name}: no STEP file that build123d reads ({error}); export it again") from None
    if not len(faces):
        raise FormatError(f"{name}: holds no surface; export the part as a solid")
    _ocp("BRepMesh", "BRepMesh_IncrementalMesh")(shape.wrapped, _CHORD * size, False, _BEND, False)
    parts = [part for face in faces if (part := _face(face.wrapped)) is not None]
    return np.concatenate([corners for corners, _ in parts]), np.concatenate([normals for _, normals in parts])


def _ocp(module: str, name: str) -> Any:
    """Return a name of the CAD kernel, which build123d brings and which has no types."""
    return getattr(import_module(f"OCP.{module}"), name)


def _face(face: Any) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the triangles of a face and its normals, flat ones where the surface has a singular point."""
    place = _ocp("TopLoc", "TopLoc_Location")()
    tool = _ocp("BRep", "BRep_Tool")
    mesh, surface = tool.Triangulation_s(face, place), tool.Surface_s(face)
    if mesh is None:
        return None
    properties, transform = _ocp("GeomLProp", "GeomLProp_SLProps"), place.Transformation()
    places, outward = np.empty((mesh.NbNodes(), 3)), np.full((mesh.NbNodes(), 3), np.nan)
    for i in range(mesh.NbNodes()):
        at, uv = mesh.Node(i + 1).Transformed(transform), mesh.UVNode(i + 1)
        places[i] = at.X(), at.Y(), at.Z()
        local = properties(surface, uv.X(), uv.Y(), 1, _SINGULAR)
        if local.IsNormalDefined():
            normal = local.Normal()
            outward[i] = normal.X(), normal.Y(), normal.Z()
    rows = np.array([mesh.Triangle(i + 1).Get() for i in range(mesh.NbTriangles())]).reshape(-1, 3) - 1
    turned = face.Orientation() == _ocp("TopAbs", "TopAbs_REVERSED")
    rows = rows[:, ::-1] if turned else rows
    corners = places[rows]
    rows = rows[np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 0]
    if not len(rows):
        return None
    corners, flat = triangles_of(places, rows)
    normals = outward[rows] * (-1.0 if turned else 1.0)
    return corners, np.where(np.isfinite(normals), normals, flat)
