"""PTX of Leica's programs: scans as grids of text, each in the scanner's frame with its pose."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from edgel._objects import COLORS
from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.limits import whole_number
from edgel.io.rows import number_of, parse_text
from edgel.io.text_lines import as_number, bare, read_lines

_HEADER = 10  # lines: columns, rows, position, three axes, a matrix of four
_NAMES = {3: [], 4: ["intensity"], 6: COLORS, 7: ["intensity", *COLORS]}


@dataclass(frozen=True)
class _Scan:
    xyz: np.ndarray
    attributes: dict[str, np.ndarray]
    shape: tuple[int, int]
    position: np.ndarray


def read(path: str | os.PathLike[str]) -> Cloud:
    r"""Read a PTX file, all its scans with their poses applied.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        x, y, z in the frame of the registered scans, in the order of the file; 0 0 0, which stands for no return, is
        NaN. ``intensity`` is float64, ``red green blue`` are uint8. One scan is organized, with the scanner's columns,
        one after the other in the file, as rows of the cloud, and the scanner's position as viewpoint. With several
        ``scan_index`` tells the scan, ``metadata["scan_shapes"]`` the shape of each, into which its points can be
        brought again, and ``metadata["scan_positions"]`` where its scanner stood.

    Raises
    ------
    FormatError
        If the file is not PTX, or is cut off or damaged; the message names the line.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> pose = "0 0 5\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 5 1\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "a.ptx")
    ...     _ = file.write_text("1\n2\n" + pose + "1 2 3 0.5\n0 0 0 0.5\n")
    ...     cloud = read(file)
    >>> cloud.xyz, cloud.shape
    (array([[ 1.,  2.,  8.],
           [nan, nan, nan]]), (1, 2))
    """
    name = os.fspath(path)
    lines = [text for line in read_lines(path) if (text := bare(line))]
    scans = list(_scans(name, lines))
    if not scans:
        raise FormatError(f"{name}: no scan in it; get the file again")
    names = dict.fromkeys(column for scan in scans for column in scan.attributes)
    attributes = {column: np.concatenate([_column(scan, column) for scan in scans]) for column in names}
    if all(column in attributes and _are_bytes(attributes[column]) for column in COLORS):
        attributes |= {column: attributes[column].astype(np.uint8) for column in COLORS}
    if len(scans) == 1:
        return Cloud(scans[0].xyz, attributes, scans[0].shape, scans[0].position)
    attributes["scan_index"] = np.repeat(np.arange(len(scans), dtype=np.int32), [len(scan.xyz) for scan in scans])
    shapes = tuple(scan.shape for scan in scans)
    positions = tuple(tuple(scan.position.tolist()) for scan in scans)
    metadata = {"scan_shapes": shapes, "scan_positions": positions}
    return Cloud(np.concatenate([scan.xyz for scan in scans]), attributes, metadata=metadata)


def _are_bytes(values: np.ndarray) -> bool:
    return bool(((values >= 0) & (values <= 255) & (values == np.rint(values))).all())


def _column(scan: _Scan, name: str) -> np.ndarray:
    return scan.attributes.get(name, np.full(len(scan.xyz), np.nan))


def _scans(path: str, lines: list[str]) -> Iterator[_Scan]:
    position, number = 0, 0
    while position < len(lines):
        extent = [whole_number(line) for line in lines[position : position + 2]]
        if len(extent) < 2 or None in extent:
            found = lines[position][:60]
            raise FormatError(
                f"{path}: expected the numbers of columns and rows of a scan, each in a line, found {found!r}; a list "
                "of points is .pts or .xyz, else get the file again"
            )
        shape = extent[0] or 0, extent[1] or 0
        size, first = shape[0] * shape[1], position + _HEADER
        if len(lines) < first + size:
            raise FormatError(
                f"{path}: declared {size} points, found {max(len(lines) - first, 0)}; the file is cut off: get it again"
            )
        pose = [_numbers(path, line) for line in lines[position + 2 : first]]
        if [len(row) for row in pose] != [3, 3, 3, 3, 4, 4, 4, 4]:
            raise FormatError(
                f"{path}: no pose of a scanner behind {lines[position]!r} {lines[position + 1]!r}; get the file again"
            )
        # Points are rows in PTX: the last row of the matrix moves them.
        matrix = np.array(pose[4:])
        number += 1
        yield _scan(f"{path}: scan {number}", lines[first : first + size], shape, matrix)
        position = first + size


def _scan(path: str, rows: list[str], shape: tuple[int, int], matrix: np.ndarray) -> _Scan:
    width = len(rows[0].split()) if rows else 4
    if width not in _NAMES:
        raise FormatError(
            f"{path}, point 1: x y z, intensity, red green blue are known, found {rows[0][:60]!r}; mend the file"
        )
    names = _NAMES[width]
    dtype = np.dtype([(name, "f8") for name in ("x", "y", "z", *names)])
    try:
        table = parse_text(rows, dtype) if rows else np.empty(0, dtype)
    except ValueError:
        plain = [" ".join(map(as_number, row.split())) for row in rows]
        for i, words in enumerate(map(str.split, plain)):
            if len(words) != width or not all(map(number_of, words)):
                raise FormatError(
                    f"{path}, point {i + 1}: expected {width} numbers, found {rows[i][:60]!r}; mend the file"
                ) from None
        table = parse_text(plain, dtype)
    xyz = np.column_stack([table[axis] for axis in "xyz"])
    xyz[(xyz == 0).all(axis=1)] = np.nan
    attributes = {name: np.ascontiguousarray(table[name]) for name in names}
    return _Scan(xyz @ matrix[:3, :3] + matrix[3, :3], attributes, shape, matrix[3, :3].copy())


def _numbers(path: str, line: str) -> list[float]:
    words = line.split()
    if not all(number_of(word) and np.isfinite(float(word)) for word in words):
        raise FormatError(f"{path}: expected the numbers of a scanner's pose, found {line[:60]!r}; get the file again")
    return list(map(float, words))
