"""DXF by ezdxf: lines, arcs and circles are themselves, all else is a 3D polyline."""

from __future__ import annotations

import io
import os
from typing import Any

import numpy as np

from edgel.curves._curves import CurveKind, Curves
from edgel.edges import EdgeKind
from edgel.io.files import replacing

_COLORS = {EdgeKind.CREASE: 1, EdgeKind.BOUNDARY: 5, EdgeKind.OCCLUDING: 3, EdgeKind.COLOR: 6, EdgeKind.IMAGE: 8}
"""AutoCAD's color numbers."""
_CORNERS = "CORNERS"


def write(path: str | os.PathLike[str], curves: Curves) -> None:
    """Write a drawing in the cloud's coordinates, one layer a kind of edge and one of corners."""
    document = _new_document()
    document.header["$INSUNITS"] = 0  # the cloud's, which it does not name
    for kind, color in _COLORS.items():
        document.layers.add(str(kind.name), color=color)
    document.layers.add(_CORNERS, color=7)
    space = document.modelspace()
    for curve in range(len(curves)):
        _add(space, curves, curve, {"layer": str(EdgeKind(int(curves.edge[curve])).name)})
    for corner in curves.corners:
        space.add_point(corner.tolist(), dxfattribs={"layer": _CORNERS})
    text = io.StringIO()
    document.write(text)
    with replacing(path) as file:
        file.write(text.getvalue().encode(document.output_encoding))


def _new_document() -> Any:
    try:
        import ezdxf
    except ImportError:
        raise ImportError("DXF needs ezdxf: pip install 'edgel[lines]', or pip install ezdxf") from None
    return ezdxf.new("R2010")  # pyright: ignore[reportPrivateImportUsage]


def _add(space: Any, curves: Curves, curve: int, attributes: dict[str, Any]) -> None:
    from ezdxf.math import OCS

    path, kind = curves.points_of(curve), curves.kind[curve]
    if kind == CurveKind.LINE:
        space.add_line(path[0].tolist(), path[-1].tolist(), dxfattribs=attributes)
        return
    if kind == CurveKind.POLYLINE:
        closed = bool(curves.closed[curve])
        space.add_polyline3d((path[:-1] if closed else path).tolist(), close=closed, dxfattribs=attributes)
        return
    axis, centre, radius = curves.direction[curve], curves.centre[curve], float(curves.radius[curve])
    system = OCS(axis.tolist())
    place = system.from_wcs(centre.tolist())
    attributes = attributes | {"extrusion": tuple(axis)}
    if kind == CurveKind.CIRCLE:
        space.add_circle(place, radius, dxfattribs=attributes)
        return
    ends = [np.asarray(system.from_wcs((end - centre).tolist())) for end in (path[0], path[-1])]
    begin, stop = (float(np.degrees(np.arctan2(end[1], end[0]))) for end in ends)
    space.add_arc(place, radius, begin, stop, dxfattribs=attributes)
