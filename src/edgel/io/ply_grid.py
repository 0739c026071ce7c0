"""Stanford's range grids in PLY: an organized cloud of which only the valid points are listed."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import BinaryIO

import numpy as np

from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.ply_header import Header
from edgel.io.ply_lists import gather, skip, walk


def range_grid(header: Header) -> tuple[int, tuple[int, int]] | None:
    """Return position and shape of Stanford's range_grid element behind the vertices, None when there is none."""
    names = [element.name for element in header.elements]
    if header.shape is None or "range_grid" not in names[names.index("vertex") :]:
        return None
    position = names.index("range_grid", names.index("vertex"))
    grid = header.elements[position]
    lists = [p.length_code is not None for p in grid.properties]
    return (position, header.shape) if grid.count == header.shape[0] * header.shape[1] and lists == [True] else None


def read_grid(path: str, file: BinaryIO, header: Header, position: int) -> np.ndarray:
    """Read which vertex each cell of a range grid holds (-1: none)."""
    grid = header.elements[position]
    if header.ascii:
        file.seek(header.size)
        lines = (line for line in file if not line.isspace())
        first = sum(element.count for element in header.elements[:position])
        cells = [line.split() for line in islice(lines, first, first + grid.count)]
        good = len(cells) == grid.count
        good = good and all(cell == [b"0"] or (cell[0] == b"1" and len(cell) == 2) for cell in cells)
        if not good or not all(cell[-1].isdigit() for cell in cells):
            raise FormatError(f"{path}: element range_grid is cut off, or a cell holds several points; get it again")
        return np.array([int(cell[1]) if cell[0] == b"1" else -1 for cell in cells])
    for element in header.elements[header.index("vertex") + 1 : position]:
        skip(path, file, header, element)
    data, offsets = walk(path, file, header, grid, keep=True)
    length = np.dtype(header.order + (grid.properties[0].length_code or ""))
    filled = gather(data, offsets[:, 0], length) == 1
    index = np.full(grid.count, -1, np.int64)
    starts = offsets[filled, 0] + length.itemsize
    index[filled] = gather(data, starts, np.dtype(header.order + grid.properties[0].code))
    return index


def spread(path: str, cloud: Cloud, index: np.ndarray, shape: tuple[int, int]) -> Cloud:
    """Put the points of a range grid into their cells; the others become NaN (attributes that have no NaN: 0)."""
    if len(index) and index.max() >= len(cloud):
        raise FormatError(
            f"{path}: range_grid names vertex {index.max()} of {len(cloud)}; the file is damaged: get it again"
        )
    filled = index >= 0
    xyz = np.full((len(index), 3), np.nan)
    xyz[filled] = cloud.xyz[index[filled]]
    attributes = {}
    for name, values in cloud.attributes.items():
        attributes[name] = np.full(len(index), np.nan if values.dtype.kind == "f" else 0, values.dtype)
        attributes[name][filled] = values[index[filled]]
    return replace(cloud, xyz=xyz, attributes=attributes, shape=shape)
