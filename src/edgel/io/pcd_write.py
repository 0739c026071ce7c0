"""PCD writing: binary, in the names and types that the Point Cloud Library reads."""

from __future__ import annotations

import os

import numpy as np

from edgel._objects import COLORS, NORMALS
from edgel.cloud import Cloud
from edgel.io.columns import fits_float32, flat_attributes, narrowed
from edgel.io.errors import tell
from edgel.io.files import replacing
from edgel.io.pcd_header import SHIFT
from edgel.io.rows import write_binary

_PCL_NORMALS = dict(zip(NORMALS, ("normal_x", "normal_y", "normal_z"), strict=True))
_IDENTITY = (1.0, 0.0, 0.0, 0.0)
# Fields of PCL's own point types: under another type they are not found.
_PCL_TYPES = {"intensity": "f4", "label": "u4", "curvature": "f4"}
# Names that a reader gives a meaning: packed colors, and padding.
_TAKEN = ("x", "y", "z", "rgb", "rgba", "_")
# Half a millimetre is lost by single precision at ten kilometres; CloudCompare offers a shift from there on too.
_LARGE = 1e4
_HUGE = 2.0**53  # whole numbers are exact up to there


def write(path: str | os.PathLike[str], cloud: Cloud) -> None:
    """Write a binary PCD file.

    Coordinates are F 4, the only type that PCL's points have. From coordinates beyond 10,000 that this would round a
    round number is taken first, an axis each; a comment in the header keeps it, by which `read` adds it again.
    ``nx ny nz`` become PCL's ``normal_x normal_y normal_z``; ``red``, ``green``, ``blue`` of 0 to 255 are packed into
    ``rgb`` (F 4), with ``alpha`` into ``rgba`` (U 4); ``intensity`` and ``curvature`` become F 4 and ``label`` U 4
    where that is exact. Other attributes keep their type, but bool becomes U 1, float16 F 4, and integers of 64 bits
    those of 32 that hold them, which older PCL reads too; (N, C) attributes get COUNT C. The rotation of
    ``metadata["pcd_viewpoint"]`` is kept; without a viewpoint the line VIEWPOINT is left out.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Warns
    -----
    FormatWarning
        If the coordinates are shifted, or an attribute is left out or renamed.

    Raises
    ------
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, pathlib, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "a.pcd")
    ...     write(file, Cloud(np.eye(3)))
    ...     file.read_bytes().splitlines()[2]
    b'FIELDS x y z'
    """
    said: dict[str, str] = {}
    xyz, shift, coordinate = _coordinates(cloud, said)
    columns: dict[str, np.ndarray] = {}
    # One component alone, or beside columns of these names, would not be read back as a normal.
    both = {*NORMALS, *_PCL_NORMALS.values()} & {*cloud.attributes}
    normals = _PCL_NORMALS if both == {*NORMALS} else {}
    for name, values in flat_attributes(cloud, said, keep_arrays=True, taken=_TAKEN).items():
        stored = narrowed(values, _types(name, values))
        if stored is None:
            said[name] = f"left out, {values.dtype} is wider than any type of PCD; convert it to float64"
            continue
        columns[normals.get(name, name)] = stored[:, 0] if stored.shape[1:] == (1,) else stored
    columns = {**dict(zip("xyz", xyz.T, strict=True)), **_pack_colors(columns)}
    layout = [(name, "<" + values.dtype.str[1:], values.shape[1:]) for name, values in columns.items()]
    layout = [(name, coordinate if name in ("x", "y", "z") else code, shape) for name, code, shape in layout]
    tell(os.fspath(path), said)
    with replacing(path) as file:
        file.write(_header_text(cloud, layout, shift).encode("utf-8", "replace"))
        write_binary(file, np.dtype(layout), columns)


