"""The layout of a text of points: where its numbers begin, what separates them, and what the header calls them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from edgel.io.errors import FormatError
from edgel.io.limits import whole_number
from edgel.io.names import find_axes
from edgel.io.rows import number_of
from edgel.io.text_lines import bare, is_number, separator, split

# Lines looked at to find out what the columns are.
_SAMPLE = 200
_MOST_COLUMNS = 4096
_NUMBER = re.compile(r"\d|nan|inf", re.IGNORECASE)
_HEADER_WORD = re.compile(r"[^\W\d][\w .:()\[\]/-]*")
_INTRODUCTION = re.compile(r"\A[\w ]+[:=]\s+")
_UNIT = re.compile(r"\s*([\[(])\s*([^\])]*?)\s*([\])])")
_LONGEST_UNITS = 4096  # characters of a header: its brackets are looked for in quadratic time
_SPREADSHEET = re.compile(r"\"?sep=.\"?", re.IGNORECASE)
_LEFT_OUT = "_"


@dataclass(frozen=True)
class Layout:
    """Where and how the numbers of a text stand.

    Attributes
    ----------
    first : int
        Lines before the first of the points.
    count : int or None
        Number of points (of the first block), declared in a line of its own.
    delimiter : str or None
        What separates values, None for white space.
    sample : list of list of str
        Values of the first lines.
    names : list of str or None
        Of the columns, by the header or the user.
    texts, unread : set of int
        Columns that hold words, and those that are not read.
    """

    first: int
    count: int | None = None
    delimiter: str | None = None
    sample: list[list[str]] = field(default_factory=list)
    names: list[str] | None = None
    texts: frozenset[int] = frozenset()
    unread: frozenset[int] = frozenset()

    @cached_property
    def width(self) -> int:
        """Number of columns: between marks of the longest of the first lines, between blanks of the first."""
        return max(map(len, self.sample if self.delimiter else self.sample[:1]), default=0)

    @cached_property
    def axes(self) -> list[int]:
        """Columns of x, y and z; the first three where there is no header. Empty where they are not known."""
        if self.names is not None:
            return [self.names.index(name) for name in find_axes(self.names) or ()]
        empty = {i for i in range(self.width) if all(row[i : i + 1] in ([], [""]) for row in self.sample)}
        return [i for i in range(self.width) if i not in self.unread | self.texts | empty][:3]

    @property
    def is_plain(self) -> bool:
        """Whether every value is a number as NumPy reads it, if commas instead of points are."""
        return (
            all(len(row) == self.width and all(number_of(t.replace(",", ".")) for t in row) for row in self.sample)
            and not self.unread
        )


def find_layout(path: str, lines: list[str], columns: Sequence[str] | None = None) -> Layout:
    """Find the first line of numbers, its separator, and the header before it.

    Parameters
    ----------
    columns : sequence of str or None
        What the user calls the columns, whatever a header says; those called "_" are not read.

    Raises
    ------
    FormatError
        If there are words where numbers are expected, or the header does not fit the numbers.
    """
    first, count, words, remarks = _find_first(lines)
    if first == len(lines):
        names = _split_header(words[-1][1] if words else remarks[-1] if remarks else "", None)
        if find_axes(names) is not None:
            return Layout(first, count, names=names)
        if words:
            raise _no_header(path, *words[0])
        return Layout(first, count)
    delimiter = separator(bare(lines[first]))
    sample = [split(text, delimiter) for line in lines[first : first + _SAMPLE] if (text := bare(line))][:count]
    width = Layout(first, count, delimiter, sample).width
    if not 3 <= width <= _MOST_COLUMNS:
        remedy = "x, y and z are needed" if width < 3 else f"a point has {_MOST_COLUMNS} at most, in a line of its own"
        raise FormatError(f"{path}: line {first + 1} has {width} numbers; {remedy}")
    if columns is not None:
        names, unread = _given(path, columns, width, first)
        return Layout(first, count, delimiter, sample, names, _texts(sample, width), unread)
    if not words and _is_numbering(sample):  # the header of a table without names
        unread = frozenset([0] if sample[0][0] == "" else [])
        return Layout(first + 1, count, delimiter, sample[1:], unread=unread)
    names = None
    if words:
        quoted = bare(lines[first])[0] in "\"'"
        names = _header(path, words, Layout(first, count, delimiter, sample), quoted)
    if names is None:
        names = _header_among(path, remarks, width, delimiter)
    return Layout(first, count, delimiter, sample, names, _texts(sample, width))


def as_columns(columns: str | Sequence[str]) -> list[str]:
    """Check the names that a user gives to columns, a text of them with commas between or several.

    Raises
    ------
    TypeError, ValueError
        If they are no names, one is there twice, or x, y and z are not among them.

    Examples
    --------
    >>> as_columns("x,y,z,_,intensity")
    ['x', 'y', 'z', '_', 'intensity']
    """
    words = columns.split(",") if isinstance(columns, str) else columns
    if not isinstance(words, list | tuple) or not all(isinstance(word, str) for word in words):
        raise TypeError(f"columns: expected names, such as 'x,y,z,intensity', got {columns!r:.80}")
    names = [word.strip() or _LEFT_OUT for word in words]
    named = [name for name in names if name != _LEFT_OUT]
    if find_axes(named) is None or len(set(named)) < len(named):
        raise ValueError(
            f"columns: {','.join(names):.80}: x, y and z have to be among the names, each once ({_LEFT_OUT} leaves a "
            "column out)"
        )
    return names


def _find_first(lines: list[str]) -> tuple[int, int | None, list[tuple[int, str]], list[str]]:
    """Return the place of the first line of numbers, the declared count, and lines of words and comments before it."""
    count, words, remarks = None, [], []
    for number, line in enumerate(lines):
        text = bare(line)
        if not text:
            if line.strip():
                remarks.append(line.strip().lstrip("#/%!").strip())
            continue
        tokens = split(text, separator(text))
        if len(tokens) == 1 and count is None and not words:
            count = whole_number(tokens[0].removeprefix("+"))
            if count is not None:
                continue
        numbers = sum(bool(_NUMBER.search(token)) and is_number(token) for token in tokens)
        # What begins with a bracket is JSON, or printed arrays, whose words would pass for columns.
        if text[0] not in "{[(<" and (numbers >= 3 or (numbers and all(map(is_number, tokens)))):
            return number, count, words, remarks
        if not _SPREADSHEET.fullmatch(text):
            words.append((number, text))
    return len(lines), count, words, remarks


def _given(path: str, columns: Sequence[str], width: int, first: int) -> tuple[list[str], frozenset[int]]:
    """Return the names that a user gave, those of further columns, and which are not read."""
    if len(columns) > width:
        raise FormatError(
            f"{path}: line {first + 1} has {width} values, --columns (columns=) names {len(columns)}: "
            f"{','.join(columns):.80}"
        )
    names = [f"{_LEFT_OUT}{i}" if name == _LEFT_OUT else name for i, name in enumerate(columns)]
    names += [f"column_{i}" for i in range(len(names), width)]
    return _unique(names), frozenset(i for i, name in enumerate(columns) if name == _LEFT_OUT)


def _header(path: str, words: list[tuple[int, str]], layout: Layout, quoted: bool) -> list[str]:
    """Return the names in the last line of words before the numbers that holds those of coordinates, or in the last."""
    known_lines = (line for _, line in reversed(words) if find_axes(_split_header(line, layout.delimiter)))
    text = next(known_lines, words[-1][1])  # units may stand below it
    names, width = _split_header(text, layout.delimiter), layout.width
    known = find_axes(names) is not None
    if not known and (len(words) > 1 or len(names) < 3 or not all(map(_HEADER_WORD.fullmatch, names))):
        raise _no_header(path, *words[0])
    if len(names) == width - 1 and quoted:
        names = ["", *names]  # R: its row names have no header
    if layout.delimiter is None and len(names) != width:
        raise FormatError(
            f"{path}: the header {text[:60]!r} names {len(names)} columns, line {layout.first + 1} has {width}; mend "
            "it, or name the columns (--columns x,y,z,...)"
        )
    return _unique([*names, *[""] * (width - len(names))])


def _header_among(path: str, remarks: list[str], width: int, delimiter: str | None) -> list[str] | None:
    """Return the names in the last comment that calls all columns by names, x, y and z among them."""
    for remark in reversed(remarks):
        # "X Y Z" or "Columns: X Y Z"; then "fields X Y Z"
        for text in (_INTRODUCTION.sub("", remark), remark.partition(" ")[2]):
            names = _split_header(text, delimiter)
            if any(map(number_of, names)) or find_axes(names) is None:
                continue
            if len(names) == width:
                return _unique(names)
            if 3 < len(names) < width and find_axes(names) != names[:3]:
                raise FormatError(
                    f"{path}: the comment {remark[:60]!r} names {len(names)} columns, the points have {width}; mend "
                    "it, or name the columns (--columns x,y,z,...)"
                )
    return None


def _split_header(text: str, delimiter: str | None) -> list[str]:
    """Return the names in a header, which may have a separator of its own."""
    if delimiter is None or delimiter not in text:
        delimiter = separator(text)
    if delimiter is None and '"' not in text and len(text) < _LONGEST_UNITS:
        text = _UNIT.sub(r"\1\2\3", text)  # "X [mm]" is one name
    return split(text, delimiter)


def _unique(names: list[str]) -> list[str]:
    """Give names to columns that have none, and to those of a name that is there already others."""
    taken, unique = {*names}, []
    for i, name in enumerate(names):
        number = 2
        new = name = name or f"column_{i}"
        while new in unique or (new != name and new in taken):
            new, number = f"{name}_{number}", number + 1
        unique.append(new)
    return unique


def _texts(sample: list[list[str]], width: int) -> frozenset[int]:
    """Return the columns of which over half the values are no numbers."""
    columns = ([row[i] for row in sample if i < len(row) and row[i]] for i in range(width))
    return frozenset(i for i, values in enumerate(columns) if 2 * sum(map(is_number, values)) < len(values))


def _is_numbering(sample: list[list[str]]) -> bool:
    """Whether the first line numbers the columns, as pandas does where they have no names: 0,1,2 above 1.5,2.5,3.5."""
    numbers = sample[0][1:] if sample[0][0] == "" else sample[0]
    others = [value for row in sample[1:] for value in row]
    return numbers == [str(i) for i in range(len(numbers))] and sum("." in value for value in others) > len(others) / 2


def _no_header(path: str, number: int, text: str) -> FormatError:
    return FormatError(
        f"{path}: line {number + 1}: expected numbers or a header with x, y and z, found {text.strip()[:60]!r}; mend "
        "the file, or name its columns (--columns x,y,z,...)"
    )
