"""E57 by pye57 (``pip install 'edgel[e57]'``): all scans of a file in one frame."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from edgel.cloud import Cloud
from edgel.io.cells import grid_of, in_cells
from edgel.io.e57_check import check_xml
from edgel.io.e57_write import CARTESIAN, GRID, NAMES, PREFIX, SPHERICAL, library
from edgel.io.errors import FormatError
from edgel.io.files import reading, wrong_magic
from edgel.io.limits import check_unpacked

# The smallest of these that holds a field's bounds is its type.
_INTEGERS = [np.dtype(code) for code in ("u1", "i1", "u2", "i2", "u4", "i4", "i8")]


@dataclass(frozen=True)
class _Scan:
    xyz: np.ndarray
    attributes: dict[str, np.ndarray]
    invalid: np.ndarray  # (N,) bool
    position: np.ndarray | None  # of the scanner, None when the file does not say


def read(path: str | os.PathLike[str]) -> Cloud:
    """Read an E57 file, all its scans with their poses applied.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        Cartesian or spherical coordinates as x, y, z in the file's frame (metres). Numeric fields become attributes by
        their names (``colorRed`` as ``red`` and so on; those of an extension keep its prefix); a field that only some
        scans have is NaN or 0 in the others. ``scan_index`` tells the scan when there are several, and
        ``metadata["scan_positions"]`` where each scanner stood, None where the file does not say. Of one scan the
        scanner's position is the viewpoint, if it has a pose or spherical coordinates, and rowIndex and columnIndex
        make the cloud organized, unless they name a cell twice or leave more than 20 empty for each point: cells that
        are not in the file are NaN (attributes that have no NaN: 0). Points the scanner marked invalid are NaN in an
        organized cloud and left out otherwise; their number is ``metadata["e57_num_invalid"]``.

    Raises
    ------
    FormatError
        If the file is not E57, is damaged (every page has a checksum), or pye57 is not installed.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:  # doctest: +SKIP
    ...     edgel.io.write(f"{folder}/a.e57", edgel.Cloud(np.eye(3)))
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
    lib = library(name)
    with reading(path) as file:
        check_xml(name, file, size)
    try:
        scans, num_images, extensions = _read_scans(name, lib, size)
    except (FormatError, MemoryError):
        raise
    except Exception as error:  # libe57 has its own base of errors, and its bindings raise others
        reason = str(error).strip().splitlines()
        raise FormatError(
            f"{name}: the E57 file is damaged ({reason[0] if reason else 'unknown'}); get it again"
        ) from None
    cloud = _merge(scans)
    if extensions:
        cloud = replace(cloud, metadata={**cloud.metadata, "e57_extensions": extensions})
    if num_images:
        cloud = replace(cloud, metadata={**cloud.metadata, "left_out": (f"{num_images} images",)})
    return cloud


def _read_scans(path: str, lib: ModuleType, size: int) -> tuple[list[_Scan], int, dict[str, str]]:
    """Return the scans, the number of images, and the addresses of the extensions by prefix."""
    image = lib.ImageFile(path, "r")
    try:
        root = image.root()
        if not root.isDefined("data3D"):
            return [], 0, {}
        data = root["data3D"]
        layouts = [_layout(lib, data[i]["points"]) for i in range(len(data))]
        # All scans together: they may point to the same bytes.
        bits = sum(count * sum(bits for _, bits in types.values()) for count, types in layouts)
        if bits > 8 * size:
            num_points = sum(count for count, _ in layouts)
            raise FormatError(
                f"{path}: its scans declare {num_points} points, the file has {size} bytes; it is damaged: get it again"
            )
        # Fields of one value take no bits at all, but memory.
        bytes_each = (24 + sum(dtype.itemsize for dtype, _ in types.values()) for _, types in layouts)
        check_unpacked(path, sum(c * b for (c, _), b in zip(layouts, bytes_each, strict=True)), size)
        num_images = len(root["images2D"]) if root.isDefined("images2D") else 0
        extensions = {image.extensionsPrefix(i): image.extensionsUri(i) for i in range(image.extensionsCount())}
        extensions = {prefix: address for prefix, address in extensions.items() if prefix not in ("", PREFIX)}
        return [_read_scan(path, lib, image, data[i], *layouts[i]) for i in range(len(data))], num_images, extensions
    finally:
        image.close()