def _coordinates(cloud: Cloud, said: dict[str, str]) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Return the coordinates to write, what was taken from them, and their type."""
    if fits_float32(cloud.xyz):
        return cloud.xyz, None, "<f4"
    finite = cloud.xyz[np.isfinite(cloud.xyz).all(axis=1)]
    low, high = (finite.min(axis=0), finite.max(axis=0)) if len(finite) else (np.zeros(3), np.zeros(3))
    most = np.maximum(-low, high)
    shift = np.where((most > _LARGE) & (most < _HUGE), np.rint(low / 200 + high / 200) * 100, 0.0)
    given = cloud.metadata.get("pcd_shift")
    if given is not None and np.maximum(np.abs(low - given), np.abs(high - given)).max() <= _LARGE:
        shift = np.array(given, np.float64)  # as it was: the same coordinates have the same bytes
    xyz, shift = (cloud.xyz - shift, shift) if shift.any() else (cloud.xyz, None)
    most = float(np.abs([low, high] if shift is None else [low - shift, high - shift]).max())
    if most > float(np.finfo(np.float32).max):
        said["coordinates"] = "written in double precision, beyond the range of the single one that PCL reads"
        return cloud.xyz, None, "<f8"
    rounded = f"rounded to single precision, as PCL reads it, by {np.spacing(np.float32(most)) / 2:.1g} at most"
    if shift is not None:
        words = " ".join(map(_number, shift.tolist()))
        said["coordinates"] = f"counted from {words}, which a comment keeps and edgel adds again, and {rounded}"
    elif most > _LARGE:
        said["coordinates"] = rounded
    return xyz, shift, "<f4"


def _types(name: str, values: np.ndarray) -> list[str]:
    """Return the types that a field may have, the best first."""
    kind, size = values.dtype.kind, values.dtype.itemsize
    if kind == "b":
        return ["u1"]
    own = f"{kind}{size}"
    if kind == "f":
        return [own] if size in (4, 8) else ["f4", "f8"]
    wanted = [_PCL_TYPES[name]] if name in _PCL_TYPES else ["u1"] if name in COLORS else []
    return wanted + (["i4", "u4", own] if size == 8 else [own])


def _pack_colors(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    if not all(name in columns and columns[name].dtype == np.uint8 and columns[name].ndim == 1 for name in COLORS):
        return columns
    red, green, blue = (columns.pop(name).astype(np.uint32) for name in COLORS)
    bits = red << 16 | green << 8 | blue
    alpha = columns.get("alpha")
    # An alpha of 0 or 255 throughout would not be read back from rgba: it stays a field of its own.
    if alpha is not None and alpha.dtype == np.uint8 and alpha.ndim == 1 and is_meaningful(alpha):
        del columns["alpha"]
        return {**columns, "rgba": bits | alpha.astype(np.uint32) << 24}
    return {**columns, "rgb": bits.view(np.float32)}


def is_meaningful(alpha: np.ndarray) -> bool:
    """Whether an alpha is more than the filler of a packed color, 0 or 255 throughout."""
    return len(alpha) > 0 and not (alpha[0] in (0, 255) and bool((alpha == alpha[0]).all()))


def _header_text(cloud: Cloud, layout: list[tuple[str, str, tuple[int, ...]]], shift: np.ndarray | None) -> str:
    height, width = cloud.shape or (1, len(cloud))
    if width == 1:
        height, width = 1, height  # one column is no grid
    lines = ["# .PCD v0.7 - Point Cloud Data file format"]
    if shift is not None:
        lines.append(f"{SHIFT} {' '.join(map(_number, shift.tolist()))}: to be added to x y z")
    lines += [
        "VERSION 0.7",
        "FIELDS " + " ".join(name for name, _, _ in layout),
        "SIZE " + " ".join(code[2:] for _, code, _ in layout),
        "TYPE " + " ".join(code[1].upper() for _, code, _ in layout),
        "COUNT " + " ".join(str(shape[0] if shape else 1) for _, _, shape in layout),
        f"WIDTH {width}",
        f"HEIGHT {height}",
    ]
    if cloud.viewpoint is not None:
        place = cloud.viewpoint if shift is None else cloud.viewpoint - shift
        rotation = tuple(cloud.metadata.get("pcd_viewpoint", ()))[3:] or _IDENTITY
        lines.append("VIEWPOINT " + " ".join(map(_number, (*place.tolist(), *rotation))))
    return "\n".join([*lines, f"POINTS {len(cloud)}", "DATA binary", ""])


def _number(value: float) -> str:
    return repr(int(value)) if value == int(value) else repr(float(value))
