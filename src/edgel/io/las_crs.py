"""The coordinate reference system in the records of a LAS header, without pyproj."""

from __future__ import annotations

import laspy
import numpy as np
from laspy.vlrs.known import GeoKeyDirectoryVlr, WktCoordinateSystemVlr
from laspy.vlrs.vlrlist import VLRList

from edgel.io.errors import FormatError

_USER = "LASF_Projection"
_RECORDS = (2111, 2112, 34735, 34736, 34737)
_PROJECTED, _GEOGRAPHIC, _MODEL = 3072, 2048, 1024
_USER_DEFINED = 32767


def crs_of(header: laspy.LasHeader) -> str | None:
    """Return the CRS as WKT, or as ``EPSG:n`` from GeoTIFF keys, None when the header has neither."""
    records = [*header.vlrs, *(header.evlrs or [])]
    for record in records:
        if record.user_id == _USER and record.record_id == 2112:
            text = (
                record.string
                if isinstance(record, WktCoordinateSystemVlr)
                else bytes(record.record_data).decode("utf-8", "replace")
            )
            if text.strip("\0 \n"):
                return text.rstrip("\0")
    for record in records:
        if isinstance(record, GeoKeyDirectoryVlr):
            keys = {key.id: key.value_offset for key in record.geo_keys}
            for key in (_PROJECTED, _GEOGRAPHIC):
                if keys.get(key, 0) not in (0, _USER_DEFINED):
                    return f"EPSG:{keys[key]}"
    return None


def set_crs(header: laspy.LasHeader, crs: str | None) -> None:
    """Replace the CRS of a header by WKT, by ``EPSG:n``, or by nothing.

    Raises
    ------
    FormatError
        If `crs` is neither WKT nor ``EPSG:n``.
    """
    kept = [vlr for vlr in header.vlrs if not (vlr.user_id == _USER and vlr.record_id in _RECORDS)]
    header.vlrs = VLRList(kept)
    if header.evlrs:
        header.evlrs = VLRList(
            [vlr for vlr in header.evlrs if not (vlr.user_id == _USER and vlr.record_id in _RECORDS)]
        )
    header.global_encoding.wkt = header.point_format.id >= 6
    if not crs:
        return
    if crs.upper().startswith("EPSG:") and crs[5:].isdecimal() and int(crs[5:]) < _USER_DEFINED:
        header.vlrs.append(_geo_keys(int(crs[5:])))
        header.global_encoding.wkt = False
    elif "[" in crs:
        header.vlrs.append(WktCoordinateSystemVlr(crs))
        header.global_encoding.wkt = True
    else:
        raise FormatError(f"crs: expected WKT or 'EPSG:n', got {crs[:60]!r}")


def _geo_keys(code: int) -> GeoKeyDirectoryVlr:
    # Geographic systems have the codes 4000..4999 (EPSG's own grouping); all else is taken as projected.
    geographic = 4000 <= code < 5000
    entries = [
        (1, 1, 0, 2),
        (_MODEL, 0, 1, 2 if geographic else 1),
        (_GEOGRAPHIC if geographic else _PROJECTED, 0, 1, code),
    ]
    record = GeoKeyDirectoryVlr()
    record.parse_record_data(np.array(entries, "<u2").tobytes())
    return record
