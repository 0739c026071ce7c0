"""Clouds a stretch of rows at a time, for those that do not fit into memory."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from edgel.cloud import Cloud
from edgel.io import read

ROWS = 2_000_000  # of a stretch
_LAS = (".las", ".laz")


def read_chunks(path: str | os.PathLike[str]) -> Iterator[Cloud]:
    """Read consecutive stretches of a file's rows, at most `ROWS` each; LAS, LAZ, COPC and NPY, others as a whole.

    Yields
    ------
    Cloud
        At least one, empty where the file is.

    Raises
    ------
    See `edgel.read`.
    """
    extension = Path(path).suffix.lower()
    if extension in _LAS:
        from edgel.io import las  # not at the top: laspy takes time to import

        yield from las.read_chunks(path, ROWS)
        return
    plain = _plain_array(path) if extension == ".npy" else None
    if plain is None:
        yield read(path)
        return
    for start in range(0, len(plain), ROWS):
        yield Cloud(np.array(plain[start : start + ROWS], np.float64))


def read_rows(path: str | os.PathLike[str], rows: np.ndarray) -> Cloud:
    """Read some rows (M,) of a file, ascending, with all their attributes, and never more than a stretch besides.

    Raises
    ------
    See `edgel.read`.
    """
    taken, begin = [], 0
    for cloud in read_chunks(path):
        first, last = np.searchsorted(rows, (begin, begin + len(cloud)))
        taken.append(cloud.take(rows[first:last] - begin))
        begin += len(cloud)
    columns = {name: np.concatenate([part.attributes[name] for part in taken]) for name in taken[0].attributes}
    return replace(taken[0], xyz=np.concatenate([part.xyz for part in taken]), attributes=columns)


def count_rows(path: str | os.PathLike[str]) -> int | None:
    """Return how many rows a file has, where its header says so at once; None where it does not, or is damaged."""
    extension = Path(path).suffix.lower()
    if extension in _LAS:
        from edgel.io import las

        return las.count_rows(path)
    plain = _plain_array(path) if extension == ".npy" else None
    return None if plain is None else len(plain)


def _plain_array(path: str | os.PathLike[str]) -> np.ndarray | None:
    """Map a file that holds nothing but coordinates (N, 3) into memory; None for any other."""
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError):  # `read` says what is wrong with it
        return None
    return array if array.ndim == 2 and array.shape[1] == 3 and len(array) and array.dtype.kind == "f" else None
