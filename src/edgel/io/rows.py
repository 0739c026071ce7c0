"""Rows of numbers in a text or a binary file, read into columns."""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Iterable
from typing import BinaryIO

import numpy as np

from edgel.io.errors import FormatError
from edgel.io.limits import LONGEST_LINE

# Rows copied at a time: small enough that a chunk is still in the cache when its columns are taken out of it.
CHUNK = 32768


def remaining_bytes(file: BinaryIO) -> int:
    """Return how many bytes lie between the file's position and its end."""
    here = file.tell()
    end = file.seek(0, 2)
    file.seek(here)
    return end - here


def read_binary(
    file: BinaryIO, dtype: np.dtype, count: int, axes: list[str], *, leave_out: Collection[str] = ()
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Read `count` records; the caller has checked that the file is long enough.

    Parameters
    ----------
    file : binary file
    dtype : structured dtype
        One record.
    count : int
        Number of records.
    axes : list of str
        Fields that hold x, y and z.
    leave_out : collection of str
        Fields that are not wanted.

    Returns
    -------
    xyz : (count, 3) float64
    columns : dict of str to (count,) or (count, C) array
        The other fields in native byte order.
    """
    names = [name for name in dtype.names or () if name not in axes and name not in leave_out]
    xyz = np.empty((count, 3), np.float64)
    columns = {name: np.empty((count, *dtype[name].shape), dtype[name].base.newbyteorder("=")) for name in names}
    buffer = np.empty(min(count, CHUNK), dtype)
    for start in range(0, count, CHUNK):
        records = buffer[: min(CHUNK, count - start)]
        if file.readinto(records.view(np.uint8)) != records.nbytes:  # pyright: ignore[reportAttributeAccessIssue]
            raise EOFError("the file became shorter while it was read")
        stop = start + len(records)
        for axis, name in enumerate(axes):
            xyz[start:stop, axis] = records[name]
        for name in names:
            columns[name][start:stop] = records[name]
    return xyz, columns


def write_binary(file: BinaryIO, dtype: np.dtype, columns: dict[str, np.ndarray]) -> None:
    """Write columns, keyed by the field names of `dtype`, as records."""
    count = len(next(iter(columns.values())))
    buffer = np.empty(min(count, CHUNK), dtype)
    for start in range(0, count, CHUNK):
        records = buffer[: min(CHUNK, count - start)]
        for name, values in columns.items():
            records[name] = values[start : start + len(records)]
        file.write(records.view(np.uint8).data)


def parse_text(
    lines: Iterable[str],
    dtype: np.dtype,
    *,
    delimiter: str | None = None,
    count: int | None = None,
    comments: str | None = None,
) -> np.ndarray:
    """Parse lines of numbers into records (C speed, exact to the last bit).

    Raises
    ------
    ValueError
        If a line has another number of columns or a word that is not a number of its column's type.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("error", category=DeprecationWarning)  # "1.5" in an integer column
        warnings.filterwarnings("ignore", message=".*input contained no data.*")
        try:
            table = np.loadtxt(lines, dtype, comments=comments, delimiter=delimiter, max_rows=count, ndmin=1)
        except (DeprecationWarning, OverflowError) as error:
            raise ValueError(str(error)) from None
    return table


def number_of(token: str) -> bool:
    """Whether a word is a number as `parse_text` reads them.

    Examples
    --------
    >>> number_of("-1.5e3"), number_of("nan"), number_of("1_000"), number_of("x")
    (True, True, False, False)
    """
    if "_" in token:
        return False
    try:
        float(token)
    except ValueError:
        return False
    return True


def first_bad_line(
    lines: Iterable[str], width: int, *, delimiter: str | None = None, comment: str = "#"
) -> tuple[int, str]:
    """Return number (from 1) and text of the first line that has not `width` numbers, (0, "") when all have."""
    for number, line in enumerate(lines, 1):
        text = line.split(comment)[0].strip() if comment else line.strip()
        if not text:
            continue
        if len(text) > LONGEST_LINE:
            return number, text[:60]
        tokens = [token.strip() for token in (text.split(delimiter) if delimiter else text.split())]
        if len(tokens) != width or not all(number_of(token) for token in tokens):
            return number, line.strip()[:60]
    return 0, ""


def reject_row(path: object, what: str, lines: Iterable[str], width: int, error: Exception, first: int) -> FormatError:
    """Return the FormatError that shows the line a parser stumbled over.

    Parameters
    ----------
    path, what : object, str
        The file, and what the lines should hold.
    lines : iterable of str
        The lines that were parsed; the first of them is line `first` of the file.
    width : int
        Numbers in each line.
    error : Exception
        What the parser said, shown when every line has the right form.
    first : int
        Line number in the file of the first line.
    """
    number, text = first_bad_line(lines, width, comment="")
    if number:
        return FormatError(
            f"{path}: line {first + number - 1}: expected {width} numbers ({what}), found {text!r}; mend the file"
        )
    return FormatError(
        f"{path}: {what}: {re.sub(r' at row.*', '', str(error))}; a value does not fit the type the header gives"
    )
