"""PLY, ascii and binary of either byte order: every scalar of the vertices, nothing of the faces."""

from __future__ import annotations

import os
from io import BytesIO, TextIOWrapper
from itertools import islice
from typing import Any, BinaryIO

import numpy as np

from edgel._objects import find_xyz
from edgel.cloud import Cloud
from edgel.io.columns import fits_float32, flat_attributes, one_line
from edgel.io.errors import FormatError
from edgel.io.files import reading, replacing
from edgel.io.limits import LONGEST_LINE, whole_number
from edgel.io.mesh import OFFER
from edgel.io.ply_grid import range_grid, read_grid, spread
from edgel.io.ply_header import NAMES, Element, Header, cut_off, read_header
from edgel.io.ply_lists import gather, skip, walk
from edgel.io.rows import number_of, parse_text, read_binary, reject_row, remaining_bytes, write_binary

_FACES = ("face", "faces", "tristrips")


def read(path: str | os.PathLike[str] | BinaryIO) -> Cloud:
    """Read a PLY file.

    Parameters
    ----------
    path : path or binary file
        A stream (``sys.stdin.buffer``) is read to its end.

    Returns
    -------
    Cloud
        All scalar vertex properties as (N,) attributes of their own type; list properties, faces and other elements are
        left out, and named in ``metadata["left_out"]``; with faces ``metadata["notices"]`` says that it is a mesh.
        ``obj_info num_cols`` and ``num_rows`` make the cloud
        organized; where Stanford's ``range_grid`` lists only the valid points, the other cells are NaN.

    Raises
    ------
    FormatError
        If the file is not PLY, is cut off, or its vertices have no x, y and z.

    Examples
    --------
    >>> from io import BytesIO
    >>> file = BytesIO()
    >>> write(file, Cloud([[1, 2, 3]]))
    >>> read(BytesIO(file.getvalue())).xyz
    array([[1., 2., 3.]])
    """
    if isinstance(path, (str, os.PathLike)):
        with reading(path) as file:
            return _read(os.fspath(path), file)
    return _read(str(getattr(path, "name", "stream")), BytesIO(path.read()))


def _read(path: str, file: BinaryIO) -> Cloud:
    header = read_header(path, file)
    position = header.index("vertex")
    vertex = header.elements[position]
    names = [p.name for p in vertex.properties if p.length_code is None]
    axes = find_xyz(names)
    if axes is None:
        raise FormatError(f"{path}: the vertices have {', '.join(names) or 'no scalar'}; x, y and z are needed")
    if len(set(names)) < len(names):
        raise FormatError(f"{path}: two vertex properties have one name; rename one in the header")
    _check_size(path, header, vertex, file)
    read_body = _read_ascii if header.ascii else _read_binary
    xyz, attributes = read_body(path, file, header, header.elements[:position], vertex, axes)
    cloud = _to_cloud(path, header, xyz, attributes)
    grid = range_grid(header)
    if cloud.shape is None and grid is not None:
        position, shape = grid
        return spread(path, cloud, read_grid(path, file, header, position), shape)
    return cloud


def _check_size(path: str, header: Header, vertex: Element, file: BinaryIO) -> None:
    """Compare what the header promises with the file's size, before anything is allocated."""
    size = remaining_bytes(file)
    row = 2 * len(vertex.properties) if header.ascii else vertex.min_row
    if vertex.count * row - header.ascii > size:  # the last line of a text may lack its end
        found = sum(bool(line.strip()) for line in file) if header.ascii else size // row
        raise cut_off(path, vertex.count, min(found, vertex.count))


