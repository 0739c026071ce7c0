"""Stanford's range grids in PLY: an organized cloud of which only the valid points are listed."""

from __future__ import annotations

from itertools import islice
from typing import BinaryIO

import numpy as np

from edgel.cloud import Cloud
from edgel.io.cells import in_cells
from edgel.io.errors import FormatError
from edgel.io.limits import check_unpacked, whole_number
from edgel.io.ply_header import Header
from edgel.io.ply_lists import gather, skip, walk

_BAD = -2


def range_grid(header: Header) -> tuple[int, tuple[int, int]] | None:
    """Return position and shape of Stanford's range_grid element behind the vertices, None when there is none."""
    names = [element.name for element in header.elements]
    if header.shape is None or "range_grid" not in names[names.index("vertex") :]:
        return None
    position = names.index("range_grid", names.index("vertex"))
    grid = header.elements[position]
    lists = [p.length_code is not None for p in grid.properties]
    whole = grid.count == header.shape[0] * header.shape[1] and lists == [True] and grid.properties[0].code[0] in "iu"
    return (position, header.shape) if whole else None


def read_grid(path: str, file: BinaryIO, header: Header, position: int) -> np.ndarray:
    """Read which vertex each cell of a range grid holds (-1: none)."""
    grid, after = header.elements[position], file.tell()
    size = file.seek(0, 2)
    # A cell takes a byte or two of the file, and all that a vertex has in memory.
    check_unpacked(path, grid.count * (24 + header.elements[header.index("vertex")].min_row), size)
    file.seek(after)
    if header.ascii:
        file.seek(header.size)
        lines = (line for line in file if not line.isspace())
        first = sum(element.count for element in header.elements[:position])
        # A cell of its own line: what is promised beyond the file's bytes is not there.
        cells = islice(lines, min(first, size), min(first + grid.count, size))
        index = np.fromiter(map(_cell, cells), np.int64)
        if len(index) != grid.count or (index == _BAD).any():
            raise FormatError(f"{path}: element range_grid is cut off, or a cell holds several points; get it again")
        return index
    for element in header.elements[header.index("vertex") + 1 : position]:
        skip(path, file, header, element)
    data, offsets = walk(path, file, header, grid, keep=True)
    length = np.dtype(header.order + (grid.properties[0].length_code or ""))
    filled = gather(data, offsets[:, 0], length) == 1
    index = np.full(grid.count, -1, np.int64)
    starts = offsets[filled, 0] + length.itemsize
    index[filled] = gather(data, starts, np.dtype(header.order + grid.properties[0].code))
    return index


def _cell(line: bytes) -> int:
    """Return the vertex that a line of a grid names, -1 for none, _BAD for anything else."""
    words = line.split() if len(line) < 64 else []
    if words == [b"0"]:
        return -1
    number = whole_number(words[1].decode("utf-8", "replace")) if len(words) == 2 and words[0] == b"1" else None
    return _BAD if number is None else number


def spread(path: str, cloud: Cloud, index: np.ndarray, shape: tuple[int, int]) -> Cloud:
    """Put the points of a range grid into their cells."""
    if len(index) and index.max() >= len(cloud):
        raise FormatError(
            f"{path}: range_grid names vertex {index.max()} of {len(cloud)}; the file is damaged: get it again"
        )
    return in_cells(cloud, index, shape)
