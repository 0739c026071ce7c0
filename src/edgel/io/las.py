"""LAS, LAZ and COPC by laspy: every dimension, scales, offsets, extra dimensions and the CRS."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import laspy
import numpy as np
from laspy.vlrs.vlrlist import VLRList

from edgel.cloud import Cloud
from edgel.io.columns import flat_attributes
from edgel.io.errors import FormatError
from edgel.io.files import reading, replacing, wrong_magic
from edgel.io.las_crs import crs_of, set_crs

# laspy logs an error before it raises it, which Python prints when nobody listens; the exception says the same.
logging.getLogger("laspy").addHandler(logging.NullHandler())

# Points decoded at a time: a header that promises too many costs no more than this.
_CHUNK = 1_000_000
_MAX_INT32 = 2**31 - 1


@contextmanager
def _foreign_errors(path: object, doing: str) -> Iterator[None]:
    """Turn whatever laspy and lazrs raise over a damaged file into a FormatError."""
    try:
        yield
    except FormatError:
        raise
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:
        # A panic of lazrs (Rust) is a BaseException, which `except Exception` lets through; others of its kind pass.
        panic = type(error).__name__ == "PanicException"
        if not isinstance(error, Exception) and not panic:
            raise
        what = (
            "its compression is of an old or unknown kind, or damaged" if panic else str(error) or type(error).__name__
        )
        raise FormatError(
            f"{path}: {doing} failed ({what}); get the file again or convert it with `las2las` or PDAL"
        ) from None


def read(path: str | os.PathLike[str]) -> Cloud:
    """Read a LAS, LAZ or COPC file.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        Every dimension but X, Y, Z as an attribute by laspy's name, bit fields and extra dimensions too. The CRS is WKT
        or ``EPSG:n`` if the file has one; ``metadata["las_header"]`` is laspy's header, with scales and offsets, for
        `write`.

    Raises
    ------
    FormatError
        If the file is not LAS, is cut off, or its compression is damaged or not known.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(f"{folder}/a.laz", Cloud(np.eye(3), {"intensity": np.array([1, 2, 3], np.uint16)}))
    ...     read(f"{folder}/a.laz").attributes["intensity"]
    array([1, 2, 3], dtype=uint16)
    """
    name = os.fspath(path)
    with reading(path) as file:
        size = os.fstat(file.fileno()).st_size
        head = file.read(512)
        if not head.startswith(b"LASF"):
            wrong_magic(name, "a LAS or LAZ file", head)
        _check_records(name, head, size)
        file.seek(0)
        with _foreign_errors(name, "reading LAS"), laspy.open(file, closefd=False) as reader:
            header = reader.header
            _check_size(name, header, size)
            columns = _read_columns(name, reader)
        scales, offsets = np.asarray(header.scales), np.asarray(header.offsets)
        if not (np.isfinite(scales).all() and np.isfinite(offsets).all()):
            raise FormatError(
                f"{name}: the scales {scales} or offsets {offsets} of the header are not finite; get the file again"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            xyz = np.column_stack([columns.pop(axis) * scales[i] + offsets[i] for i, axis in enumerate("XYZ")])
        if not np.isfinite(xyz).all():
            raise FormatError(
                f"{name}: scales {scales} make coordinates infinite; the header is damaged: get the file again"
            )
    return Cloud(xyz, columns, crs=crs_of(header), metadata={"las_header": header})


def _check_records(path: str, head: bytes, size: int) -> None:
    """Compare the promised records with the file's size: laspy would read billions of empty ones."""
    records = [(100, 54)] + ([(243, 60)] if head[24:26] == b"\x01\x04" else [])
    for position, length in records:
        count = int.from_bytes(head[position : position + 4], "little")
        if count * length > size:
            raise FormatError(f"{path}: declared {count} header records, the file has {size} bytes; get the file again")


