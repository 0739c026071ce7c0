"""E57 writing by pye57: one scan, coordinates in double precision."""

from __future__ import annotations

import os
import re
import signal
import threading
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np

from edgel.cloud import Cloud
from edgel.io.columns import flat_attributes
from edgel.io.errors import FormatError
from edgel.io.files import replacing

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
NAMES = {"colorRed": "red", "colorGreen": "green", "colorBlue": "blue"}
GRID = ("rowIndex", "columnIndex")
# Attributes that E57 itself does not define are written under this prefix of ours.
PREFIX, URI = "edgel", "https://edgel.readthedocs.io/e57"


def library(path: object) -> ModuleType:
    """Return pye57's binding of libE57, or raise the FormatError that tells how to install it."""
    try:
        from pye57 import libe57  # pyright: ignore[reportAttributeAccessIssue]
    except ImportError as error:
        raise FormatError(
            f"{path}: E57 files need the package pye57 ({error}); install it with `pip install edgel[e57]`"
        ) from None
    return libe57


def write(path: str | os.PathLike[str], cloud: Cloud) -> None:
    """Write an E57 file of one scan, coordinates in double precision.

    ``red green blue`` become ``colorRed`` and so on; attributes E57 does not define are written in an extension of
    the name ``edgel``. An organized cloud keeps its shape through ``rowIndex`` and ``columnIndex``; points that are not
    finite are marked invalid. The viewpoint goes into the scan's pose.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Raises
    ------
    FormatError
        If an attribute cannot be stored, `path` is a pipe or a device, or pye57 is not installed.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:  # doctest: +SKIP
    ...     write(f"{folder}/a.e57", Cloud(np.eye(3), viewpoint=np.array([0, 0, 5])))
    ...     read(f"{folder}/a.e57").viewpoint
    array([0., 0., 5.])
    """
    lib = library(path)
    columns = _fields(path, cloud)
    with replacing(path) as file:
        if not isinstance(file.name, str):
            raise FormatError(
                f"{os.fspath(path)}: E57 goes into no pipe or device; write a file, or .ply into the pipe"
            )
        try:
            with _uninterrupted():
                image = lib.ImageFile(file.name, "w")
                try:
                    _write_scan(lib, image, columns, cloud.viewpoint)
                finally:
                    image.close()
        except lib.E57Exception as error:
            reason = str(error).strip().splitlines()[0]
            raise OSError(f"{os.fspath(path)}: cannot be written ({reason}); is the disk full?") from None


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C back to the end: an interrupt between two calls of libe57 leaves objects that crash it."""
    if threading.current_thread() is not threading.main_thread():  # no other thread is ever interrupted
        yield
        return
    held: list[Any] = []
    usual = signal.getsignal(signal.SIGINT)
    if not callable(usual):  # ignored, or left to the system
        yield
        return
    signal.signal(signal.SIGINT, lambda *arguments: held.append(arguments))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
        if held:
            usual(*held[0])


def _fields(path: object, cloud: Cloud) -> dict[str, np.ndarray]:
    finite = np.isfinite(cloud.xyz).all(axis=1)
    position = np.zeros(3) if cloud.viewpoint is None else cloud.viewpoint
    local = cloud.xyz - position
    local[~finite] = 0
    columns: dict[str, np.ndarray] = {name: np.ascontiguousarray(local[:, i]) for i, name in enumerate(CARTESIAN)}
    if not finite.all():
        columns["cartesianInvalidState"] = np.where(finite, 0, 2).astype(np.int8)
    if cloud.shape is not None:
        rows, cols = np.divmod(np.arange(len(cloud)), cloud.shape[1])
        columns.update(rowIndex=rows, columnIndex=cols)
    standard = {short: long for long, short in NAMES.items()} | {"intensity": "intensity"}
    for name, values in flat_attributes(cloud, path).items():
        field = standard.get(name, f"{PREFIX}:" + re.sub(r"[^\w.-]", "_", name))
        if not re.fullmatch(rf"({PREFIX}:)?[A-Za-z_][A-Za-z0-9_.-]*", field) or field in columns:
            raise FormatError(f"{path}: attribute {name!r} has a name that E57 cannot hold or has twice; rename it")
        if values.dtype.kind == "u" and values.dtype.itemsize == 8 and values.max(initial=0) > np.iinfo(np.int64).max:
            raise FormatError(
                f"{path}: attribute {name!r} exceeds 64-bit signed integers, E57's widest; write .npz instead"
            )
        columns[field] = values
    return columns


def _write_scan(lib: ModuleType, image: Any, columns: dict[str, np.ndarray], viewpoint: np.ndarray | None) -> None:
    image.extensionsAdd("", lib.E57_V1_0_URI)
    image.extensionsAdd(PREFIX, URI)
    root = image.root()
    root.set("formatName", lib.StringNode(image, "ASTM E57 3D Imaging Data File"))
    root.set("guid", lib.StringNode(image, f"{{{uuid.uuid4()}}}"))
    root.set("versionMajor", lib.IntegerNode(image, lib.E57_FORMAT_MAJOR))
    root.set("versionMinor", lib.IntegerNode(image, lib.E57_FORMAT_MINOR))
    root.set("e57LibraryVersion", lib.StringNode(image, lib.E57_LIBRARY_ID))
    scans = lib.VectorNode(image, True)
    root.set("data3D", scans)
    scan = lib.StructureNode(image)
    scan.set("guid", lib.StringNode(image, f"{{{uuid.uuid4()}}}"))
    scan.set("name", lib.StringNode(image, "edgel"))
    if viewpoint is not None:
        scan.set("pose", _pose_node(lib, image, viewpoint))
    prototype, count = lib.StructureNode(image), len(columns[CARTESIAN[0]])
    buffers, arrays = lib.VectorSourceDestBuffer(), []
    for name, values in columns.items():
        node, array = _field_node(lib, image, values)
        prototype.set(name, node)
        arrays.append(array)  # the buffer only points to it
        buffers.append(lib.SourceDestBuffer(image, name, array, count, True, True))
    points = lib.CompressedVectorNode(image, prototype, lib.VectorNode(image, True))
    scan.set("points", points)
    scans.append(scan)
    writer = points.writer(buffers)
    try:
        writer.write(count)
    finally:
        writer.close()  # before the image is: libe57 crashes over a writer that outlives it


def _pose_node(lib: ModuleType, image: Any, viewpoint: np.ndarray) -> Any:
    pose, rotation, translation = (lib.StructureNode(image) for _ in range(3))
    for axis, value in zip("wxyz", (1.0, 0.0, 0.0, 0.0), strict=True):
        rotation.set(axis, lib.FloatNode(image, value))
    for axis, value in zip("xyz", viewpoint.tolist(), strict=True):
        translation.set(axis, lib.FloatNode(image, value))
    pose.set("rotation", rotation)
    pose.set("translation", translation)
    return pose


def _field_node(lib: ModuleType, image: Any, values: np.ndarray) -> tuple[Any, np.ndarray]:
    """Return the prototype of a field and its values in a type that libe57 takes."""
    if values.dtype.kind == "f":
        array = np.ascontiguousarray(values, np.float64 if values.dtype.itemsize > 4 else np.float32)
        precision = lib.FloatPrecision.E57_DOUBLE if array.itemsize == 8 else lib.FloatPrecision.E57_SINGLE
        return lib.FloatNode(image, 0.0, precision), array
    # long long, since pye57 takes NumPy's int64 (a C long) for 32 bits.
    array = np.ascontiguousarray(values, np.longlong)
    low, high = (int(array.min()), int(array.max())) if len(array) else (0, 0)
    if values.dtype.kind in "iu" and values.dtype.itemsize < 8:
        # The type's own bounds, so that it comes back as the same type.
        low, high = int(np.iinfo(values.dtype).min), int(np.iinfo(values.dtype).max)
    return lib.IntegerNode(image, low, low, high), array
