"""Binary PLY elements with list properties: where each value begins."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from edgel._kernels.parallel import kernel
from edgel.io.errors import FormatError
from edgel.io.ply_header import Element, Header, cut_off
from edgel.io.rows import remaining_bytes


@kernel
def _walk_rows(
    data: np.ndarray,
    start: int,
    count: int,
    sizes: np.ndarray,
    length_sizes: np.ndarray,
    big_endian: bool,
    offsets: np.ndarray,
) -> int:
    """Find where the properties of each row begin.

    Parameters
    ----------
    data : (B,) uint8
        The file's bytes.
    start : int
        Where the first row begins.
    count : int
        Number of rows.
    sizes, length_sizes : (P,) int64
        Bytes of a value of each property; bytes of a list's length, 0 for a scalar.
    big_endian : bool
        Byte order of the lengths, which are read as unsigned.
    offsets : (count, P) or (0, P) int64
        Filled with the position of each value (of its length for a list) unless it has no rows.

    Returns
    -------
    int
        Position after the last row, or ``-1 - row`` of the first row that the data ends in.
    """
    position = start
    for row in range(count):
        for column in range(len(sizes)):
            if len(offsets) > 0:
                offsets[row, column] = position
            length = 1
            if length_sizes[column] > 0:
                if position + length_sizes[column] > len(data):
                    return -1 - row
                length = 0
                for i in range(length_sizes[column]):
                    shift = 8 * (length_sizes[column] - 1 - i) if big_endian else 8 * i
                    length |= np.int64(data[position + i]) << shift
                position += length_sizes[column]
            # Divided, not multiplied: an absurd length must not overflow.
            if length < 0 or length > (len(data) - position) // sizes[column]:
                return -1 - row
            position += length * sizes[column]
    return position


def gather(data: np.ndarray, offsets: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Read one value of `dtype` at each offset of the bytes `data`, in native byte order."""
    raw = data[offsets[:, None] + np.arange(dtype.itemsize)]
    return np.ascontiguousarray(raw).view(dtype)[:, 0].astype(dtype.newbyteorder("="))


def skip(path: str, file: BinaryIO, header: Header, element: Element) -> None:
    """Pass over an element of a binary file."""
    if not any(p.length_code for p in element.properties):
        if element.count * element.min_row > remaining_bytes(file):
            raise FormatError(
                f"{path}: the data ends within element {element.name!r}; the file is cut off: get it again"
            )
        file.seek(element.count * element.min_row, 1)
        return
    walk(path, file, header, element, keep=False)


def walk(path: str, file: BinaryIO, header: Header, element: Element, *, keep: bool) -> tuple[np.ndarray, np.ndarray]:
    """Pass over an element with lists; return its bytes and, if they are to be kept, where each value begins."""
    if element.count * element.min_row > remaining_bytes(file):
        raise cut_off(path, element.count, remaining_bytes(file) // element.min_row)
    start = file.tell()
    data = np.frombuffer(file.read(), np.uint8)
    sizes = np.array([np.dtype(p.code).itemsize for p in element.properties], np.int64)
    lengths = np.array([np.dtype(p.length_code).itemsize if p.length_code else 0 for p in element.properties], np.int64)
    offsets = np.empty((element.count if keep else 0, len(sizes)), np.int64)
    end = _walk_rows(data, 0, element.count, sizes, lengths, header.order == ">", offsets)
    if end < 0:
        raise FormatError(
            f"{path}: declared {element.count} of element {element.name!r}, the data ends in number {-1 - end}; "
            "the file is cut off or a list length is wrong: get it again"
        )
    file.seek(start + end)
    return data, offsets
