"""The numbers of a text of points, as columns: at NumPy's speed where it is clean, value by value where it is not."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from edgel.io.errors import FormatError
from edgel.io.rows import parse_text
from edgel.io.text_layout import Layout
from edgel.io.text_lines import as_number, bare, is_number, split

_INTEGER = re.compile(r"[-+]?\d{1,20}")
_CHUNK = 65536  # lines whose values are held as texts at a time


def parse(path: str, lines: list[str], layout: Layout) -> dict[int, np.ndarray]:
    """Return the columns by their places in the text: integers int64 (or uint64), other numbers float64, words texts.

    Raises
    ------
    FormatError
        If a line has not the numbers that it should have; the message names it.
    """
    columns = _parse_plain(lines, layout) if layout.is_plain else None
    return columns or _parse_values(path, lines, layout)


def _parse_plain(lines: list[str], layout: Layout) -> dict[int, np.ndarray] | None:
    """Parse lines that NumPy understands, None if there are others among them."""
    data = lines[layout.first :]
    if any("#" in line or "//" in line or '"' in line or "'" in line for line in data):
        return None
    data = [line for line in data if line and not line.isspace()]
    if layout.delimiter != ",":
        data = [line.replace(",", ".") for line in data] if any("," in line for line in data) else data
    whole = [all(_INTEGER.fullmatch(row[i]) for row in layout.sample) for i in range(layout.width)]
    codes = ["i8" if whole[i] and i not in layout.axes else "f8" for i in range(layout.width)]
    try:
        table = parse_text(
            data, np.dtype([(f"f{i}", code) for i, code in enumerate(codes)]), delimiter=layout.delimiter
        )
    except ValueError:
        return None
    return {i: np.ascontiguousarray(table[f"f{i}"]) for i in range(layout.width)}


def _parse_values(path: str, lines: list[str], layout: Layout) -> dict[int, np.ndarray]:
    """Parse value by value: quotes, missing values, lines of unequal length, words for NaN."""
    parts: list[dict[int, np.ndarray]] = []
    sizes: list[int] = []
    has_values: set[int] = set()
    for numbers, rows in _chunks(path, lines, layout):
        part = {}
        for i in range(max(map(len, rows))):
            if i in layout.unread:
                continue
            values = [row[i] if i < len(row) else "" for row in rows]
            if any(values):
                has_values.add(i)
            if i in layout.texts and i not in layout.axes:
                part[i] = np.array(values)
                continue
            try:
                part[i] = _numbers(values, whole=i not in layout.axes)
            except ValueError:
                row = next(k for k, value in enumerate(values) if not is_number(value))
                raise _bad_line(path, lines, numbers[row], layout) from None
        parts.append(part)
        sizes.append(len(rows))
    named = range(len(layout.names or ()))
    # A column without name and values is what a separator at the end of every line makes.
    kept = sorted(i for i in {*has_values, *named} - {*layout.unread} if i in has_values or not _is_unnamed(layout, i))
    return {
        i: np.concatenate([part.get(i, _missing(i, size, layout)) for part, size in zip(parts, sizes, strict=True)])
        for i in kept
    }


def _missing(column: int, size: int, layout: Layout) -> np.ndarray:
    return np.full(size, "" if column in layout.texts else np.nan)


def _is_unnamed(layout: Layout, column: int) -> bool:
    return layout.names is None or column >= len(layout.names) or layout.names[column] == f"column_{column}"


def _chunks(path: str, lines: list[str], layout: Layout) -> Iterator[tuple[list[int], list[list[str]]]]:
    """Yield some numbers of lines (from 0) and the values in them."""
    numbers, rows = [], []
    last = max(layout.axes, default=2)
    for number in range(layout.first, len(lines)):
        text = bare(lines[number])
        if not text:
            continue
        row = split(text, layout.delimiter)
        # Between marks what a short line lacks are its last values; between blanks nobody knows.
        if len(row) <= last or (layout.delimiter is None and len(row) != layout.width):
            raise _bad_line(path, lines, number, layout)
        numbers.append(number)
        rows.append(row)
        if len(rows) == _CHUNK:
            yield numbers, rows
            numbers, rows = [], []
    if rows:
        yield numbers, rows


def _numbers(values: list[str], *, whole: bool) -> np.ndarray:
    """Return values as int64 or uint64 if all are whole and fit, else as float64."""
    if whole and all(map(_INTEGER.fullmatch, values)):
        for code in (np.int64, np.uint64):
            try:
                return np.array([int(value) for value in values], code)
            except OverflowError:
                continue
    return np.array([float(as_number(value)) for value in values])


def _bad_line(path: str, lines: list[str], number: int, layout: Layout) -> FormatError:
    return FormatError(
        f"{path}: line {number + 1}: expected {layout.width} numbers, found {bare(lines[number])[:60]!r}; mend the file"
    )
