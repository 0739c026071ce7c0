"""Points as lines of text: XYZ, TXT, CSV, ASC, PTS, with whatever separator and header they have."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

import numpy as np

from edgel.cloud import Cloud
from edgel.io.columns import COLORS, find_xyz, spell_out_colors
from edgel.io.errors import FormatError
from edgel.io.files import describe, reading
from edgel.io.limits import LONGEST_LINE, whole_number
from edgel.io.rows import first_bad_line, number_of, parse_text

_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?|[-+]?\d+")
_INTEGER = re.compile(r"[-+]?\d+")
# Lines looked at to find out what the columns are.
_SAMPLE = 200
_MOST_COLUMNS = 4096


@dataclass(frozen=True)
class _Layout:
    first: int  # lines before the data
    delimiter: str | None  # None: white space
    decimal_comma: bool
    names: list[str] | None  # from the header
    count: int | None  # declared in a first line of its own, as PTS does


def read(path: str | os.PathLike[str]) -> Cloud:
    r"""Read a text of points, one a line.

    Separator (white space, comma, semicolon), decimal comma, comments (``#``, ``//``), a first line with the number
    of points (PTS) and a header are found out.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        Columns by the names of the header (``r g b`` become ``red green blue``). Without a header the first three
        columns are x, y, z; three last columns of integers 0..255 are ``red green blue`` (uint8), a single column
        between or after is ``intensity``, any others are ``column_3`` onwards. Columns of integers are int64, others
        float64.

    Raises
    ------
    FormatError
        If a line is not numbers, naming the line and what it holds, or the columns have no x, y and z.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "a.csv")
    ...     _ = file.write_text("x;y;z;label\n1,5;2,5;3,5;7\n")
    ...     cloud = read(file)
    >>> cloud.xyz, cloud.attributes["label"]
    (array([[1.5, 2.5, 3.5]]), array([7]))
    """
    name = os.fspath(path)
    with reading(path) as file:
        lines = _decode(name, file.read())
    layout = _find_layout(name, lines)
    data = _data_lines(lines, layout)
    if layout.count is not None and layout.count != len(data):
        raise FormatError(
            f"{name}: declared {layout.count} points in its first line, found {len(data)}; get the file again"
        )
    if not data:
        if layout.names is None:
            raise FormatError(f"{name}: no line of numbers in it; pass the file of the points")
        columns: dict[str, np.ndarray] = {column: np.empty(0) for column in layout.names}
    else:
        columns = _parse(name, lines, data, layout)
    axes = find_xyz(columns)
    if axes is None:
        raise FormatError(f"{name}: the columns are {', '.join(columns)}; call three of them x, y and z in the header")
    xyz = np.column_stack([columns.pop(axis) for axis in axes])
    return Cloud(xyz, _bytes_of_colors(spell_out_colors(columns)))


def _decode(path: str, raw: bytes) -> list[str]:
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = raw.decode("utf-16", "replace")
    elif b"\0" in raw[:4096] or describe(raw[:512])[1].startswith(
        ("name it .p", "name it .l", "name it .e", "name it .n", "unpack")
    ):
        what, remedy = describe(raw[:512])
        raise FormatError(f"{path}: not a text of points; the file seems to be {what}: {remedy}")
    else:
        text = raw.decode("utf-8-sig", "replace")
    lines = text.splitlines()
    longest = max(lines, key=len, default="")
    if len(longest) > LONGEST_LINE:
        raise FormatError(
            f"{path}: line {lines.index(longest) + 1} is {len(longest)} characters long; one point a line is needed"
        )
    return lines


def _strip(line: str) -> str:
    """Return a line without its comment."""
    return re.split(r"#|//", line, maxsplit=1)[0].strip()


def _split(text: str, delimiter: str | None) -> list[str]:
    return [token.strip().strip("\"'") for token in (text.split(delimiter) if delimiter else text.split())]


def _find_layout(path: str, lines: list[str]) -> _Layout:
    """Find the first line of numbers, its separator, and the header before it."""
    count, header, header_number = None, None, 0
    for number, line in enumerate(lines):
        text = _strip(line)
        if not text:
            # A comment may be the header: it counts if nothing but comments follows before the data.
            header = (
                (line.strip().lstrip("#/").strip(), True) if line.strip() and not (header and not header[1]) else header
            )
            continue
        delimiter, comma = _separator(text)
        tokens = _split(text, delimiter)
        if all(number_of(token.replace(",", ".") if comma else token) for token in tokens):
            declared = whole_number(tokens[0].removeprefix("+")) if len(tokens) == 1 else None
            if declared is not None and count is None and header_number == 0:
                count, header_number = declared, number + 1
                continue
            return _Layout(number, delimiter, comma, _header_names(path, header, len(tokens), number), count)
        if (header is not None and not header[1]) or not _is_header(tokens):
            if header is not None and not header[1] and find_xyz(_split(header[0], _separator(header[0])[0])) is None:
                number, line = header_number - 1, header[0]  # words, not a header
            expected = "numbers or a header with x, y and z"
            raise FormatError(
                f"{path}: line {number + 1}: expected {expected}, found {line.strip()[:60]!r}; mend the file"
            )
        header, header_number = (text, False), number + 1
    names = None
    if header is not None:
        names = _split(header[0], _separator(header[0])[0])
        names = names if find_xyz(names) else None
    return _Layout(len(lines), None, False, names, count)


def _separator(text: str) -> tuple[str | None, bool]:
    """Return the delimiter of a line (None: white space) and whether its commas are decimal."""
    if ";" in text:
        return ";", "," in text and "." not in text
    words = text.split()
    if "," not in text:
        return None, False
    decimal = len(words) >= 3 and all(_DECIMAL_COMMA.fullmatch(word) for word in words)
    return (None, True) if decimal else (",", False)


def _is_header(tokens: list[str]) -> bool:
    return find_xyz(tokens) is not None or (
        len(tokens) >= 3 and all(re.fullmatch(r"[^\W\d][\w .:()\[\]-]*", t) for t in tokens)
    )


def _header_names(path: str, header: tuple[str, bool] | None, width: int, number: int) -> list[str] | None:
    if header is None:
        return None
    text, is_comment = header
    names = _split(text, _separator(text)[0])
    if len(names) == width and len(set(names)) == width and (not is_comment or find_xyz(names)):
        return names
    if is_comment:
        return None  # a remark, not a header
    raise FormatError(
        f"{path}: the header {text[:60]!r} names {len(set(names))} columns, line {number + 1} has {width}; mend it"
    )


def _data_lines(lines: list[str], layout: _Layout) -> list[str]:
    """Return the lines of numbers, bare of comments; the usual file without comments is passed on as it is."""
    data = lines[layout.first :]
    if any("#" in line or "//" in line for line in data):
        data = [_strip(line) for line in data]
    data = [line for line in data if line and not line.isspace()]
    return [line.replace(",", ".") for line in data] if layout.decimal_comma else data


def _parse(path: str, lines: list[str], data: list[str], layout: _Layout) -> dict[str, np.ndarray]:
    sample = [_split(line, layout.delimiter) for line in data[:_SAMPLE]]
    width = len(sample[0])
    if width > _MOST_COLUMNS:
        raise FormatError(
            f"{path}: line {layout.first + 1} has {width} numbers; one point a line is needed, of {_MOST_COLUMNS} "
            "numbers at most"
        )
    if width < 3:
        raise FormatError(f"{path}: line {layout.first + 1} has {width} numbers; x, y and z are needed")
    whole = [all(len(row) == width and _INTEGER.fullmatch(row[i]) for row in sample) for i in range(width)]
    axes = find_xyz(layout.names) if layout.names else None
    coordinates = {layout.names.index(axis) for axis in axes} if layout.names and axes else {0, 1, 2}
    error: Exception = ValueError()
    # The sample may happen to be whole, or hold numbers beyond int64: then the next type in line.
    for integer in ("i8", "u8", "f8") if any(whole) else ("f8",):
        codes = [integer if whole[i] and i not in coordinates else "f8" for i in range(width)]
        try:
            table = parse_text(
                data, np.dtype([(f"f{i}", code) for i, code in enumerate(codes)]), delimiter=layout.delimiter
            )
        except ValueError as problem:
            error = problem
            continue
        columns = [np.ascontiguousarray(table[f"f{i}"]) for i in range(width)]
        return dict(zip(layout.names or _guess_names(columns), columns, strict=True))
    stripped = [
        _strip(line).replace(",", ".") if layout.decimal_comma else _strip(line) for line in lines[layout.first :]
    ]
    number, text = first_bad_line(stripped, width, delimiter=layout.delimiter, comment="")
    where = f"line {layout.first + number}: expected {width} numbers, found {text!r}" if number else str(error)
    raise FormatError(f"{path}: {where}; mend the file")


def _guess_names(columns: list[np.ndarray]) -> list[str]:
    """Name the columns of a text without header."""
    rest = list(range(3, len(columns)))
    names = {0: "x", 1: "y", 2: "z"} | {i: f"column_{i}" for i in rest}
    last = rest[-3:]
    if len(last) == 3 and all(_is_byte(columns[i]) for i in last):
        names.update(zip(last, COLORS, strict=True))
        rest = rest[:-3]
    if len(rest) == 1:
        names[rest[0]] = "intensity"
    return [names[i] for i in range(len(columns))]


def _is_byte(values: np.ndarray) -> bool:
    return values.dtype.kind in "iu" and int(values.min()) >= 0 and int(values.max()) <= 255


def _bytes_of_colors(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Give colours of 0..255 the type that they have in the other formats."""
    if all(name in columns and len(columns[name]) and _is_byte(columns[name]) for name in COLORS):
        columns.update({name: columns[name].astype(np.uint8) for name in COLORS})
    return columns