def _read_ascii(
    path: str, file: BinaryIO, header: Header, skipped: list[Element], vertex: Element, axes: list[str]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    # CR alone ends lines too: universal newlines, as the header.
    text = TextIOWrapper(file, "utf-8", "replace", newline=None)
    num_skipped = sum(element.count for element in skipped)
    if num_skipped > remaining_bytes(file):  # a row of nothing still takes a line
        raise cut_off(path, vertex.count, 0)
    lines = islice((line for line in text if not line.isspace()), num_skipped, num_skipped + vertex.count)
    rows = list(lines)
    text.detach()
    if len(rows) < vertex.count:
        raise cut_off(path, vertex.count, len(rows))
    if any(p.length_code for p in vertex.properties):
        rows = [_without_lists(path, row, vertex) for row in rows]
    scalars = [p for p in vertex.properties if p.length_code is None]
    # Coordinates are parsed as double whatever the header says: a text may carry more digits than its float.
    dtype = np.dtype([(p.name, "f8" if p.name in axes else p.code) for p in scalars])
    try:
        table = parse_text(rows, dtype) if rows else np.empty(0, dtype)
    except ValueError as error:
        what = " ".join(p.name for p in scalars)
        raise reject_row(path, what, rows, len(scalars), error, header.num_lines + num_skipped + 1) from None
    xyz = np.column_stack([table[name] for name in axes])
    return xyz, {p.name: np.ascontiguousarray(table[p.name]) for p in scalars if p.name not in axes}


def _without_lists(path: str, row: str, vertex: Element) -> str:
    if len(row) > LONGEST_LINE:
        raise FormatError(f"{path}: vertex line {row[:60]!r} is {len(row)} characters long; mend the file")
    words = row.split()
    kept, position = [], 0
    for p in vertex.properties:
        length = 0
        if p.length_code is not None:
            number = whole_number(words[position]) if position < len(words) else None
            if number is None:
                raise FormatError(
                    f"{path}: vertex line {row.strip()[:60]!r} breaks off in list {p.name!r}; mend the file"
                )
            length = number
        else:
            kept.append(words[position] if position < len(words) else "")
        position += 1 + length
    return " ".join([*kept, *words[position:]])


def _read_binary(
    path: str, file: BinaryIO, header: Header, skipped: list[Element], vertex: Element, axes: list[str]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    for element in skipped:
        skip(path, file, header, element)
    if any(p.length_code for p in vertex.properties):
        columns = _read_with_lists(path, file, header, vertex)
        return np.column_stack([columns.pop(name).astype(np.float64) for name in axes]), columns
    if vertex.count * vertex.min_row > remaining_bytes(file):
        raise cut_off(path, vertex.count, remaining_bytes(file) // vertex.min_row)
    dtype = np.dtype([(p.name, header.order + p.code) for p in vertex.properties])
    return read_binary(file, dtype, vertex.count, axes)


def _read_with_lists(path: str, file: BinaryIO, header: Header, vertex: Element) -> dict[str, np.ndarray]:
    data, offsets = walk(path, file, header, vertex, keep=True)
    return {
        p.name: gather(data, offsets[:, i], np.dtype(header.order + p.code))
        for i, p in enumerate(vertex.properties)
        if p.length_code is None
    }


def _to_cloud(path: str, header: Header, xyz: np.ndarray, attributes: dict[str, np.ndarray]) -> Cloud:
    shape = header.shape
    if shape is not None and shape[0] * shape[1] != len(xyz):
        shape = None  # Stanford's range grids list only the valid points
    viewpoint = None
    if "viewpoint" in header.info:
        words = header.info["viewpoint"].split()
        if len(words) != 3 or not all(number_of(word) and np.isfinite(float(word)) for word in words):
            raise FormatError(f"{path}: obj_info viewpoint {' '.join(words)!r}; three finite numbers are needed")
        viewpoint = np.array(words, np.float64)
    metadata: dict[str, Any] = {"ply_comments": tuple(header.comments)} if header.comments else {}
    if left_out := _left_out(header):
        metadata["left_out"] = left_out
    if num_faces := sum(e.count for e in header.elements if e.name in _FACES):
        metadata["notices"] = (f"a mesh of {num_faces:,} faces: its vertices are no scan of it; to {OFFER}",)
    return Cloud(xyz, attributes, shape, viewpoint, header.info.get("crs") or None, metadata)


def _left_out(header: Header) -> tuple[str, ...]:
    """Name what the file holds beside its points."""
    grid = range_grid(header)
    used = (header.index("vertex"), None if grid is None else grid[0])
    others = [e for i, e in enumerate(header.elements) if i not in used and e.count]
    lists = [p.name for p in header.elements[used[0]].properties if p.length_code is not None]
    return (*(f"{e.count:,} of element {e.name}" for e in others), *(f"list {name}" for name in lists))


def write(path: str | os.PathLike[str] | BinaryIO, cloud: Cloud) -> None:
    """Write a binary little-endian PLY file.

    Coordinates become float when that is exact for all of them, else double. Attributes keep their type where PLY has
    it; bool becomes uchar, float16 float, and 64-bit integers the smallest of int, uint and double that holds them
    exactly. (N, C) attributes become ``name_0 .. name_{C-1}``. Organized shape (``num_cols``, ``num_rows``, the
    Stanford convention), viewpoint and CRS go into ``obj_info`` lines.

    Parameters
    ----------
    path : path or binary file
    cloud : Cloud

    Raises
    ------
    FormatError
        If PLY cannot hold an attribute without loss.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from io import BytesIO
    >>> import numpy as np
    >>> file = BytesIO()
    >>> write(file, Cloud(np.eye(3)))
    >>> file.getvalue().splitlines()[2]
    b'element vertex 3'
    """
    columns = dict(zip("xyz", cloud.xyz.T, strict=True))
    types = dict.fromkeys("xyz", "f4" if fits_float32(cloud.xyz) else "f8")
    for name, values in flat_attributes(cloud, path).items():
        columns[name], types[name] = values, _lossless_type(path, name, values)
    header = _header_text(cloud, types).encode()
    dtype = np.dtype([(name, "<" + code) for name, code in types.items()])
    if isinstance(path, (str, os.PathLike)):
        with replacing(path) as file:
            file.write(header)
            write_binary(file, dtype, columns)
    else:
        path.write(header)
        write_binary(path, dtype, columns)


def _header_text(cloud: Cloud, types: dict[str, str]) -> str:
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {one_line(comment)}" for comment in cloud.metadata.get("ply_comments", ())]
    if cloud.shape is not None:
        lines += [f"obj_info num_cols {cloud.shape[1]}", f"obj_info num_rows {cloud.shape[0]}"]
    if cloud.viewpoint is not None:
        lines.append("obj_info viewpoint " + " ".join(map(repr, cloud.viewpoint.tolist())))
    if cloud.crs:
        lines.append(f"obj_info crs {one_line(cloud.crs)}")
    lines.append(f"element vertex {len(cloud)}")
    lines += [f"property {NAMES[code]} {name}" for name, code in types.items()]
    return "\n".join([*lines, "end_header", ""])


def _lossless_type(path: object, name: str, values: np.ndarray) -> str:
    """Return the PLY type that holds every value exactly, the values' own type where PLY has it."""
    code = values.dtype.kind + str(values.dtype.itemsize)
    if code in NAMES:
        return code
    if code in ("b1", "f2"):
        return {"b1": "u1", "f2": "f4"}[code]
    for candidate in ("i4", "u4") if code in ("i8", "u8") else ():
        bounds = np.iinfo(candidate)
        if not len(values) or (int(values.min()) >= bounds.min and int(values.max()) <= bounds.max):
            return candidate
    # Doubles hold integers exactly up to 2^53; long doubles only where they are doubles.
    if values.dtype.kind in "iu":
        exact = max(-int(values.min()), int(values.max())) <= 2**53
    else:
        exact = np.array_equal(values.astype(np.float64), values, equal_nan=True)
    if not exact:
        raise FormatError(
            f"{path}: attribute {name!r} ({values.dtype}) does not fit a PLY type exactly; write .npz instead"
        )
    return "f8"
