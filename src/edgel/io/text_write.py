"""Points written as lines of text: XYZ, TXT, CSV, ASC, PTS."""

from __future__ import annotations

import os
import re

import numpy as np

from edgel.cloud import Cloud
from edgel.io.columns import COLORS, flat_attributes
from edgel.io.errors import FormatError
from edgel.io.files import replacing


def write(path: str | os.PathLike[str], cloud: Cloud) -> None:
    r"""Write a text of points: a header line, then one point a line, in the shortest digits that read back exactly.

    ``.csv`` is separated by commas, everything else by blanks. ``.pts`` begins with the number of points, and has its
    column names in a comment when they are not the usual ``x y z [intensity] [red green blue]``. (N, C) attributes
    become ``name_0 .. name_{C-1}``; types, organized shape, viewpoint and CRS are not kept, text has no place for them.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Raises
    ------
    FormatError
        If an attribute is not numeric.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, pathlib, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "a.xyz")
    ...     write(file, Cloud([[0.1, 2, 3]], {"label": np.array([7])}))
    ...     file.read_text()
    'x y z label\n0.1 2.0 3.0 7\n'
    """
    suffix = os.path.splitext(path)[1].lower()
    separator = "," if suffix == ".csv" else " "
    columns = dict(zip("xyz", cloud.xyz.T, strict=True))
    for name, values in flat_attributes(cloud, path).items():
        word = re.sub(r"[,;#/\"']", "_", name)
        if word in columns:
            raise FormatError(f"{os.fspath(path)}: two columns would be called {word!r}; rename attribute {name!r}")
        columns[word] = values
    header = separator.join(columns) + "\n"
    if suffix == ".pts":
        usual = list(columns)[3:] in ([], ["intensity"], COLORS, ["intensity", *COLORS])
        header = f"{len(cloud)}\n" + ("" if usual else f"# {header}")
    with replacing(path) as file:
        file.write(header.encode())
        for start in range(0, len(cloud), 65536):
            words = [_words(values[start : start + 65536]) for values in columns.values()]
            file.write("\n".join([*map(separator.join, zip(*words, strict=True)), ""]).encode())


def _words(values: np.ndarray) -> list[str]:
    if values.dtype.kind == "b":
        values = values.astype(np.uint8)
    # Python's own numbers: their repr is the shortest text that gives the same double again.
    return list(map(repr, values.astype(np.float64).tolist() if values.dtype.kind == "f" else values.tolist()))
