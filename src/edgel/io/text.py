"""Points as lines of text: XYZ, TXT, CSV, ASC, PTS, with whatever separator and header they have."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from edgel._objects import COLORS
from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.limits import whole_number
from edgel.io.names import find_axes, guess_names, in_degrees, is_byte, standard_names
from edgel.io.text_layout import Layout, as_columns, find_layout
from edgel.io.text_lines import bare, read_lines
from edgel.io.text_table import parse


def read(path: str | os.PathLike[str], *, columns: str | Sequence[str] | None = None) -> Cloud:
    r"""Read a text of points, one a line.

    What separates values (white space, comma, semicolon, tab, bar), decimal commas, quotes, comments (``#``, ``//``,
    ``%``), a first line with the number of points (PTS, of each of its blocks) and a header are found out. UTF-8,
    UTF-16 and Windows-1252 are read.

    Parameters
    ----------
    path : path
    columns : str or sequence of str, optional
        Names of the columns, such as ``"x,y,z,intensity"``, instead of those in the file; ``_`` leaves a column out,
        further ones are named as without a header.

    Returns
    -------
    Cloud
        Columns by the names of the header; x, y and z may be called ``Easting``, ``X [mm]``, ``Points:0`` and the like,
        colors and normals are ``red green blue`` and ``nx ny nz`` whatever they were called. A comment is the header
        if it names every column. Without a header the first three columns are x, y, z; unit vectors are ``nx ny nz``,
        integers 0..255 at the end (or after z) ``red green blue`` (uint8), a single column beside them is
        ``intensity``, any others are ``column_3`` onwards (``text_3`` where they hold words). Columns of integers are
        int64, others float64. What is missing (nothing between two separators or at the end of a line, ``NULL``,
        ``1.#QNAN``) is NaN;
        columns of words become texts. With several blocks ``scan_index`` tells the block.

    Raises
    ------
    FormatError
        If a line is not numbers, naming the line and what it holds, or the columns have no x, y and z.
    ValueError
        If x, y and z are not among `columns`.

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
    given = None if columns is None else as_columns(columns)
    lines = read_lines(path)
    layout = find_layout(name, lines, given)
    sizes = [] if layout.count is None else _count_blocks(name, lines, layout.first, layout.count)
    table = _table(name, lines, layout)
    axes = find_axes([*table])
    if axes is None:
        remedy = "call three of them x, y and z in the header, or name the columns (--columns x,y,z,...)"
        if in_degrees(table):
            remedy = "latitude and longitude are no lengths: project the points first, to UTM for instance"
        raise FormatError(f"{name}: the columns are {', '.join(table)}; {remedy}")
    xyz = np.column_stack([table.pop(axis) for axis in axes])
    spelled = standard_names([*table])
    attributes = _bytes_of_colors({spelled.get(column, column): values for column, values in table.items()})
    if len(sizes) > 1:
        attributes.setdefault("scan_index", np.repeat(np.arange(len(sizes), dtype=np.int32), sizes))
    return Cloud(xyz, attributes)


def _table(path: str, lines: list[str], layout: Layout) -> dict[str, np.ndarray]:
    """Return the columns by their names."""
    if not layout.sample:
        if layout.names is None:
            raise FormatError(f"{path}: no line of numbers in it; pass the file of the points")
        return {name: np.empty(0) for name in layout.names}
    columns = parse(path, lines, layout)
    if layout.names is not None:
        named = dict(enumerate(layout.names))
        return {named.get(i, f"column_{i}"): values for i, values in columns.items()}
    # Words, as the name of a point before its coordinates, are no part of what numbers tell by their order.
    numbers = [i for i, values in columns.items() if values.dtype.kind != "U"]
    if len(numbers) < 3:
        raise FormatError(f"{path}: {len(numbers)} columns of numbers; x, y and z are needed")
    names = dict(zip(numbers, guess_names([columns[i] for i in numbers]), strict=True))
    texts = {i: f"text_{i}" for i in columns if i not in names}
    return {(names | texts)[i]: values for i, values in columns.items()}


def _count_blocks(path: str, lines: list[str], first: int, count: int) -> list[int]:
    """Return the number of points of each block of PTS, and blank the lines that declare those after the first."""
    sizes, left = [count], count
    for number in range(first, len(lines)):
        text = bare(lines[number])
        if not text:
            continue
        if left == 0 and (declared := whole_number(text)) is not None:
            sizes.append(declared)
            left, lines[number] = declared, ""
        else:
            left -= 1
    if left:
        place = f"block {len(sizes)}" if len(sizes) > 1 else "its first line"
        raise FormatError(
            f"{path}: declared {sizes[-1]} points in {place}, found {sizes[-1] - left}; get the file again"
        )
    return sizes


def _bytes_of_colors(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Give colours of 0..255 the type that they have in the other formats."""
    if all(name in columns and is_byte(columns[name]) for name in COLORS):
        columns.update({name: columns[name].astype(np.uint8) for name in COLORS})
    return columns
