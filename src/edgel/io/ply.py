"""PLY, ascii and binary of either byte order: every scalar of the vertices, nothing of the faces."""

from __future__ import annotations

import os
from io import BytesIO, TextIOWrapper
from itertools import islice
from typing import Any, BinaryIO

import numpy as np

from edgel._objects import COLORS, NORMALS, find_xyz
from edgel.cloud import Cloud
from edgel.io.columns import fits_float32, flat_attributes, narrowed, one_line
from edgel.io.errors import FormatError, tell
from edgel.io.files import reading, replacing
from edgel.io.limits import LONGEST_LINE, whole_number
from edgel.io.mesh import OFFER
from edgel.io.ply_grid import range_grid, read_grid, spread
from edgel.io.ply_header import NAMES, Element, Header, cut_off, read_header
from edgel.io.ply_lists import gather, skip, walk
from edgel.io.rows import number_of, parse_text, read_binary, reject_row, remaining_bytes, write_binary

# CloudCompare's mark of a scalar field; what other programs know by name has none.
PREFIX = "scalar_"
_KNOWN = {*COLORS, "alpha", *NORMALS, "intensity"}
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
        All scalar vertex properties as (N,) attributes of their own type and name, but for the prefix of `write`; list
        properties, faces and other elements are left out, and named in ``metadata["left_out"]``; with faces
        ``metadata["notices"]`` says that it is a mesh. ``obj_info num_cols`` and ``num_rows`` make the cloud organized;
        where Stanford's ``range_grid`` lists only the valid points, the other cells are NaN.

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
    cloud = _to_cloud(path, header, xyz, _without_prefix(header, attributes))
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


def _without_prefix(header: Header, attributes: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Take off the prefix that `write` has put before names; all stay as they are where one would be there twice."""
    prefix = header.info.get("prefix", "")
    bare = {name.removeprefix(prefix) or name: values for name, values in attributes.items()}
    clash = len(bare) < len(attributes) or any(name.lower() in ("x", "y", "z") for name in bare)
    return attributes if clash else bare


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

    Coordinates become float when that is exact for all of them, else double. Other programs know normals ``nx ny nz``,
    colors and ``intensity`` by name; attributes of any other name get CloudCompare's prefix ``scalar_``, without which
    it does not load them; ``obj_info prefix`` says so, and `read` takes it off again. The types are those that Open3D
    reads: the smallest of uchar, int, float and double that holds every value exactly, no smaller than the attribute's
    own. (N, C) attributes become ``name_0 .. name_{C-1}``. Organized shape (``num_cols``, ``num_rows``, the Stanford
    convention), viewpoint and CRS go into ``obj_info`` lines.

    Parameters
    ----------
    path : path or binary file
    cloud : Cloud

    Warns
    -----
    FormatWarning
        If an attribute is left out because PLY cannot hold it exactly, or is renamed.

    Raises
    ------
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
    said: dict[str, str] = {}
    columns = dict(zip("xyz", cloud.xyz.T, strict=True))
    types = dict.fromkeys("xyz", "f4" if fits_float32(cloud.xyz) else "f8")
    for name, values in flat_attributes(cloud, said).items():
        stored = narrowed(values, _types(name, values))
        if stored is None:
            said[name] = f"left out, {values.dtype} fits no type of PLY exactly; .npz holds it"
            continue
        word = name if name.lower() in _KNOWN else PREFIX + name
        columns[word], types[word] = stored, stored.dtype.str[1:]
    tell(path if isinstance(path, (str, os.PathLike)) else getattr(path, "name", "stream"), said)
    header = _header_text(cloud, types).encode("utf-8", "replace")
    dtype = np.dtype([(name, "<" + code) for name, code in types.items()])
    if isinstance(path, (str, os.PathLike)):
        with replacing(path) as file:
            file.write(header)
            write_binary(file, dtype, columns)
    else:
        path.write(header)
        write_binary(path, dtype, columns)


def _types(name: str, values: np.ndarray) -> list[str]:
    """Return the types that a column may have, the best first: those that Open3D reads, and bytes for colors."""
    if values.dtype.kind == "b" or values.dtype == np.uint8:
        return ["u1"]
    if values.dtype.kind == "f":
        return ["f4", "f8"] if values.dtype.itemsize < 8 else ["f8"]
    return ["u1", "i4", "f8"] if name in COLORS else ["i4", "f8"]


def _header_text(cloud: Cloud, types: dict[str, str]) -> str:
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {one_line(comment)}" for comment in cloud.metadata.get("ply_comments", ())]
    if cloud.shape is not None:
        lines += [f"obj_info num_cols {cloud.shape[1]}", f"obj_info num_rows {cloud.shape[0]}"]
    if cloud.viewpoint is not None:
        lines.append("obj_info viewpoint " + " ".join(map(repr, cloud.viewpoint.tolist())))
    if cloud.crs:
        lines.append(f"obj_info crs {one_line(cloud.crs)}")
    if any(name.startswith(PREFIX) for name in types):
        lines.append(f"obj_info prefix {PREFIX}")
    lines.append(f"element vertex {len(cloud)}")
    lines += [f"property {NAMES[code]} {name}" for name, code in types.items()]
    return "\n".join([*lines, "end_header", ""])
