"""Read and write point clouds: one module a format, chosen by the extension of the file.

``READERS`` and ``WRITERS`` map extensions to functions; `read` and `write` look them up and check the content.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import numpy as np

from edgel._intrinsics import Intrinsics
from edgel.cloud import Cloud
from edgel.io import depth, e57, e57_write, floats, mesh, npy, obj, pcd, ply, ptx, text, text_write
from edgel.io.depth import read_intrinsics
from edgel.io.errors import FormatError, FormatWarning, printable
from edgel.io.files import check_readable, describe

__all__ = ["READERS", "WRITERS", "FormatError", "FormatWarning", "Intrinsics", "read", "read_intrinsics", "write"]


def _read_las(path: str | os.PathLike[str]) -> Cloud:
    from edgel.io import las  # not at the top: laspy takes time to import, most files are not LAS

    return las.read(path)


def _write_las(path: str | os.PathLike[str], cloud: Cloud) -> None:
    from edgel.io import las

    las.write(path, cloud)


_TEXT = (".xyz", ".txt", ".csv", ".asc", ".pts")
_DEPTH = (".png", ".tif", ".tiff")

READERS: dict[str, Callable[[Any], Cloud]] = {
    ".ply": ply.read,
    ".pcd": pcd.read,
    ".las": _read_las,
    ".laz": _read_las,
    **dict.fromkeys(_TEXT, text.read),
    ".ptx": ptx.read,
    ".npy": npy.read_npy,
    ".npz": npy.read_npz,
    ".e57": e57.read,
    ".bin": floats.read,
    ".obj": obj.read,
    **dict.fromkeys(_DEPTH, depth.read),
}
"""Functions ``(path) -> Cloud`` by extension, lower case."""

WRITERS: dict[str, Callable[[Any, Cloud], None]] = {
    ".ply": ply.write,
    ".pcd": pcd.write,
    ".las": _write_las,
    ".laz": _write_las,
    **dict.fromkeys(_TEXT, text_write.write),
    ".npy": npy.write_npy,
    ".npz": npy.write_npz,
    ".e57": e57_write.write,
}
"""Functions ``(path, cloud)`` by extension, lower case."""

MEANT_FOR: dict[str, tuple[str, ...]] = {
    "intrinsics": (*_DEPTH, ".npy"),
    "columns": (*_TEXT, ".bin"),
    "sample_mesh": mesh.EXTENSIONS,
}
"""Extensions of the files that each option of `read` is for."""

_NOT_CLOUDS = {
    **dict.fromkeys((".stl", ".off"), f"a mesh, not a point cloud; {mesh.OFFER}"),
    **dict.fromkeys(
        (".3mf", ".gltf", ".glb", ".dae"), "a mesh, not a point cloud; save it as .ply, .obj or .stl first"
    ),
    **dict.fromkeys((".step", ".stp", ".iges", ".igs", ".brep"), "a CAD model, not a point cloud; sample it first"),
    **dict.fromkeys((".mcap", ".bag", ".db3"), "a ROS recording, not supported; convert its clouds to .pcd first"),
    **dict.fromkeys((".jpg", ".jpeg", ".bmp", ".exr"), "an image; depth is read from .png, .tif or .npy"),
    **dict.fromkeys((".gz", ".zip", ".7z", ".xz", ".bz2"), "compressed; unpack it first"),
}


def read(
    path: str | os.PathLike[str] | BinaryIO,
    *,
    intrinsics: Any = None,
    columns: str | Sequence[str] | None = None,
    sample_mesh: int | None = None,
) -> Cloud:
    """Read a point cloud; the extension tells the format, the content is checked.

    Parameters
    ----------
    path : path or binary file
        PLY, PCD, LAS, LAZ (COPC too), XYZ, TXT, CSV, ASC, PTS, PTX, NPY, NPZ, E57, BIN (KITTI, nuScenes), OBJ, or a
        depth image (PNG, TIFF, NPY). An open binary file (``sys.stdin.buffer``) is read as PLY.
    intrinsics : Intrinsics, path, or another camera, optional
        The camera of a depth image (see `edgel.from_depth`), or the file that holds it (see `read_intrinsics`).
    columns : str or sequence of str, optional
        Names of the columns of a text or a BIN, such as ``"x,y,z,intensity"``; ``_`` leaves a column out.
    sample_mesh : int, optional
        How many points to sample from the surface of a mesh (PLY, OBJ, STL, OFF), evenly by area.

    Returns
    -------
    Cloud
        Float64 coordinates in the file's unit, everything else it says about the points as attributes. What the file
        holds besides is named in ``metadata["left_out"]``, and what its user should know in ``metadata["notices"]``.

    Raises
    ------
    FileNotFoundError, IsADirectoryError, PermissionError
        If there is no such file that can be read.
    FormatError
        If the extension is unknown, the content is something else, or the file is cut off or damaged.
    ValueError
        If `intrinsics`, `columns` or `sample_mesh` are given for a file that has no use for them.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(f"{folder}/a.ply", Cloud(np.eye(3), {"label": np.array([1, 2, 3], np.uint8)}))
    ...     read(f"{folder}/a.ply")
    Cloud(3 points, unorganized; attributes: label)
    """
    # A NaN of a damaged or foreign file is a point that is missing, not a fault of arithmetic to warn of.
    with np.errstate(all="ignore"):
        return _read(path, intrinsics, columns, sample_mesh)


def _read(
    path: str | os.PathLike[str] | BinaryIO,
    intrinsics: Any,
    columns: str | Sequence[str] | None,
    num_points: int | None,
) -> Cloud:
    if not isinstance(path, (str, os.PathLike)):
        _check_stream(path, "read")
        _check_use("an open file", "", intrinsics=intrinsics, columns=columns, sample_mesh=num_points)
        return ply.read(path)
    extension, name = Path(path).suffix.lower(), printable(path)
    check_readable(path)
    if extension not in READERS and not (num_points is not None and extension in mesh.EXTENSIONS):
        _unknown(path, extension, READERS)
    _check_use(name, extension, intrinsics=intrinsics, columns=columns, sample_mesh=num_points)
    if num_points is not None:
        return mesh.sample(path, num_points)
    if intrinsics is not None:
        return depth.read(path, intrinsics=intrinsics)
    if columns is not None:
        return floats.read(path, columns=columns) if extension == ".bin" else text.read(path, columns=columns)
    return READERS[extension](path)


def _check_use(name: str, extension: str, **options: Any) -> None:
    """Raise ValueError for options that a file has no use for."""
    words = {"intrinsics": "depth image", "columns": "text or sweep", "sample_mesh": "mesh"}
    for option, value in options.items():
        if value is not None and extension not in MEANT_FOR[option]:
            what = f"{words[option]} ({', '.join(MEANT_FOR[option])})"
            raise ValueError(f"{option}: {name} is no {what}; name another file, or leave the option out")


def write(path: str | os.PathLike[str] | BinaryIO, cloud: Cloud) -> None:
    """Write a point cloud; the extension tells the format. The file appears whole or not at all.

    Parameters
    ----------
    path : path or binary file
        PLY, PCD, LAS, LAZ, COPC (``.copc.laz``), XYZ, TXT, CSV, ASC, PTS, NPY, NPZ or E57. An open binary file
        (``sys.stdout.buffer``) gets PLY.
    cloud : Cloud
        What each format keeps is said in its module; values are never rounded silently, save coordinates to the grid of
        LAS and, below 10,000, to the single precision of PCD.

    Warns
    -----
    FormatWarning
        If an attribute is left out or renamed, or coordinates are shifted or rounded; its ``said`` tells which and why.

    Raises
    ------
    FormatError
        If the extension is unknown, or the format cannot hold the coordinates; the message tells the remedy.
    OSError
        If the file cannot be written; nothing is left behind.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(f"{folder}/a.pcd", Cloud(np.eye(3)))
    ...     len(read(f"{folder}/a.pcd"))
    3
    """
    if not isinstance(cloud, Cloud):
        raise TypeError(f"cloud: expected a Cloud, got {type(cloud).__name__}; make one with edgel.Cloud(points)")
    if not isinstance(path, (str, os.PathLike)):
        _check_stream(path, "write")
        ply.write(path, cloud)
        return
    extension = Path(path).suffix.lower()
    if extension not in WRITERS:
        _unknown(path, extension, WRITERS)
    WRITERS[extension](path, cloud)


def _check_stream(file: Any, method: str) -> None:
    if not hasattr(file, method):
        raise TypeError(f"path: expected a path or a binary file, got {type(file).__name__}")
    if hasattr(file, "encoding"):
        raise TypeError("path: a text file; pass the binary one (sys.stdin.buffer, sys.stdout.buffer, open(..., 'rb'))")


def _unknown(path: str | os.PathLike[str], extension: str, known: dict[str, Any]) -> NoReturn:
    name, formats = os.fspath(path), " ".join(known)
    if extension in _NOT_CLOUDS:
        raise FormatError(f"{name}: {_NOT_CLOUDS[extension]} (known: {formats})")
    seems = ""
    if known is READERS:
        with open(path, "rb") as file:
            what, remedy = describe(file.read(512))
        seems = f"; the file seems to be {what}: {remedy}"
    raise FormatError(f"{name}: the extension {extension!r} is unknown (known: {formats}){seems}")
