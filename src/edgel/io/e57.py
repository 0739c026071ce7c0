"""E57 by pye57 (``pip install edgel[e57]``): all scans of a file in one frame."""

from __future__ import annotations

import math
import os
import re
import uuid
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from edgel.cloud import Cloud
from edgel.io.columns import flat_attributes
from edgel.io.errors import FormatError
from edgel.io.files import reading, replacing, wrong_magic

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_NAMES = {"colorRed": "red", "colorGreen": "green", "colorBlue": "blue"}
_GRID = ("rowIndex", "columnIndex")
# Attributes that E57 itself does not define are written under this prefix of ours.
_PREFIX, _URI = "edgel", "https://edgel.readthedocs.io/e57"
# What the smallest integer type that holds a field's bounds is looked for among.
_INTEGERS = [np.dtype(code) for code in ("u1", "i1", "u2", "i2", "u4", "i4", "i8")]


@dataclass(frozen=True)
class _Scan:
    xyz: np.ndarray
    attributes: dict[str, np.ndarray]
    invalid: np.ndarray  # (N,) bool
    position: np.ndarray | None  # of the scanner, None when the file does not say


def _library(path: object) -> ModuleType:
    try:
        from pye57 import libe57
    except ImportError as error:
        raise FormatError(
            f"{path}: E57 files need the package pye57 ({error}); install it with `pip install edgel[e57]`"
        ) from None
    return libe57


def read(path: str | os.PathLike[str]) -> Cloud:
    """Read an E57 file, all its scans with their poses applied.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        Cartesian or spherical coordinates as x, y, z in the file's frame (metres). Numeric fields become attributes by their names
        (``colorRed`` as ``red`` and so on; those of an extension keep its prefix); a field that only some scans have is NaN
        or 0 in the others. ``scan_index`` tells the scan when there are several. Of one scan the scanner's position is the viewpoint,
        if it has a pose or spherical coordinates, and a complete grid of rowIndex and columnIndex makes the cloud organized.
        Points the scanner marked invalid are NaN in an organized cloud and left out otherwise; their number is
        ``metadata["e57_num_invalid"]``.

    Raises
    ------
    FormatError
        If the file is not E57, is damaged (every page has a checksum), or pye57 is not installed.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:  # doctest: +SKIP
    ...     write(f"{folder}/a.e57", Cloud(np.eye(3)))
    ...     read(f"{folder}/a.e57")
    Cloud(3 points, unorganized; attributes: none)
    """
    name = os.fspath(path)
    with reading(path) as file:
        head = file.read(512)
        size = os.fstat(file.fileno()).st_size
    if not head.startswith(b"ASTM-E57"):
        wrong_magic(name, "an E57 file", head)
    declared = int.from_bytes(head[16:24], "little")
    if declared > size:
        raise FormatError(f"{name}: declared {declared} bytes, found {size}; the file is cut off: get it again")
    lib = _library(name)
    try:
        scans = _read_scans(name, lib, size)
    except FormatError:
        raise
    except Exception as error:  # libe57 has its own base of errors, and its bindings raise others
        reason = str(error).strip().splitlines()
        raise FormatError(
            f"{name}: the E57 file is damaged ({reason[0] if reason else 'unknown'}); get it again"
        ) from None
    return _merge(scans)


def _read_scans(path: str, lib: ModuleType, size: int) -> list[_Scan]:
    image = lib.ImageFile(path, "r")
    try:
        root = image.root()
        if not root.isDefined("data3D"):
            return []
        data = root["data3D"]
        return [_read_scan(path, lib, image, data[i], size) for i in range(len(data))]
    finally:
        image.close()


def _read_scan(path: str, lib: ModuleType, image: Any, node: Any, size: int) -> _Scan:
    points = node["points"]
    prototype = lib.StructureNode(points.prototype())
    types = {}
    for i in range(prototype.childCount()):
        dtype, bits = _field_type(lib, prototype[i])
        if dtype is not None:
            types[prototype[i].elementName()] = (dtype, bits)
    count = points.childCount()
    if count * sum(bits for _, bits in types.values()) > 8 * size:
        raise FormatError(
            f"{path}: a scan declares {count} points, the file has {size} bytes; it is damaged: get it again"
        )
    columns = {name: np.zeros(count, dtype) for name, (dtype, _) in types.items()}
    if count:
        buffers = lib.VectorSourceDestBuffer()
        for name, column in columns.items():
            buffers.append(lib.SourceDestBuffer(image, name, column, count, True, True))
        reader = points.reader(buffers)
        found = reader.read()
        reader.close()
        if found != count:
            raise FormatError(
                f"{path}: a scan declares {count} points, found {found}; the file is damaged: get it again"
            )
    return _place(path, node, columns)


