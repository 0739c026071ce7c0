"""LAS, LAZ and COPC by laspy: every dimension, scales, offsets, extra dimensions and the CRS."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import laspy
import numpy as np

from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.files import reading, wrong_magic
from edgel.io.las_crs import crs_of
from edgel.io.las_header import foreign_errors, waveforms_of
from edgel.io.las_write import write
from edgel.io.laz import CheckedLaz

__all__ = ["read", "write"]

# laspy logs an error before it raises it, which Python prints when nobody listens; the exception says the same.
logging.getLogger("laspy").addHandler(logging.NullHandler())

# Points decoded at a time: a header that promises too many costs no more than this.
_CHUNK = 1_000_000


def read(path: str | os.PathLike[str]) -> Cloud:
    """Read a LAS, LAZ or COPC file.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        Every dimension but X, Y, Z as an attribute by laspy's name, bit fields and extra dimensions too. The CRS is WKT
        or ``EPSG:n`` if the file has one; ``metadata["las_header"]`` is laspy's header, with scales, offsets and all
        records (VLR and EVLR), for `write`. Waveforms that are no EVLR are named in ``metadata["left_out"]``.

    Raises
    ------
    FormatError
        If the file is not LAS, is cut off, or its compression is damaged or not known.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(f"{folder}/a.laz", Cloud(np.eye(3), {"intensity": np.array([1, 2, 3], np.uint16)}))
    ...     read(f"{folder}/a.laz").attributes["intensity"]
    array([1, 2, 3], dtype=uint16)
    """
    with _opened(path) as (name, reader):
        columns = _read_columns(name, reader)
    return _cloud(name, reader.header, columns)


def read_chunks(path: str | os.PathLike[str], rows: int) -> Iterator[Cloud]:
    """Read consecutive stretches of so many rows, each as `read` would; at least one, empty where the file is.

    Raises
    ------
    FormatError
        As `read`; of what is wrong with the points, when they are reached.
    """
    with _opened(path) as (name, reader):
        for columns in _column_chunks(name, reader, rows):
            yield _cloud(name, reader.header, columns)


def count_rows(path: str | os.PathLike[str]) -> int | None:
    """Return the number of points that the header promises; None where it cannot be read."""
    try:
        with _opened(path) as (_, reader):
            return int(reader.header.point_count)
    except (FormatError, OSError):
        return None


@contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[tuple[str, laspy.LasReader]]:
    """Open a file whose header has been checked; yields its name too."""
    name = os.fspath(path)
    with reading(path) as file:
        size = os.fstat(file.fileno()).st_size
        head = file.read(512)
        if not head.startswith(b"LASF"):
            wrong_magic(name, "a LAS or LAZ file", head)
        _check_records(name, file, head, size)
        file.seek(0)
        backend: Any = CheckedLaz(name, size)  # laspy asks for its own type, and needs two methods of it
        with foreign_errors(name, "reading LAS"), laspy.open(file, closefd=False, laz_backend=backend) as reader:
            _check_size(name, reader.header, size)
            yield name, reader


def _cloud(name: str, header: laspy.LasHeader, columns: dict[str, np.ndarray]) -> Cloud:
    scales, offsets = np.asarray(header.scales), np.asarray(header.offsets)
    if not (np.isfinite(scales).all() and np.isfinite(offsets).all()):
        raise FormatError(
            f"{name}: the scales {scales} or offsets {offsets} of the header are not finite; get the file again"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        xyz = np.column_stack([columns.pop(axis) * scales[i] + offsets[i] for i, axis in enumerate("XYZ")])
    if not np.isfinite(xyz).all():
        raise FormatError(
            f"{name}: scales {scales} make coordinates infinite; the header is damaged: get the file again"
        )
    metadata: dict[str, object] = {"las_header": header}
    if left_out := waveforms_of(header):
        metadata["left_out"] = (left_out,)
    return Cloud(xyz, columns, crs=crs_of(header), metadata=metadata)


def _check_records(path: str, file: BinaryIO, head: bytes, size: int) -> None:
    """Compare the promised records with the file's size: laspy would read billions of empty ones."""
    num_extended = int.from_bytes(head[243:247], "little") if head[25:26] >= b"\x04" else 0
    for count, length in ((int.from_bytes(head[100:104], "little"), 54), (num_extended, 60)):
        if count * length > size:
            raise FormatError(f"{path}: declared {count} header records, the file has {size} bytes; get the file again")
    place, end = int.from_bytes(head[235:243], "little"), int.from_bytes(head[96:100], "little")
    for _ in range(num_extended):
        file.seek(min(place + 20, size))
        place += 60 + int.from_bytes(file.read(8), "little")
        end = max(end, place)
        if end > size:
            break
    if end > size:
        raise FormatError(f"{path}: declared records up to byte {end}, found {size}; get the file again")


def _check_size(path: str, header: laspy.LasHeader, size: int) -> None:
    """Compare the promised points with the file's size; packed points only become known when they are unpacked."""
    if header.are_points_compressed:
        return
    found = max(size - header.offset_to_point_data, 0) // header.point_format.size
    if found < header.point_count:
        raise FormatError(
            f"{path}: declared {header.point_count} points, found {found}; the file is cut off: get it again"
        )


def _read_columns(path: str, reader: laspy.LasReader) -> dict[str, np.ndarray]:
    parts = list(_column_chunks(path, reader, _CHUNK))
    return parts[0] if len(parts) == 1 else {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _column_chunks(path: str, reader: laspy.LasReader, rows: int) -> Iterator[dict[str, np.ndarray]]:
    """Read the columns of so many rows at a time; at least once, empty where the file is."""
    names, found = list(reader.header.point_format.dimension_names), 0
    for points in reader.chunk_iterator(rows):
        found += len(points)
        yield {name: np.array(points[name]) for name in names}
    _check_count(path, reader.header, found)
    if not found:
        yield _no_columns(reader.header)


def _check_count(path: str, header: laspy.LasHeader, found: int) -> None:
    if found != header.point_count:
        declared = header.point_count
        raise FormatError(f"{path}: declared {declared} points, found {found}; the file is cut off: get it again")


def _no_columns(header: laspy.LasHeader) -> dict[str, np.ndarray]:
    empty = laspy.ScaleAwarePointRecord.zeros(0, header=header)
    return {name: np.array(empty[name]) for name in header.point_format.dimension_names}
