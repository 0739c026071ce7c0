"""Wavefront OBJ: vertices without faces are a cloud; with faces they are a mesh, to be sampled."""

from __future__ import annotations

import os

import numpy as np

from edgel._objects import COLORS, NORMALS
from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.files import describe
from edgel.io.mesh import OFFER
from edgel.io.rows import first_bad_line, parse_text
from edgel.io.text_lines import read_lines

_NAMES = {3: [], 4: ["w"], 6: COLORS, 7: [*COLORS, "alpha"]}


def read(path: str | os.PathLike[str]) -> Cloud:
    r"""Read the vertices of an OBJ file without faces.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        Colors behind the coordinates are ``red green blue``, uint8 where they are steps of 1/255; as many normals as
        vertices are ``nx ny nz``. What else there is (texture, lines, curves) is named in ``metadata["left_out"]``.

    Raises
    ------
    FormatError
        If there are faces, no vertices, or a line that is damaged.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "a.obj")
    ...     _ = file.write_text("v 1 2 3 1 0 0\nv 4 5 6 0 0 1\n")
    ...     cloud = read(file)
    >>> cloud.xyz[1], cloud.attributes["red"]
    (array([4., 5., 6.]), array([255,   0], dtype=uint8))
    """
    name = os.fspath(path)
    lines = read_lines(path)
    rows: dict[str, list[str]] = {}
    for line in lines:
        key, _, rest = line.strip().partition(" ")
        if key and key[0] != "#":
            rows.setdefault(key, []).append(rest)
    if num_faces := len(rows.get("f", ())):
        raise FormatError(f"{name}: a mesh of {num_faces:,} faces, no point cloud; {OFFER}")
    if "v" not in rows:
        what, remedy = describe("\n".join(lines[:9]).encode("utf-8", "replace")[:512])
        raise FormatError(f"{name}: no vertices in it; the file seems to be {what}: {remedy}")
    vertices = _table(name, "v", rows.pop("v"))
    if vertices.shape[1] not in _NAMES:
        raise FormatError(
            f"{name}: vertices of {vertices.shape[1]} numbers; x y z, perhaps with red green blue, are known"
        )
    attributes = dict(zip(_NAMES[vertices.shape[1]], _as_bytes(vertices[:, 3:]).T, strict=True))
    if len(rows.get("vn", ())) == len(vertices):
        attributes |= dict(zip(NORMALS, _table(name, "vn", rows.pop("vn"))[:, :3].T, strict=True))
    if "w" in attributes and (attributes["w"] == 1).all():
        del attributes["w"]  # the weight of a point that is no curve's
    attributes = {key: np.ascontiguousarray(values) for key, values in attributes.items()}
    words = {"vn": "normals", "vt": "texture coordinates", "l": "lines", "curv": "curves", "surf": "surfaces"}
    left_out = tuple(f"{len(rows[key]):,} {what}" for key, what in words.items() if key in rows)
    return Cloud(vertices[:, :3], attributes, metadata={"left_out": left_out} if left_out else {})


def _table(path: str, key: str, rows: list[str]) -> np.ndarray:
    """Return the numbers of the lines of one kind, (N, C) float64."""
    width = len(rows[0].split("#")[0].split())
    if width < 3:
        raise FormatError(f"{path}: expected {key} x y z, found {rows[0][:60]!r}; mend the file")
    try:
        table = parse_text(rows, np.dtype([(f"f{i}", "f8") for i in range(width)]), comments="#")
    except ValueError:
        number, text = first_bad_line(rows, width)
        raise FormatError(
            f"{path}: line {number} of those with {key}: expected {width} numbers, found {text!r}; mend the file"
        ) from None
    if len(table) < len(rows):
        raise FormatError(
            f"{path}: of {len(rows)} lines with {key} {len(rows) - len(table)} hold nothing; mend the file"
        )
    return np.column_stack([table[f"f{i}"] for i in range(width)])


def _as_bytes(colors: np.ndarray) -> np.ndarray:
    """Return colors of 0..1 in steps of 1/255 as uint8, whole ones of 0..255 too, others as they are."""
    for steps in (colors * 255, colors):
        if colors.shape[1] >= 3 and ((steps >= 0) & (steps <= 255) & (np.abs(steps - np.rint(steps)) < 0.01)).all():
            return np.rint(steps).astype(np.uint8)
    return colors