def _field_type(lib: ModuleType, node: Any) -> tuple[np.dtype | None, int]:
    """Return the NumPy type of a field and how many bits it takes in the file; None for what is not a number."""
    if isinstance(node, lib.FloatNode):
        single = node.precision() == lib.FloatPrecision.E57_SINGLE
        return (np.dtype("f4"), 32) if single else (np.dtype("f8"), 64)
    if isinstance(node, lib.ScaledIntegerNode):
        return np.dtype("f8"), (node.maximum() - node.minimum()).bit_length()
    if isinstance(node, lib.IntegerNode):
        low, high = node.minimum(), node.maximum()
        fitting = (d for d in _INTEGERS if np.iinfo(d).min <= low and high <= np.iinfo(d).max)
        return next(fitting), (high - low).bit_length()
    return None, 0


def _place(path: str, node: Any, columns: dict[str, np.ndarray]) -> _Scan:
    """Turn a scan's fields into coordinates in the file's frame and attributes."""
    if all(name in columns for name in _CARTESIAN):
        xyz = np.column_stack([columns.pop(name).astype(np.float64) for name in _CARTESIAN])
        state, position = "cartesianInvalidState", None
        for name in (*_SPHERICAL, "sphericalInvalidState"):
            columns.pop(name, None)  # the same points a second time
    elif all(name in columns for name in _SPHERICAL):
        distance, azimuth, elevation = (columns.pop(name).astype(np.float64) for name in _SPHERICAL)
        flat = distance * np.cos(elevation)
        xyz = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(elevation)])
        state, position = "sphericalInvalidState", np.zeros(3)
    else:
        raise FormatError(f"{path}: a scan has the fields {', '.join(columns) or 'none'}; coordinates are missing")
    # 1: only the direction is known; 2: nothing is.
    invalid = columns.pop(state).astype(bool) if state in columns else np.zeros(len(xyz), bool)
    if node.isDefined("pose"):
        rotation, position = _pose(node["pose"])
        xyz = xyz @ rotation.T + position
    prefix = _PREFIX + ":"
    return _Scan(xyz, {_NAMES.get(n, n).removeprefix(prefix): c for n, c in columns.items()}, invalid, position)


