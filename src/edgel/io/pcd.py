"""PCD of the Point Cloud Library: ascii, binary and binary_compressed, organized or not."""

from __future__ import annotations

import os
import re
from typing import BinaryIO

import numpy as np

from edgel._objects import NORMALS
from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.files import reading
from edgel.io.limits import check_unpacked
from edgel.io.lzf import lzf_decompress
from edgel.io.names import standard_names
from edgel.io.pcd_header import Header, read_header
from edgel.io.pcd_write import is_meaningful, write
from edgel.io.rows import parse_text, read_binary, reject_row, remaining_bytes

__all__ = ["read", "write"]

# LZF packs at most 264 bytes into three.
_MAX_LZF_RATIO = 88


def read(path: str | os.PathLike[str]) -> Cloud:
    """Read a PCD file.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        Fields as attributes of their own type, (N, C) where COUNT is C; padding fields (``_``) left out. Packed ``rgb``
        or ``rgba`` becomes ``red``, ``green``, ``blue`` (uint8), and ``alpha`` from ``rgba`` when it is not 0 or 255
        throughout; ``normal_x normal_y normal_z`` become ``nx ny nz``. HEIGHT and WIDTH above 1 make the cloud
        organized. The translation of VIEWPOINT is the viewpoint (none where it is 0 0 0, PCL's filler, in a cloud that
        is not organized); all seven numbers are in ``metadata["pcd_viewpoint"]``. The shift that `write` takes from
        large coordinates is added again. Coordinates of an ascii file are parsed as double even where SIZE is 4.

    Raises
    ------
    FormatError
        If the file is not PCD, its header contradicts itself, or its data is cut off or damaged.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(f"{folder}/a.pcd", Cloud(np.zeros((2, 3, 3)), viewpoint=np.array([0, 0, 1])))
    ...     read(f"{folder}/a.pcd")
    Cloud(6 points, organized 2 x 3; attributes: none)
    """
    name = os.fspath(path)
    with reading(path) as file:
        header = read_header(name, file)
        body = {"ascii": _read_ascii, "binary": _read_plain, "binary_compressed": _read_compressed}[header.data]
        xyz, fields = body(name, file, header)
    attributes = attributes_of(fields)
    shape = (header.height, header.width) if min(header.height, header.width) > 1 else None
    viewpoint = np.array(header.viewpoint[:3]) if header.viewpoint else None
    if viewpoint is not None and shape is None and not viewpoint.any():
        viewpoint = None  # what every writer puts where no sensor is known; a map in UTM is not seen from 0, 0, 0
    metadata: dict[str, object] = {"pcd_viewpoint": header.viewpoint} if header.viewpoint else {}
    if header.shift is not None:
        xyz += header.shift
        metadata["pcd_shift"] = header.shift
        if viewpoint is not None and header.viewpoint:
            viewpoint = viewpoint + header.shift
            metadata["pcd_viewpoint"] = (*viewpoint.tolist(), *header.viewpoint[3:])
    return Cloud(xyz, attributes, shape, viewpoint, None, metadata)


def _cut_off(path: str, declared: int, found: int) -> FormatError:
    what = "the file is cut off: get it again" if found < declared else "mend POINTS, WIDTH and HEIGHT"
    return FormatError(f"{path}: declared {declared} points, found {found}; {what}")


def _read_ascii(path: str, file: BinaryIO, header: Header) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    # Commas and semicolons separate too: PDAL and spreadsheets write them.
    text = re.sub(rb"[,;]", b" ", file.read()).decode("utf-8", "replace")
    rows = [line for line in text.splitlines() if not line.isspace() and line]
    if len(rows) != header.count:
        raise _cut_off(path, header.count, len(rows))
    # Double whatever SIZE says: UTM coordinates are written with more digits than a float of 4 bytes keeps.
    layout = []
    for name in header.dtype.names or ():
        base, shape = header.dtype[name].base, header.dtype[name].shape
        layout.append((name, np.dtype("f8") if name in header.axes else base.newbyteorder("="), shape))
    dtype = np.dtype(layout)
    try:
        table = parse_text(rows, dtype) if rows else np.empty(0, dtype)
    except ValueError as error:
        width = sum(int(np.prod(dtype[name].shape, dtype=int)) for name in dtype.names or ())
        raise reject_row(path, " ".join(dtype.names or ()), rows, width, error, header.num_lines + 1) from None
    xyz = np.column_stack([table[name] for name in header.axes])
    names = [name for name in dtype.names or () if name not in header.axes and name not in header.padding]
    return xyz, {name: np.ascontiguousarray(table[name]) for name in names}