def _check_size(path: str, header: laspy.LasHeader, size: int) -> None:
    """Compare the promised points with the file's size; packed points only become known when they are unpacked."""
    if header.are_points_compressed:
        return
    found = max(size - header.offset_to_point_data, 0) // header.point_format.size
    if found < header.point_count:
        raise FormatError(
            f"{path}: declared {header.point_count} points, found {found}; the file is cut off: get it again"
        )


def _read_columns(path: str, reader: laspy.LasReader) -> dict[str, np.ndarray]:
    names = list(reader.header.point_format.dimension_names)
    parts: dict[str, list[np.ndarray]] = {name: [] for name in names}
    for points in reader.chunk_iterator(_CHUNK):
        for name in names:
            parts[name].append(np.array(points[name]))
    found = sum(map(len, parts["X"]))
    if found != reader.header.point_count:
        declared = reader.header.point_count
        raise FormatError(f"{path}: declared {declared} points, found {found}; the file is cut off: get it again")
    if not found:
        empty = laspy.ScaleAwarePointRecord.zeros(0, header=reader.header)
        return {name: np.array(empty[name]) for name in names}
    return {name: arrays[0] if len(arrays) == 1 else np.concatenate(arrays) for name, arrays in parts.items()}


def write(path: str | os.PathLike[str], cloud: Cloud) -> None:
    """Write a LAS file, or a LAZ file when the name ends in ``.laz``.

    A cloud read from LAS keeps its header: version, point format, CRS, and scales and offsets as long as all points
    still lie on their grid. Otherwise the scale is the smallest power of ten for which the extent fits 32-bit integers
    (0.001 mm for a kilometre in metres), and the offset the largest round number below the smallest coordinate.
    Attributes that LAS does not know become extra dimensions; so does, as ``<name>_exact``, one whose values the
    dimension of its name cannot hold (an intensity of 0..1). Organized shape and viewpoint are not kept, LAS has no
    place for them. COPC is written as plain LAZ.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Raises
    ------
    FormatError
        If a coordinate is NaN or infinite, or an attribute cannot be stored.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(f"{folder}/a.las", Cloud(np.eye(3), {"label": np.arange(3)}))
    ...     read(f"{folder}/a.las").attributes["label"]
    array([0, 1, 2])
    """
    name = os.fspath(path)
    num_bad = int((~np.isfinite(cloud.xyz).all(axis=1)).sum())
    if num_bad:
        raise FormatError(
            f"{name}: {num_bad} of {len(cloud)} points are NaN or infinite, which LAS cannot store; drop them "
            "(cloud.take(np.isfinite(cloud.xyz).all(axis=1))) or write .ply, .pcd or .npz"
        )
    attributes = flat_attributes(cloud, name, keep_arrays=True)
    header = _header_for(cloud, attributes)
    values = _fit_dimensions(name, header, attributes)
    scales, offsets = _grid(cloud.xyz, header, new="las_header" not in cloud.metadata)
    header.scales, header.offsets = scales, offsets
    with _foreign_errors(name, "encoding LAS"):
        record = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
        for i, axis in enumerate("XYZ"):
            record[axis] = np.rint((cloud.xyz[:, i] - offsets[i]) / scales[i]).astype(np.int32)
        for dimension, column in values.items():
            record[dimension] = column
    with replacing(path) as file:
        data = laspy.LasData(header, record)
        data.write(file, do_compress=name.lower().endswith(".laz"))


def _header_for(cloud: Cloud, attributes: dict[str, np.ndarray]) -> laspy.LasHeader:
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
    if values.shape[1:] == extra.dtype.shape and (scaled or values.dtype == extra.dtype.base):
        attributes[extra.name] = attributes.pop(word)
        kind = extra.type_str() or extra.dtype
        header.add_extra_dim(
            laspy.ExtraBytesParams(extra.name, kind, extra.description, extra.offsets, extra.scales, extra.no_data)
        )


def _fit_dimensions(path: str, header: laspy.LasHeader, attributes: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
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


def _grid(xyz: np.ndarray, header: laspy.LasHeader, *, new: bool) -> tuple[np.ndarray, np.ndarray]:
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