def _pose(node: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation (3, 3) and translation (3,) of a scan."""
    q, t = np.array([1.0, 0, 0, 0]), np.zeros(3)
    if node.isDefined("rotation"):
        q = np.array([node["rotation"][axis].value() for axis in "wxyz"], np.float64)
    if node.isDefined("translation"):
        t = np.array([node["translation"][axis].value() for axis in "xyz"], np.float64)
    if not np.isfinite(q).all() or not np.isfinite(t).all() or not q.any():
        raise ValueError("a pose that is not finite")
    w, x, y, z = q / math.sqrt(q @ q)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows), t


def _merge(scans: list[_Scan]) -> Cloud:
    if not scans:
        return Cloud(np.empty((0, 3)))
    num_invalid = sum(int(scan.invalid.sum()) for scan in scans)
    metadata = {"e57_num_invalid": num_invalid, "e57_num_scans": len(scans)}
    if len(scans) == 1 and (order := _grid_order(scans[0])) is not None:
        scan, (rows, shape) = scans[0], order
        xyz = np.where(scan.invalid[:, None], np.nan, scan.xyz)[rows]
        attributes = {name: values[rows] for name, values in scan.attributes.items() if name not in _GRID}
        return Cloud(xyz, attributes, shape, scan.position, None, metadata)
    names = dict.fromkeys(name for scan in scans for name in scan.attributes)
    attributes = {name: np.concatenate([_column(scan, name, scans) for scan in scans]) for name in names}
    if len(scans) > 1:
        indices = [np.full(int((~scan.invalid).sum()), i, np.int32) for i, scan in enumerate(scans)]
        attributes["scan_index"] = np.concatenate(indices)
    xyz = np.concatenate([scan.xyz[~scan.invalid] for scan in scans])
    return Cloud(xyz, attributes, None, scans[0].position if len(scans) == 1 else None, None, metadata)


def _column(scan: _Scan, name: str, scans: list[_Scan]) -> np.ndarray:
    if name in scan.attributes:
        return scan.attributes[name][~scan.invalid]
    dtype = np.result_type(*[other.attributes[name].dtype for other in scans if name in other.attributes])
    return np.full(int((~scan.invalid).sum()), np.nan if dtype.kind == "f" else 0, dtype)


def _grid_order(scan: _Scan) -> tuple[np.ndarray, tuple[int, int]] | None:
    """Return the row-major order and the shape of a scan whose indices fill a grid, else None."""
    if any(name not in scan.attributes or not len(scan.xyz) for name in _GRID):
        return None
    row, col = (scan.attributes[name].astype(np.int64) for name in _GRID)
    row, col = row - row.min(), col - col.min()
    shape = int(row.max()) + 1, int(col.max()) + 1
    if min(shape) < 2 or shape[0] * shape[1] != len(row):
        return None
    cell = row * shape[1] + col
    order = np.argsort(cell, kind="stable")
    return (order, shape) if np.array_equal(cell[order], np.arange(len(cell))) else None


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
        If an attribute cannot be stored, or pye57 is not installed.
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
    lib = _library(path)
    if not len(cloud):
        raise FormatError(f"{os.fspath(path)}: E57 cannot hold a scan without points; write .ply or .npz instead")
    columns = _fields(path, cloud)
    with replacing(path) as file:
        try:
            image = lib.ImageFile(file.name, "w")
        except lib.E57Exception as error:
            raise OSError(f"{os.fspath(path)}: cannot be written ({error})") from None
        try:
            _write_scan(lib, image, columns, cloud.viewpoint)
        finally:
            image.close()


def _fields(path: object, cloud: Cloud) -> dict[str, np.ndarray]:
    finite = np.isfinite(cloud.xyz).all(axis=1)
    position = np.zeros(3) if cloud.viewpoint is None else cloud.viewpoint
    xyz = np.where(finite[:, None], cloud.xyz - position, 0.0)
    columns: dict[str, np.ndarray] = dict(zip(_CARTESIAN, np.ascontiguousarray(xyz.T), strict=True))
    if not finite.all():
        columns["cartesianInvalidState"] = np.where(finite, 0, 2).astype(np.int8)
    if cloud.shape is not None:
        rows, cols = np.divmod(np.arange(len(cloud)), cloud.shape[1])
        columns.update(rowIndex=rows, columnIndex=cols)
    standard = {short: long for long, short in _NAMES.items()} | {"intensity": "intensity"}
    for name, values in flat_attributes(cloud, path).items():
        field = standard.get(name, f"{_PREFIX}:" + re.sub(r"[^\w.-]", "_", name))
        if not re.fullmatch(rf"({_PREFIX}:)?[A-Za-z_][A-Za-z0-9_.-]*", field) or field in columns:
            raise FormatError(f"{path}: attribute {name!r} has a name that E57 cannot hold or has twice; rename it")
        if values.dtype.kind == "u" and values.dtype.itemsize == 8 and int(values.max()) > np.iinfo(np.int64).max:
            raise FormatError(
                f"{path}: attribute {name!r} exceeds 64-bit signed integers, E57's widest; write .npz instead"
            )
        columns[field] = values
    return columns


def _write_scan(lib: ModuleType, image: Any, columns: dict[str, np.ndarray], viewpoint: np.ndarray | None) -> None:
    image.extensionsAdd("", lib.E57_V1_0_URI)
    image.extensionsAdd(_PREFIX, _URI)
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
    prototype, count = lib.StructureNode(image), len(columns[_CARTESIAN[0]])
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
    writer.write(count)
    writer.close()


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
    array = np.ascontiguousarray(values, np.int64)
    low, high = int(array.min()), int(array.max())
    if values.dtype.kind in "iu" and values.dtype.itemsize < 8:
        # The type's own bounds, so that it comes back as the same type.
        low, high = int(np.iinfo(values.dtype).min), int(np.iinfo(values.dtype).max)
    return lib.IntegerNode(image, low, low, high), array