def _read_plain(path: str, file: BinaryIO, header: Header) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    found = remaining_bytes(file) // header.dtype.itemsize
    if found < header.count:
        raise _cut_off(path, header.count, found)
    # Colours packed into a float are NaN for some alphas, which a float copy need not keep: take them as integers.
    layout = []
    for name in header.dtype.names or ():
        packed = name.lower() in ("rgb", "rgba") and header.dtype[name] == np.dtype("<f4")
        layout.append((name, "<u4" if packed else header.dtype[name]))
    return read_binary(file, np.dtype(layout), header.count, header.axes, leave_out=header.padding)


def _read_compressed(path: str, file: BinaryIO, header: Header) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    sizes = np.frombuffer(file.read(8), "<u4") if remaining_bytes(file) >= 8 else np.zeros(2, "<u4")
    packed_size, size = map(int, sizes)
    names = list(header.dtype.names or ())
    # PCL leaves padding fields out of compressed data, others keep them; the size tells which.
    if size == header.count * (header.dtype.itemsize - sum(header.dtype[name].itemsize for name in header.padding)):
        names = [name for name in names if name not in header.padding]
    elif size != header.count * header.dtype.itemsize:
        raise FormatError(
            f"{path}: declared {header.count} points, the packed data holds {size} bytes; re-export the file"
        )
    found = remaining_bytes(file)
    check_unpacked(path, size, found)
    if packed_size > found or size > packed_size * _MAX_LZF_RATIO:
        raise FormatError(
            f"{path}: declared {packed_size} packed bytes, found {found}; the file is cut off: get it again"
        )
    out = np.empty(size, np.uint8)
    if lzf_decompress(np.frombuffer(file.read(packed_size), np.uint8), out) != size:
        raise FormatError(f"{path}: the packed PCD data is damaged; get the file again")
    columns: dict[str, np.ndarray] = {}
    position = 0
    for name in names:
        field = header.dtype[name]
        part = out[position : position + header.count * field.itemsize]
        columns[name] = part.view(field.base).reshape(header.count, *field.shape)
        position += part.size
    xyz = np.column_stack([columns.pop(name).astype(np.float64) for name in header.axes])
    kept = {name: values for name, values in columns.items() if name not in header.padding}
    # Views keep the whole unpacked buffer alive; copies also are aligned and of native byte order.
    return xyz, {name: values.astype(values.dtype.newbyteorder("="), copy=True) for name, values in kept.items()}


def attributes_of(fields: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Name fields as attributes are: normals by the names of ours, packed colors unpacked."""
    attributes: dict[str, np.ndarray] = {}
    spelled = {field: name for field, name in standard_names([*fields]).items() if name in NORMALS}
    for field, values in fields.items():
        if field.lower() in ("rgb", "rgba") and values.ndim == 1 and values.dtype.itemsize == 4:
            attributes.update(_unpack_colors(values, with_alpha=field.lower() == "rgba"))
        else:
            attributes[spelled.get(field, field)] = values
    return attributes


def _unpack_colors(packed: np.ndarray, *, with_alpha: bool) -> dict[str, np.ndarray]:
    bits = np.ascontiguousarray(packed).view(np.uint32)
    shifts = {"red": 16, "green": 8, "blue": 0, "alpha": 24}
    channels = {name: (bits >> shift & 255).astype(np.uint8) for name, shift in shifts.items()}
    if not with_alpha or not is_meaningful(channels["alpha"]):
        del channels["alpha"]
    return channels
