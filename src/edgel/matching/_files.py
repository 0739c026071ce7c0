"""Files of parts: meshes and STEP."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from edgel.io import FormatError
from edgel.io.mesh import EXTENSIONS, load
from edgel.matching._mesh import triangles_of
from edgel.matching._step import read_step

STEPS = (".step", ".stp")
FILES = (*EXTENSIONS, *STEPS)


def read_part(path: str | os.PathLike[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read the triangles of a part and the normals of its surface at their corners, both (T, 3, 3).

    Raises
    ------
    FormatError
        If the file is none of a mesh or STEP, is damaged, or what reads it is not installed.
    """
    name, kind = os.fspath(path), Path(path).suffix.lower()
    if kind in STEPS:
        return read_step(name)
    if kind not in EXTENSIONS:
        raise FormatError(f"{name}: a part is a mesh ({', '.join(EXTENSIONS)}) or STEP ({', '.join(STEPS)})")
    mesh = load(path)
    return triangles_of(mesh.vertices, mesh.faces)
