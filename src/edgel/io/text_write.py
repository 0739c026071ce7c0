"""Points written as lines of text: XYZ, TXT, CSV, ASC, PTS."""

from __future__ import annotations

import os
import re

import numpy as np

from edgel._objects import COLORS, NORMALS
from edgel.cloud import Cloud
from edgel.io.columns import flat_attributes, narrowed, plain_name
from edgel.io.errors import tell
from edgel.io.files import replacing
from edgel.io.names import standard_names

# Columns that come first, as far as they are there.
_FIRST = (COLORS, NORMALS)


def write(path: str | os.PathLike[str], cloud: Cloud) -> None:
    r"""Write a text of points: a header line, then one point a line, in the shortest digits that read back exactly.

    ``.csv`` is separated by commas, everything else by blanks. Colors and normals come first after x, y, z, where
    programs that know no header look for them; without attributes only ``.csv`` has a header. ``.pts`` begins with the
    number of points and holds ``x y z [intensity] [red green blue]``, which is all that its readers know. Coordinates
    that lie on the grid of the LAS file they come from are rounded to its decimals. (N, C) attributes become ``name_0
    .. name_{C-1}``; types, organized shape, viewpoint and CRS are not kept, text has no place for them.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Warns
    -----
    FormatWarning
        If an attribute is left out or renamed.

    Raises
    ------
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
    said: dict[str, str] = {}
    spelled = standard_names([plain_name(name) for name in cloud.attributes])  # as every reader of texts takes them
    columns = flat_attributes(cloud, said, spell=lambda name: spelled.get(name, re.sub(r"[,;#/\"']", "_", name)))
    columns = {name: columns[name] for group in _FIRST if {*group} <= {*columns} for name in group} | columns
    if suffix == ".pts":
        columns = _known_to_pts(columns, said)
    columns = dict(zip("xyz", cloud.xyz.T, strict=True)) | columns
    header = separator.join(columns) + "\n"
    if suffix == ".pts":
        header = f"{len(cloud)}\n" if len(cloud) else f"0\n# {header}"
    elif suffix != ".csv" and len(columns) == 3 and len(cloud):
        header = ""
    tell(os.fspath(path), said)
    decimals = _decimals(cloud)
    with replacing(path) as file:
        file.write(header.encode())
        for start in range(0, len(cloud), 65536):
            words = [_words(values[start : start + 65536], decimals.get(name)) for name, values in columns.items()]
            file.write("\n".join([*map(separator.join, zip(*words, strict=True)), ""]).encode())


def _known_to_pts(columns: dict[str, np.ndarray], said: dict[str, str]) -> dict[str, np.ndarray]:
    """Return the columns that PTS has, in its order."""
    colors = COLORS if all(name in columns and narrowed(columns[name], ["u1"]) is not None for name in COLORS) else []
    known = [name for name in ("intensity", *colors) if name in columns]
    said |= {name: "left out, PTS has no place for it; .xyz or .csv holds it" for name in columns if name not in known}
    return {name: columns[name] for name in known}


def _decimals(cloud: Cloud) -> dict[str, int]:
    """Return how many decimals the axes have whose coordinates lie on the grid of a LAS header."""
    header = cloud.metadata.get("las_header")
    if header is None or not len(cloud):
        return {}
    from edgel.io.las_grid import decimals_of, on_grid  # not at the top: laspy takes time to import

    found = {}
    for i, axis in enumerate("xyz"):
        scale, offset = float(header.scales[i]), float(header.offsets[i])
        if on_grid(cloud.xyz[:, i], scale, offset) and (number := decimals_of(scale, offset)) is not None:
            found[axis] = number
    return found


def _words(values: np.ndarray, decimals: int | None) -> list[str]:
    if decimals is not None:
        return [f"{value:.{decimals}f}" for value in values.tolist()]
    if values.dtype.kind == "b":
        values = values.astype(np.uint8)
    # Python's own numbers: their repr is the shortest text that gives the same double again.
    return list(map(repr, values.astype(np.float64).tolist() if values.dtype.kind == "f" else values.tolist()))
