"""Points on the surface of a mesh (PLY, OBJ, STL, OFF), by trimesh (``pip install 'edgel[mesh]'``)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from edgel._objects import NORMALS
from edgel.cloud import Cloud
from edgel.io.errors import FormatError, printable
from edgel.io.files import reading
from edgel.io.ply_header import read_header

EXTENSIONS = (".ply", ".obj", ".stl", ".off")
OFFER = "sample its surface: --sample-mesh 200000 (sample_mesh= in Python)"
_MOST_POINTS = 100_000_000


def sample(path: str | os.PathLike[str], num_points: int) -> Cloud:
    """Sample the surface of a mesh evenly by area: no two points lie much closer than others.

    Parameters
    ----------
    path : path
        PLY, OBJ, STL or OFF with faces.
    num_points : int
        How many points; a few less where the surface is too crooked for as many so far apart.

    Returns
    -------
    Cloud
        With ``nx ny nz`` (float32), the unit normals of the faces as the mesh turns them. The same for the same mesh.

    Raises
    ------
    FormatError
        If the file is no mesh, is damaged, or trimesh is not installed.
    ValueError
        If `num_points` is no number of points from 1 to 100 million.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:  # doctest: +SKIP
    ...     file = pathlib.Path(folder, "a.off")
    ...     _ = file.write_text("OFF 3 1 0 0 0 0 1 0 0 0 1 0 3 0 1 2")
    ...     len(sample(file, 50))
    50
    """
    whole = isinstance(num_points, int | np.integer) and not isinstance(num_points, bool)
    if not whole or not 0 < num_points <= _MOST_POINTS:
        raise ValueError(
            f"sample_mesh: expected a number of points from 1 to {_MOST_POINTS}, got {printable(num_points, 40)}"
        )
    mesh = load(path)
    from trimesh.sample import sample_surface_even

    points, faces = sample_surface_even(mesh, int(num_points), seed=0)
    normals = np.asarray(mesh.triangles_cross[faces], np.float64)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    attributes = {axis: normals[:, i].astype(np.float32) for i, axis in enumerate(NORMALS)}
    return Cloud(np.asarray(points, np.float64), attributes)


def has_faces(path: str | os.PathLike[str]) -> bool:
    """Tell whether a PLY or OBJ file is a mesh, by its header or its lines, without reading it whole for PLY.

    Raises
    ------
    FormatError
        If the header of a PLY file is damaged.
    """
    with open(path, "rb") as file:
        if Path(path).suffix.lower() == ".obj":
            return any(line.split(None, 1)[:1] == [b"f"] for line in file)
        elements = read_header(os.fspath(path), file).elements
    return any(element.name == "face" and element.count > 0 for element in elements)


def load(path: str | os.PathLike[str]) -> Any:
    """Read a mesh that has faces with an area, as a `trimesh.Trimesh`.

    Raises
    ------
    FormatError
        If the file is no mesh, is damaged, or trimesh is not installed.
    """
    name = os.fspath(path)
    try:
        import trimesh
    except ImportError as error:
        raise FormatError(f"{name}: meshes need trimesh; install it with `pip install 'edgel[mesh]'`") from error
    try:
        with reading(path) as file:
            # Neither materials nor merged vertices are of use here, nor is any other file that it names read.
            mesh = trimesh.load_mesh(file, file_type=Path(path).suffix[1:].lower(), process=False, skip_materials=True)
        num_faces, area = len(mesh.faces), float(mesh.area)
    except (FormatError, OSError, MemoryError):
        raise
    except Exception as error:  # trimesh's readers raise whatever a damaged file leads them to
        raise FormatError(
            f"{name}: no mesh that trimesh reads ({error or type(error).__name__}); get it again"
        ) from None
    if not num_faces:
        raise FormatError(f"{name}: has no faces; its points are a cloud: read it as one (without --sample-mesh)")
    if not (np.isfinite(area) and area > 0):
        raise FormatError(f"{name}: the area of its faces is {area:g}; mend the mesh")
    return mesh