def _layout(lib: ModuleType, points: Any) -> tuple[int, dict[str, tuple[np.dtype, int]]]:
    """Return how many points a scan declares, and type and bits of each field that is a number."""
    prototype = lib.StructureNode(points.prototype())
    types = {}
    for i in range(prototype.childCount()):
        dtype, bits = _field_type(lib, prototype[i])
        if dtype is not None:
            types[prototype[i].elementName()] = (dtype, bits)
    return points.childCount(), types


def _read_scan(
    path: str, lib: ModuleType, image: Any, node: Any, count: int, types: dict[str, tuple[np.dtype, int]]
) -> _Scan:
    points = node["points"]
    columns = {name: np.zeros(count, _buffer_type(dtype)) for name, (dtype, _) in types.items()}
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
    exact = {name: column.astype(types[name][0], copy=False) for name, column in columns.items()}
    return _place(path, node, exact)


def _buffer_type(dtype: np.dtype) -> np.dtype:
    # pye57 refuses NumPy's int32 (a C int) and takes its int64 (a C long) for 32 bits; long long is right everywhere.
    return np.dtype(np.longlong) if dtype.kind in "iu" and dtype.itemsize > 2 else dtype


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
    if all(name in columns for name in CARTESIAN):
        xyz = np.column_stack([columns.pop(name).astype(np.float64) for name in CARTESIAN])
        state, position = "cartesianInvalidState", None
        for name in (*SPHERICAL, "sphericalInvalidState"):
            columns.pop(name, None)  # the same points a second time
    elif all(name in columns for name in SPHERICAL):
        distance, azimuth, elevation = (columns.pop(name).astype(np.float64) for name in SPHERICAL)
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
    prefix = PREFIX + ":"
    named = {NAMES.get(n, n).removeprefix(prefix): c for n, c in columns.items()}
    return _Scan(xyz, named, invalid, position)


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
    metadata: dict[str, Any] = {"e57_num_invalid": num_invalid, "e57_num_scans": len(scans)}
    if len(scans) == 1 and (cells := _cells(scans[0])) is not None:
        scan, (index, shape) = scans[0], cells
        xyz = np.where(scan.invalid[:, None], np.nan, scan.xyz)
        attributes = {name: values for name, values in scan.attributes.items() if name not in GRID}
        return in_cells(Cloud(xyz, attributes, None, scan.position, None, metadata), index, shape)
    names = dict.fromkeys(name for scan in scans for name in scan.attributes)
    attributes = {name: np.concatenate([_column(scan, name, scans) for scan in scans]) for name in names}
    if len(scans) > 1:
        indices = [np.full(int((~scan.invalid).sum()), i, np.int32) for i, scan in enumerate(scans)]
        attributes["scan_index"] = np.concatenate(indices)
        positions = (None if scan.position is None else tuple(scan.position.tolist()) for scan in scans)
        metadata["scan_positions"] = tuple(positions)
    xyz = np.concatenate([scan.xyz[~scan.invalid] for scan in scans])
    return Cloud(xyz, attributes, None, scans[0].position if len(scans) == 1 else None, None, metadata)


def _column(scan: _Scan, name: str, scans: list[_Scan]) -> np.ndarray:
    if name in scan.attributes:
        return scan.attributes[name][~scan.invalid]
    dtype = np.result_type(*[other.attributes[name].dtype for other in scans if name in other.attributes])
    return np.full(int((~scan.invalid).sum()), np.nan if dtype.kind == "f" else 0, dtype)


def _cells(scan: _Scan) -> tuple[np.ndarray, tuple[int, int]] | None:
    """Return the point of each cell (-1: none), row by row, and the shape of a scan whose indices form a grid."""
    if any(name not in scan.attributes or not len(scan.xyz) for name in GRID):
        return None
    return grid_of(*(scan.attributes[name].astype(np.int64) for name in GRID))
