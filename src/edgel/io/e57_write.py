"""E57 writing by pye57: one scan, coordinates in double precision."""

from __future__ import annotations

import os
import re
import signal
import threading
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np

from edgel.cloud import Cloud
from edgel.io.columns import flat_attributes, narrowed
from edgel.io.errors import FormatError, tell
from edgel.io.files import replacing

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
NAMES = {"colorRed": "red", "colorGreen": "green", "colorBlue": "blue"}
GRID = ("rowIndex", "columnIndex")
INVALID = ("cartesianInvalidState", "sphericalInvalidState")
# Fields of E57 itself that keep their names.
_STANDARD = {"intensity", "timeStamp", "returnIndex", "returnCount",
             "isIntensityInvalid", "isColorInvalid", "isTimeStampInvalid"}  # fmt: skip
# Attributes that E57 itself does not define are written under this prefix of ours.
PREFIX, URI = "edgel", "https://edgel.readthedocs.io/e57"


def library(path: object) -> ModuleType:
    """Return pye57's binding of libE57, or raise the FormatError that tells how to install it."""
    try:
        from pye57 import libe57  # pyright: ignore[reportAttributeAccessIssue]
    except ImportError as error:
        raise FormatError(
            f"{path}: E57 files need the package pye57 ({error}); install it with `pip install 'edgel[e57]'`"
        ) from None
    return libe57


def write(path: str | os.PathLike[str], cloud: Cloud) -> None:
    """Write an E57 file of one scan, coordinates in double precision.

    ``red green blue`` become ``colorRed`` and so on; fields of E57's own keep their names, and those of an extension
    that the input had (``nor:normalX``) their prefix; all others are written in an extension of the name ``edgel``. An
    organized cloud keeps its shape through ``rowIndex`` and ``columnIndex``; points that are not finite are marked
    invalid. The viewpoint goes into the scan's pose.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Warns
    -----
    FormatWarning
        If an attribute is left out or renamed.

    Raises
    ------
    FormatError
        If `path` is a pipe or a device, or pye57 is not installed.
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
    said: dict[str, str] = {}
    columns, extensions = _fields(cloud, said)
    with replacing(path) as file:
        if not isinstance(file.name, str):
            raise FormatError(
                f"{os.fspath(path)}: E57 goes into no pipe or device; write a file, or .ply into the pipe"
            )
        tell(os.fspath(path), said)
        try:
            with _uninterrupted():
                image = lib.ImageFile(file.name, "w")
                try:
                    _write_scan(lib, image, columns, extensions, cloud.viewpoint)
                finally:
                    image.close()
        except lib.E57Exception as error:
            reason = str(error).strip().splitlines()[0]
            raise OSError(f"{os.fspath(path)}: cannot be written ({reason}); is the disk full?") from None


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Hold signals back to the end: an exception between two calls of libe57 leaves objects that crash it."""
    if threading.current_thread() is not threading.main_thread():  # no other thread is ever interrupted
        yield
        return
    held: list[Any] = []
    usual: dict[int, Any] = {number: signal.getsignal(number) for number in signal.valid_signals()}
    usual = {number: handler for number, handler in usual.items() if callable(handler)}  # not ignored, nor the system's
    for number in usual:
        signal.signal(number, lambda *arguments: held.append(arguments))
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
        for number, frame in held:
            usual[number](number, frame)


