"""The header of a PLY file: its elements, comments and where the data begins."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from edgel.io.errors import FormatError
from edgel.io.files import wrong_magic
from edgel.io.limits import LONGEST_HEADER, whole_number

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
}
NAMES = {code: name for name, code in _TYPES.items()}
# The other spelling, and 64-bit integers, which the format does not have but some programs write.
_TYPES |= {f"{kind}{8 * size}": f"{kind[0]}{size}" for kind in ("int", "uint") for size in (1, 2, 4, 8)}
_TYPES |= {"float32": "f4", "float64": "f8"}
_END = re.compile(rb"[\r\n]end_header[ \t]*(\r\n|\r|\n|$)")
_BYTE_ORDER = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class Property:
    """One property of an element."""

    name: str
    code: str  # NumPy type of the value, or of a list's values
    length_code: str | None  # NumPy type of a list's length, None for a scalar


@dataclass(frozen=True)
class Element:
    """One element: its name, number of rows and properties."""

    name: str
    count: int
    properties: list[Property]

    @property
    def min_row(self) -> int:
        """Bytes that a binary row takes at least (its lists empty)."""
        return sum(np.dtype(p.length_code or p.code).itemsize for p in self.properties)


@dataclass(frozen=True)
class Header:
    """What a PLY header says; `order` is NumPy's sign of the byte order."""

    order: str
    ascii: bool
    elements: list[Element]
    comments: list[str]
    info: dict[str, str]
    num_lines: int
    size: int  # bytes

    def index(self, name: str) -> int:
        """Return the position of the first element of a name."""
        return [element.name for element in self.elements].index(name)

    @property
    def shape(self) -> tuple[int, int] | None:
        """Rows and columns that the obj_info lines give, None when they do not."""
        rows, cols = (whole_number(self.info.get(key, "")) for key in ("num_rows", "num_cols"))
        return None if rows is None or cols is None else (rows, cols)


def read_header(path: str, file: BinaryIO) -> Header:
    """Read the header and leave the file where the data begins; FormatError if there is none or it is broken."""
    head = file.read(1 << 16)
    if not re.match(rb"ply[ \t]*[\r\n]", head):
        wrong_magic(path, "a PLY file", head[:512])
    if not (end := _END.search(head)):
        head += file.read(LONGEST_HEADER)
        if not (end := _END.search(head)):
            raise FormatError(
                f"{path}: no end_header in the first {len(head)} bytes of the PLY file; it is cut off or damaged: "
                "get it again"
            )
    # With lines that end in a bare CR, an LF after end_header is data already.
    bare_return = not head[: end.start()].count(b"\n")
    file.seek(end.end(1) - (bare_return and end.group(1) == b"\r\n"))
    lines = re.split(r"\r\n|\r|\n", head[: end.start()].decode("utf-8", "replace"))
    return _parse_header(path, lines, file.tell())


def cut_off(path: str, declared: int, found: int) -> FormatError:
    """Return the error of a file that holds fewer vertices than its header says."""
    return FormatError(f"{path}: declared {declared} vertices, found {found}; the file is cut off: get it again")


def _parse_header(path: str, lines: list[str], size: int) -> Header:
    order = ""
    elements: list[Element] = []
    comments, info = [], {}
    for number, line in enumerate(lines[1:], 2):
        words = line.split()
        match words:
            case []:
                pass
            case ["comment", *_]:
                comments.append(line.strip()[8:])
            case ["obj_info", *rest]:
                info[rest[0] if rest else ""] = line.strip().split(None, 2)[2] if len(rest) > 1 else ""
            case ["format", kind, _] if kind in _BYTE_ORDER:
                order = kind
            case ["element", name, word] if (count := whole_number(word)) is not None:
                elements.append(Element(name, count, []))
            case ["property", "list", length, kind, name] if elements and kind in _TYPES and length in _TYPES:
                elements[-1].properties.append(Property(name, _TYPES[kind], _TYPES[length]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append(Property(name, _TYPES[kind], None))
            case _:
                raise FormatError(f"{path}: header line {number} is no PLY: {line[:60]!r}; mend or re-export the file")
    if not order:
        raise FormatError(f"{path}: the PLY header names no format; mend or re-export the file")
    if "vertex" not in [element.name for element in elements]:
        found = ", ".join(element.name for element in elements) or "nothing"
        raise FormatError(
            f"{path}: the PLY file has no vertices (its elements: {found}); export the points as vertices"
        )
    return Header(_BYTE_ORDER[order], order == "ascii", elements, comments, info, len(lines) + 1, size)
