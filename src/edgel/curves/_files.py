"""Curves to files: one table of formats."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from edgel.curves import _dxf, _geo, _plain, _svg
from edgel.curves._curves import Curves
from edgel.io.errors import FormatError, printable

WRITERS: dict[str, Callable[..., None]] = {
    ".dxf": _dxf.write,
    ".gpkg": _geo.write,
    ".geojson": _geo.write,
    ".shp": _geo.write,
    ".svg": _svg.write,
    ".obj": _plain.write_obj,
    ".ply": _plain.write_ply,
    ".csv": _plain.write_csv,
}
"""Extension to what writes it."""


def write(
    path: str | os.PathLike[str],
    curves: Curves,
    *,
    view: Literal["top", "front", "right"] = "top",
    unit: Literal["mm", "cm", "m", "in"] = "mm",
    scale: float = 1.0,
) -> None:
    """Write curves as a drawing, a layer of a map, line elements, or a table, as the extension says.

    ====================== ==============================================================================
    ``.dxf``               LINE, ARC, CIRCLE and POLYLINE (3D), corners as POINT; a layer for each kind of edge
    ``.gpkg .geojson .shp`` lines with Z, their measures as columns, and the CRS
    ``.svg``               a drawing to scale, seen along an axis
    ``.obj .ply``          vertices and line elements
    ``.csv``               the table of `measures`
    ====================== ==============================================================================

    Parameters
    ----------
    path : str or path
    curves : Curves
        If there are none the file is valid and empty.
    view : {"top", "front", "right"}
        Of an SVG: seen along -Z, +Y or -X.
    unit : {"mm", "cm", "m", "in"}
        Of an SVG: the unit of the cloud.
    scale : float
        Of an SVG: 0.01 draws at 1:100.

    Raises
    ------
    FormatError
        If the extension is unknown, or a map is asked for of a cloud whose CRS is in degrees.
    ImportError
        If what the format needs is not installed: ``pip install 'edgel[lines]'``.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in WRITERS:
        known = " ".join(WRITERS)
        raise FormatError(
            f"{printable(path)}: curves cannot be written as {suffix or 'a file without extension'!r}; "
            f"known are {known}"
        )
    drawing: dict[str, Any] = {"view": view, "unit": unit, "scale": scale} if suffix == ".svg" else {}
    WRITERS[suffix](path, curves, **drawing)
