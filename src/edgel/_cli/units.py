"""The unit of a cloud's coordinates, where its file tells it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from edgel.cloud import Cloud

_TOKEN = re.compile(r'([A-Za-z_0-9]+)\s*[\[(]\s*(?:"((?:[^"]|"")*)")?|"(?:[^"]|"")*"|[\])]')
_UNITS = {"UNIT", "LENGTHUNIT", "ANGLEUNIT"}
_GEOGRAPHIC = {"GEOGCS", "GEOGCRS", "GEODCRS", "GEOGRAPHICCRS", "GEODETICCRS"}
_VERTICAL = {"VERT_CS", "VERTCRS", "VERTICALCRS"}
_OF_PARTS = {
    "BASEGEOGCRS",
    "BASEGEODCRS",
    "PRIMEM",
    "PRIMEMERIDIAN",
    "CONVERSION",
    "PARAMETER",
    "ELLIPSOID",
    "SPHEROID",
}
_GEOTIFF = {9001: "metre", 9002: "foot", 9003: "US survey foot"}  # EPSG's codes, as GeoTIFF has them
_LINEAR, _HEIGHT = 3076, 4099  # the keys of GeoTIFF that name the unit of x and y, and of z


def unit_of(cloud: Cloud, source: str) -> str | None:
    """Return the unit of the coordinates as the file says, that of the heights too where it is another; None if not.

    WKT and the keys of GeoTIFF tell it; E57 is in metres by its standard.
    """
    if Path(source).suffix.lower() == ".e57":
        return "metre"
    plane, height = _of_wkt(cloud.crs or "")
    if plane is None:
        plane, height = _of_keys(cloud.metadata.get("las_header"))
    if plane is None or height in (None, plane):
        return plane
    return f"{plane}, heights {height}"


def _of_wkt(crs: str) -> tuple[str | None, str | None]:
    """Return the units of x and y, and of z.

    Examples
    --------
    >>> plane = 'PROJCS["a",GEOGCS["b",UNIT["degree",0.017]],UNIT["metre",1]]'
    >>> _of_wkt(f'COMPD_CS["c",{plane},VERT_CS["d",UNIT["foot",0.3]]]')
    ('metre', 'foot')
    """
    found: dict[str, str] = {}
    inside: list[str] = []
    for token in _TOKEN.finditer(crs):
        if token[1] is None:
            if token[0] in "])" and inside:
                inside.pop()
            continue
        around = set(inside)
        inside.append(token[1].upper())
        if inside[-1] not in _UNITS or not token[2] or around & _OF_PARTS:
            continue
        if around & _VERTICAL:
            found.setdefault("height", token[2])
        elif around & _GEOGRAPHIC:
            found.setdefault("angle", token[2])
        else:
            found.setdefault("plane", token[2])
    return found.get("plane", found.get("angle")), found.get("height")


def _of_keys(header: Any) -> tuple[str | None, str | None]:
    """Return the same of the GeoTIFF keys of a LAS header."""
    keys: dict[int, int] = {}
    for record in getattr(header, "vlrs", ()):
        keys |= {key.id: key.value_offset for key in getattr(record, "geo_keys", ())}
    return _GEOTIFF.get(keys.get(_LINEAR, 0)), _GEOTIFF.get(keys.get(_HEIGHT, 0))
