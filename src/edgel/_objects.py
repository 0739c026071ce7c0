"""What other libraries hold a cloud in: its coordinates and attributes, told by what the object has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

COLORS = ["red", "green", "blue"]
NORMALS = ["nx", "ny", "nz"]


def find_xyz(names: Iterable[str]) -> list[str] | None:
    """Return the names of the x, y and z columns (upper or lower case), None when one is missing."""
    lower: dict[str, str] = {}
    for name in names:
        lower.setdefault(name.lower(), name)
    return [lower[axis] for axis in "xyz"] if all(axis in lower for axis in "xyz") else None


def take_apart(points: Any) -> tuple[Any, dict[str, Any]]:
    """Return the coordinates that an object carries, and what it says of each point.

    Parameters
    ----------
    points : any
        Records (a structured array, also of ROS's ``read_points``; the vertices of plyfile's ``PlyData`` or
        ``PlyElement``; a table of pandas) with x, y and z; ``LasData`` of laspy; a point cloud of Open3D, legacy or
        tensor; any object with ``.xyz`` or ``.points``, such as PyVista's. Anything else is taken for coordinates.

    Raises
    ------
    TypeError
        If records have no x, y and z.
    """
    if isinstance(points, np.ndarray):
        return _of_records(points) if points.dtype.names else (points, {})
    if hasattr(points, "point") and hasattr(points.point, "positions"):  # Open3D's tensors
        tensors = {name: values.cpu().numpy() for name, values in points.point.items()}
        return tensors.pop("positions"), _spelled(tensors)
    if hasattr(points, "point_format") and hasattr(points, "xyz"):  # laspy
        names = [name for name in points.point_format.dimension_names if name not in ("X", "Y", "Z")]
        return points.xyz, {name: np.array(points[name]) for name in names}
    if hasattr(points, "to_records"):  # pandas; without names it is an array
        records = points.to_records(index=False)
        return _of_records(records) if find_xyz(records.dtype.names or ()) else (points, {})
    if hasattr(points, "elements") and hasattr(points, "header"):  # plyfile, all elements
        points = next((element for element in points.elements if element.name == "vertex"), points)
    if hasattr(points, "ply_property"):  # plyfile, one element
        return _of_records(points.data)
    if hasattr(points, "has_colors") and hasattr(points, "points"):  # Open3D
        parts = {"colors": points.colors} if points.has_colors() else {}
        parts |= {"normals": points.normals} if points.has_normals() else {}
        return np.asarray(points.points), _spelled({name: np.asarray(values) for name, values in parts.items()})
    for attribute in ("xyz", "points"):
        if hasattr(points, attribute):
            return getattr(points, attribute), {}
    return points, {}


def _of_records(records: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Take apart records (N,) or (H, W) with fields x, y and z."""
    names = records.dtype.names or ()
    axes = find_xyz(names)
    if axes is None or records.ndim not in (1, 2) or any(records.dtype[axis].kind not in "iuf" for axis in axes):
        raise TypeError(
            f"points: records of {', '.join(names):.200}, shape {records.shape}; x, y and z are needed, each a number"
        )
    xyz = np.ma.stack([records[axis].astype(np.float64) for axis in axes], axis=-1)
    # Lists of plyfile and texts of pandas are Python objects, which no cloud holds.
    rest = [name for name in names if name not in axes and not records.dtype[name].hasobject]
    return xyz, {name: records[name].copy().reshape(records.size, *records.dtype[name].shape) for name in rest}


def _spelled(parts: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Spell colors (of 0..1 where they are floats) and normals out, as files do."""
    columns = dict(parts)
    colors = columns.pop("colors", None)
    if colors is not None:
        if colors.dtype.kind == "f":
            colors = np.rint(np.clip(np.nan_to_num(colors), 0, 1) * 255).astype(np.uint8)
        columns |= dict(zip(COLORS, np.ascontiguousarray(colors.T), strict=True))
    normals = columns.pop("normals", None)
    if normals is not None:
        columns |= dict(zip(NORMALS, np.ascontiguousarray(normals.T), strict=True))
    # A tensor has two axes of one value a point too.
    return {name: values[:, 0] if values.shape[1:] == (1,) else values for name, values in columns.items()}