def _fields(cloud: Cloud, said: dict[str, str]) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return the fields of the scan, and the addresses of the extensions that they belong to, by prefix."""
    finite = np.isfinite(cloud.xyz).all(axis=1)
    position = np.zeros(3) if cloud.viewpoint is None else cloud.viewpoint
    local = cloud.xyz - position
    local[~finite] = 0
    columns: dict[str, np.ndarray] = {name: np.ascontiguousarray(local[:, i]) for i, name in enumerate(CARTESIAN)}
    if not finite.all():
        columns["cartesianInvalidState"] = np.where(finite, 0, 2).astype(np.int8)
    if cloud.shape is not None and min(cloud.shape) > 1:  # one row or column is no grid
        rows, cols = np.divmod(np.arange(len(cloud)), cloud.shape[1])
        columns.update(rowIndex=rows, columnIndex=cols)
    given = dict(cloud.metadata.get("e57_extensions", {}))
    given.pop(PREFIX, None)
    extensions = {PREFIX: URI}
    long_names = {short: long for long, short in NAMES.items()}
    taken = {"x", "y", "z", *(name.lower() for name in (*CARTESIAN, *SPHERICAL, *INVALID, *GRID))}
    for name, values in flat_attributes(cloud, said, taken=taken, spell=lambda name: _spell(name, given)).items():
        stored = narrowed(values, _types(values))
        if stored is None:
            said[name] = f"left out, {values.dtype} fits no type of E57 exactly; .npz holds it"
            continue
        prefix, colon, _ = name.partition(":")
        if colon:
            extensions[prefix] = given[prefix]
        own = not colon and name not in long_names and name not in _STANDARD
        columns[f"{PREFIX}:{name}" if own else long_names.get(name, name)] = stored
    return columns, extensions


def _spell(name: str, extensions: Mapping[str, str]) -> str:
    """Return a name that XML can hold, with the prefix of an extension that the input had."""
    prefix, colon, rest = name.partition(":")
    if colon and prefix in extensions and re.fullmatch(r"[A-Za-z_][A-Za-z0-9_.-]*", rest):
        return name
    word = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
    return word if re.match("[A-Za-z_]", word) else f"_{word}"


def _types(values: np.ndarray) -> list[str]:
    """Return the types that a field may have, the best first."""
    if values.dtype.kind == "f":
        return ["f4", "f8"] if values.dtype.itemsize < 8 else ["f8"]
    if values.dtype.kind == "b":
        return ["u1"]
    return ["i8"] if values.dtype.itemsize == 8 else [f"{values.dtype.kind}{values.dtype.itemsize}"]


def _write_scan(
    lib: ModuleType,
    image: Any,
    columns: dict[str, np.ndarray],
    extensions: dict[str, str],
    viewpoint: np.ndarray | None,
) -> None:
    image.extensionsAdd("", lib.E57_V1_0_URI)
    for prefix, address in extensions.items():
        image.extensionsAdd(prefix, address)
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
    for what, fields in (("colorLimits", list(NAMES)), ("intensityLimits", ["intensity"])):
        if count and set(fields) <= set(columns):
            scan.set(what, _limits_node(lib, image, {name: columns[name] for name in fields}))
    points = lib.CompressedVectorNode(image, prototype, lib.VectorNode(image, True))
    scan.set("points", points)
    scans.append(scan)
    writer = points.writer(buffers)
    try:
        writer.write(count)
    finally:
        writer.close()  # before the image is: libe57 crashes over a writer that outlives it


def _limits_node(lib: ModuleType, image: Any, fields: dict[str, np.ndarray]) -> Any:
    """Return the bounds of colors or intensities, by which other programs scale them."""
    limits = lib.StructureNode(image)
    for name, values in fields.items():
        known = values[np.isfinite(values)]
        bounds = (known.min().item(), known.max().item()) if len(known) else (0, 0)
        if values.dtype == np.uint8:
            bounds = (0, 255)
        for end, value in zip(("Minimum", "Maximum"), bounds, strict=True):
            node = lib.FloatNode(image, value) if values.dtype.kind == "f" else lib.IntegerNode(image, value)
            limits.set(name + end, node)
    return limits


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
        array = np.ascontiguousarray(values)
        precision = lib.FloatPrecision.E57_DOUBLE if array.itemsize == 8 else lib.FloatPrecision.E57_SINGLE
        return lib.FloatNode(image, 0.0, precision), array
    # long long, since pye57 takes NumPy's int64 (a C long) for 32 bits.
    array = np.ascontiguousarray(values, np.longlong)
    low, high = (int(array.min()), int(array.max())) if len(array) else (0, 0)
    if values.dtype.itemsize < 8:
        # The type's own bounds, so that it comes back as the same type.
        low, high = int(np.iinfo(values.dtype).min), int(np.iinfo(values.dtype).max)
    return lib.IntegerNode(image, low, low, high), array
