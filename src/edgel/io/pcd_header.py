"""The header of a PCD file: its fields, extent, viewpoint and kind of data."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import BinaryIO

import numpy as np

from edgel._objects import find_xyz
from edgel.io.errors import FormatError
from edgel.io.files import wrong_magic
from edgel.io.limits import LONGEST_HEADER, whole_number
from edgel.io.rows import number_of

SHIFT = "# edgel shift"
"""How the comment begins that holds what was taken from x, y and z."""
_TYPES = {"F": ("4", "8"), "I": ("1", "2", "4", "8"), "U": ("1", "2", "4", "8")}
# Values of one point, all fields together: a histogram has hundreds.
_MOST_VALUES = 1 << 20


@dataclass(frozen=True)
class Header:
    """What a PCD header says; `axes` are the fields of x, y and z, `padding` those to leave out.

    `shift` is what `edgel.io.pcd_write` has taken from all coordinates, which it says in a comment.
    """

    dtype: np.dtype
    padding: list[str]
    axes: list[str]
    width: int
    height: int
    count: int
    viewpoint: tuple[float, ...] | None
    data: str
    num_lines: int
    shift: tuple[float, float, float] | None = None


def read_header(path: str, file: BinaryIO) -> Header:
    """Read the header and leave the file where the data begins; FormatError if there is none or it is broken."""
    entries: dict[str, list[str]] = {}
    num_lines, head = 0, bytearray()  # bytes would be copied with each line
    while "DATA" not in entries:
        line = file.readline(1 << 16)
        head += line
        num_lines += 1
        words = line.decode("utf-8", "replace").split("#")[0].split()
        if words and words[0].upper() in ("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT",
                                          "VIEWPOINT", "POINTS", "DATA"):  # fmt: skip
            entries[words[0].upper()] = words[1:]
        elif words or not line:
            break
        if len(head) > LONGEST_HEADER:
            break
    if not re.match(rb"\s*(#\s*\.PCD|#|VERSION\s|FIELDS\s|COLUMNS\s)", head, re.IGNORECASE) or not entries:
        wrong_magic(path, "a PCD file (it has no PCD header)", bytes(head) + file.read(512))
    if "DATA" not in entries:
        raise FormatError(f"{path}: the PCD header breaks off at line {num_lines}, before DATA; get the file again")
    return replace(_parse_header(path, entries, num_lines), shift=_parse_shift(path, bytes(head)))


def _parse_shift(path: str, head: bytes) -> tuple[float, float, float] | None:
    line = re.search(rb"^" + SHIFT.encode() + rb"\b([^\n:]*)", head, re.MULTILINE)
    if line is None:
        return None
    words = line[1].decode("utf-8", "replace").split()
    if len(words) != 3 or not all(number_of(word) and np.isfinite(float(word)) for word in words):
        raise FormatError(f"{path}: {SHIFT} is {' '.join(words)[:60]!r}; three finite numbers are needed")
    return float(words[0]), float(words[1]), float(words[2])


def _parse_header(path: str, entries: dict[str, list[str]], num_lines: int) -> Header:
    fields = entries.get("FIELDS") or entries.get("COLUMNS") or []  # COLUMNS: PCD before 0.6
    sizes, types = entries.get("SIZE", []), entries.get("TYPE", [])
    counts = entries.get("COUNT", ["1"] * len(fields))
    if not fields or not len(fields) == len(sizes) == len(types) == len(counts):
        found = f"{len(fields)} FIELDS, {len(sizes)} SIZE, {len(types)} TYPE, {len(counts)} COUNT"
        raise FormatError(f"{path}: the PCD header does not fit together ({found}); mend or re-export the file")
    axes = find_xyz(fields)
    if axes is None or not {*axes} <= {field for field, count in zip(fields, counts, strict=True) if count.strip("0")}:
        raise FormatError(f"{path}: the PCD fields are {' '.join(fields)}; x, y and z are needed")
    layout, padding = [], []
    for i, (field, size, kind, count) in enumerate(zip(fields, sizes, types, counts, strict=True)):
        number = whole_number(count)
        if size not in _TYPES.get(kind.upper(), ()) or number is None or number > _MOST_VALUES:
            raise FormatError(
                f"{path}: PCD field {field!r} has TYPE {kind} SIZE {size} COUNT {count}; mend or re-export the file"
            )
        if number == 0:
            continue  # padding of nothing, as PCL writes it between fields that need none
        if field == "_":
            padding.append(f"_{i}")
        shape = () if number == 1 else (number,)
        layout.append((f"_{i}" if field == "_" else field, "<" + kind.lower() + size, shape))
    if sum(int(count) for count in counts) > _MOST_VALUES:
        raise FormatError(f"{path}: PCD COUNT {' '.join(counts)[:60]}: more than {_MOST_VALUES} values a point")
    names = [name for name, _, _ in layout]
    if len(set(names)) < len(names) or any(shape for name, _, shape in layout if name in axes):
        raise FormatError(
            f"{path}: PCD fields {' '.join(fields)}: a name twice, or a coordinate of several values; rename it"
        )
    width, height, points = _extent(path, entries)
    data = entries["DATA"][0].lower() if entries["DATA"] else ""
    if data not in ("ascii", "binary", "binary_compressed"):
        raise FormatError(
            f"{path}: PCD DATA is {data!r}; ascii, binary or binary_compressed is known: re-export the file"
        )
    view = entries.get("VIEWPOINT")
    if view is not None and (len(view) != 7 or not all(number_of(w) and np.isfinite(float(w)) for w in view)):
        raise FormatError(f"{path}: PCD VIEWPOINT is {' '.join(view)!r}; seven finite numbers are needed")
    viewpoint = tuple(map(float, view)) if view else None
    return Header(np.dtype(layout), padding, axes, width, height, points, viewpoint, data, num_lines)


def _extent(path: str, entries: dict[str, list[str]]) -> tuple[int, int, int]:
    numbers = {}
    for key in ("WIDTH", "HEIGHT", "POINTS"):
        words = entries.get(key)
        if words is None:
            continue
        number = whole_number(words[0]) if len(words) == 1 else None
        if number is None:
            raise FormatError(f"{path}: PCD {key} is {' '.join(words)[:60]!r}; one whole number is needed")
        numbers[key] = number
    if "WIDTH" not in numbers and "POINTS" not in numbers:
        raise FormatError(f"{path}: the PCD header has neither WIDTH nor POINTS; mend or re-export the file")
    height = numbers.get("HEIGHT", 1)
    width = numbers["WIDTH"] if "WIDTH" in numbers else numbers["POINTS"] // max(height, 1)
    points = numbers.get("POINTS", width * height)
    if width * height != points:
        raise FormatError(f"{path}: PCD WIDTH {width} x HEIGHT {height} is not POINTS {points}; mend the header")
    return width, height, points
