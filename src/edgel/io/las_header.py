"""The LAS header that suits a cloud: its point format, extra dimensions, and the grid of its coordinates."""

from __future__ import annotations

from typing import Any

import laspy
import numpy as np
from laspy.vlrs.vlrlist import VLRList

from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.las_crs import crs_of, set_crs

_MAX_INT32 = 2**31 - 1


def header_for(cloud: Cloud, attributes: dict[str, np.ndarray]) -> laspy.LasHeader:
    """Return the header the cloud came with, as far as it still holds, or a new one."""
    given: Any = cloud.metadata.get("las_header")
    if isinstance(given, laspy.LasHeader):
        header = laspy.LasHeader(version=given.version, point_format=laspy.PointFormat(given.point_format.id))
        for field in ("file_source_id", "system_identifier", "generating_software", "creation_date", "uuid"):
            setattr(header, field, getattr(given, field))
        header.global_encoding.value = given.global_encoding.value
        header.scales, header.offsets = np.array(given.scales), np.array(given.offsets)
        # COPC's own records describe an octree that plain LAZ has not; laspy writes compression and extra bytes anew.
        kept = [vlr for vlr in given.vlrs if vlr.user_id not in ("copc", "laszip encoded")]
        header.vlrs = VLRList([vlr for vlr in kept if type(vlr).__name__ != "ExtraBytesVlr"])
        for extra in given.point_format.extra_dimensions:
            _declare_as_given(header, extra, attributes)
        if crs_of(given) == cloud.crs:
            return header
    else:
        # EPSG codes go into GeoTIFF keys, which formats below 6 have; formats from 6 on demand WKT.
        legacy = "scan_angle_rank" in attributes or (cloud.crs or "").upper().startswith("EPSG:")
        color = all(name in attributes for name in ("red", "green", "blue"))
        point_format = (3 if color else 1) if legacy else 7 if color else 6
        if not legacy and color and "nir" in attributes:
            point_format = 8
        header = laspy.LasHeader(version="1.4", point_format=point_format)
        header.generating_software = "edgel"
    set_crs(header, cloud.crs)
    return header


def _declare_as_given(header: laspy.LasHeader, extra: laspy.DimensionInfo, attributes: dict[str, np.ndarray]) -> None:
    """Declare an extra dimension as the file had it, if the cloud still has it as the file gave it."""
    word = "_".join(extra.name.split())  # as flat_attributes spells it
    values = attributes.get(word)
    if values is None or extra.dtype is None:
        return
    scaled = extra.scales is not None or extra.offsets is not None
    as_given = _on_grid(values, extra) if scaled else values.dtype == extra.dtype.base
    if values.shape[1:] == extra.dtype.shape and as_given:
        attributes[extra.name] = attributes.pop(word)
        kind = extra.type_str() or extra.dtype
        header.add_extra_dim(
            laspy.ExtraBytesParams(extra.name, kind, extra.description, extra.offsets, extra.scales, extra.no_data)
        )


def _on_grid(values: np.ndarray, extra: laspy.DimensionInfo) -> bool:
    """Whether values are those that a scaled dimension can hold; others may have come under its name since."""
    scales = 1.0 if extra.scales is None else extra.scales
    offsets = 0.0 if extra.offsets is None else extra.offsets
    with np.errstate(invalid="ignore", over="ignore"):
        steps = (values - offsets) / scales
        return bool((np.abs(steps - np.rint(steps)) <= 1e-6 * np.maximum(np.abs(steps), 1)).all())


def fit_dimensions(path: str, header: laspy.LasHeader, attributes: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Declare extra dimensions for what the point format lacks; return the columns by dimension."""
    known = {dimension.name: dimension for dimension in header.point_format.dimensions}
    values: dict[str, np.ndarray] = {}
    for name, column in attributes.items():
        if name in known and _fits(known[name], column):
            values[name] = column
            continue
        parts = {name: column}
        if column.ndim > 1:
            parts = {f"{name}_{i}": column[:, i] for i in range(column.shape[1])}
        for part, single in parts.items():
            dimension = f"{part}_exact" if part in known else part
            if len(dimension.encode()) > 32 or dimension in values or (dimension != name and dimension in attributes):
                raise FormatError(
                    f"{path}: {name!r} needs an extra dimension of its own, of at most 32 bytes; rename it"
                )
            values[dimension] = _storable(path, name, single)
            header.add_extra_dim(laspy.ExtraBytesParams(dimension, values[dimension].dtype))
    return values


def _storable(path: str, name: str, column: np.ndarray) -> np.ndarray:
    """Return a column in the smallest type of extra dimensions that holds it."""
    if column.dtype.kind == "b":
        return column.astype(np.uint8)
    if column.dtype.kind == "f":
        if column.dtype.itemsize > 8:
            raise FormatError(
                f"{path}: attribute {name!r} is {column.dtype}, wider than LAS knows; convert it to float64"
            )
        return column.astype(np.float64 if column.dtype.itemsize == 8 else np.float32)
    return column.astype(column.dtype.newbyteorder("="))


def _fits(dimension: laspy.DimensionInfo, column: np.ndarray) -> bool:
    """Whether a dimension holds every value exactly."""
    if column.shape[1:] != (dimension.dtype.shape if dimension.dtype is not None else ()):
        return False
    if dimension.num_elements > 1:
        return dimension.dtype is not None and column.dtype == dimension.dtype.base
    if dimension.kind.name == "FloatingPoint":
        as_stored = column.astype(dimension.dtype)
        return bool(np.array_equal(as_stored, column, equal_nan=True))
    if dimension.scales is not None:
        return True  # on the grid of the file it came from
    if not len(column):
        return True
    low, high = column.min().item(), column.max().item()  # a float16 overflows when it is compared
    whole = column.dtype.kind in "biu" or bool((np.rint(column) == column).all())
    return bool(whole and low >= dimension.min and high <= dimension.max)


def choose_grid(xyz: np.ndarray, header: laspy.LasHeader, *, new: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return scales and offsets (3,): the header's where all points lie on its grid, else the finest that fits."""
    scales, offsets = np.array(header.scales, float), np.array(header.offsets, float)
    for axis in range(3):
        column = xyz[:, axis]
        if not len(column):
            continue
        if new:
            scales[axis], offsets[axis] = _finest(float(column.min()), float(column.max()))
            continue
        steps = (column - offsets[axis]) / scales[axis]
        tolerance = 1e-9 + np.finfo(float).eps * 8 * np.abs(column).max() / scales[axis]
        if np.abs(steps).max() <= _MAX_INT32 and tolerance < 0.5 and np.abs(steps - np.rint(steps)).max() <= tolerance:
            continue
        scales[axis], offsets[axis] = _finest(float(column.min()), float(column.max()))
    return scales, offsets


def _finest(low: float, high: float) -> tuple[float, float]:
    """Return the smallest power of ten that reaches `high` in 31 bits, and the round offset that it counts from."""
    extent = max(high - low, np.finfo(float).eps * max(abs(low), abs(high)), 1e-12)
    unit = 10.0 ** np.ceil(np.log10(extent))
    offset = float(np.floor(low / unit) * unit)
    exponent = int(np.ceil(np.log10(max(high - offset, extent) / _MAX_INT32)))
    # Below the spacing of doubles at these coordinates there is nothing to keep.
    exponent = max(exponent, int(np.floor(np.log10(max(np.spacing(max(abs(low), abs(high))), 1e-300)))))
    return float(f"1e{exponent}"), offset
