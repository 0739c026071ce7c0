"""GeoPackage, GeoJSON and Shapefile by pyogrio and shapely: lines with Z, in the CRS of the cloud."""

from __future__ import annotations

import os
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from edgel.curves._curves import Curves
from edgel.curves._measures import measures
from edgel.io.errors import FormatError, printable
from edgel.io.files import check_replaceable

_DRIVERS = {".gpkg": "GPKG", ".geojson": "GeoJSON", ".shp": "ESRI Shapefile"}
_SHORT = {
    "length_std": "len_std", "diameter_std": "diam_std", "radius_std": "rad_std", "position_std": "pos_std",
}  # fmt: skip
"""Names of at most ten characters, which is all that a Shapefile keeps."""
_GEOGRAPHIC = re.compile(r"\s*(GEOGCS|GEOGCRS|GEODCRS|GEOGRAPHICCRS|GEODETICCRS)\b", re.IGNORECASE)


def write(path: str | os.PathLike[str], curves: Curves) -> None:
    """Write one layer, ``curves``, with the columns of `measures`.

    Raises
    ------
    FormatError
        If the CRS is in degrees, in which nothing has a length.
    """
    pyogrio, shapely = _libraries()
    check_replaceable(path)
    _check_crs(path, curves.crs)
    suffix = Path(path).suffix.lower()
    table = measures(curves)
    table = {
        name: values.astype(np.int16) if values.dtype.kind in "bi" and name != "loop" else values
        for name, values in table.items()
    }
    if suffix == ".shp":
        table = {_SHORT.get(name, name): values for name, values in table.items()}
    shapes = [shapely.LineString(curves.points_of(curve)) for curve in range(len(curves))]
    Path(path).unlink(missing_ok=True)  # GDAL would add a layer to the old file
    more: dict[str, Any] = {} if suffix == ".geojson" else {"layer": "curves" if suffix == ".gpkg" else Path(path).stem}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "'crs' was not provided")  # the cloud has none to give
        pyogrio.raw.write(
            os.fspath(path),
            geometry=np.array([shapely.to_wkb(shape, output_dimension=3) for shape in shapes], object),
            field_data=[
                np.asarray(values, object) if values.dtype.kind == "U" else values for values in table.values()
            ],
            fields=list(table),
            geometry_type="LineString Z",
            crs=curves.crs,
            driver=_DRIVERS[suffix],
            **more,
        )


def _libraries() -> tuple[Any, Any]:
    try:
        import pyogrio
        import pyogrio.raw
        import shapely
    except ImportError:
        raise ImportError(
            "GeoPackage, GeoJSON and Shapefile need pyogrio and shapely: pip install 'edgel[lines]'"
        ) from None
    return pyogrio, shapely


def _check_crs(path: object, crs: str | None) -> None:
    if crs is None:
        return
    degrees = bool(_GEOGRAPHIC.match(crs)) or crs.upper().replace(" ", "") in ("EPSG:4326", "EPSG:4979", "EPSG:4258")
    if degrees:
        raise FormatError(
            f"{printable(path)}: the CRS of the cloud is in degrees, in which curves have no length; project the cloud "
            "first, for example with PDAL's filters.reprojection"
        )
