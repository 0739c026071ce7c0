"""Extra dimensions of LAS: what a point format does not know, under a name and a description of 32 bytes each."""

from __future__ import annotations

from typing import Any

import laspy
import numpy as np
from laspy.point.dims import OLD_LASPY_NAMES

from edgel.io.columns import free_name, narrowed

# What the columns of edges mean, in the room that LAS has for it.
_DESCRIPTIONS = {
    "edge_kind": "1 bound 2 near 4 far 8 crease ..",
    "edge_strength": "how marked the edge is, 0 to 1",
    "edge_angle": "turn between the faces, radians",
    "edge_convex": "1 convex, -1 concave, 0 unknown",
    **{f"n{axis}": f"normal of the first face, {axis}" for axis in "xyz"},
    **{f"n{axis}2": f"normal of the second face, {axis}" for axis in "xyz"},
    **{f"t{axis}": f"tangent of the edge, {axis}" for axis in "xyz"},
    **{f"edge_{axis}": f"refined place of the edge, {axis}" for axis in "xyz"},
}
_ROOM = 32  # bytes of a name and of a description
_MOST_DIMENSIONS = 65535 // 192  # descriptors in one record
_MOST_BYTES = 8192  # of a point, what `edgel.io.laz` unpacks; LAS itself has room for 65535
_TYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]


def declare_as_given(header: laspy.LasHeader, extra: laspy.DimensionInfo, attributes: dict[str, np.ndarray]) -> None:
    """Declare an extra dimension as the file had it, if the cloud still has it as the file gave it."""
    word = "_".join(extra.name.split())  # as flat_attributes spells it
    values = attributes.get(word)
    if values is None or extra.dtype is None or ":" in extra.name:
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


def fit_dimensions(
    header: laspy.LasHeader, attributes: dict[str, np.ndarray], said: dict[str, str]
) -> dict[str, np.ndarray]:
    """Declare extra dimensions for what the point format lacks; return the columns by dimension.

    `said` gets what is left out or renamed.
    """
    known = {dimension.name: dimension for dimension in header.point_format.dimensions}
    # Names of packed bytes, and older names that laspy takes for standard dimensions.
    taken = {*"xyz", *(header.point_format.dtype().names or ()), *OLD_LASPY_NAMES} - set(known)
    values = {name: column for name, column in attributes.items() if name in known and _fits(known[name], column)}
    params: list[laspy.ExtraBytesParams] = []
    room = _MOST_BYTES - header.point_format.num_extra_bytes
    for name, column in attributes.items():
        if name in values and name in known:
            continue
        parts = {name: column}
        if column.ndim > 1:
            parts = {f"{name}_{i}": column[:, i] for i in range(column.shape[1])}
        stored = {part: narrowed(single, _types(single)) for part, single in parts.items()}
        size = sum(0 if single is None else single.itemsize for single in stored.values())
        if any(single is None for single in stored.values()):
            said[name] = f"left out, {column.dtype} is wider than any type of LAS; convert it to float64"
            continue
        if len(params) + len(parts) > _MOST_DIMENSIONS or size > room:
            said[name] = "left out, a point of LAS has no room for it; .npz holds it"
            continue
        room -= size
        for part, single in stored.items():
            used = {*values, *known, *(set(attributes) - {part})}
            dimension = _dimension_name(part, used, taken, exact=part in known)
            if dimension != part:
                what = f"{part} of LAS cannot hold its values" if part in known else "to suit LAS"
                said[part] = f"renamed {dimension}, {what}"
            values[dimension] = single  # pyright: ignore[reportArgumentType]
            description = _cut(_DESCRIPTIONS.get(part, part))
            params.append(laspy.ExtraBytesParams(dimension, values[dimension].dtype, description))
    header.add_extra_dims(params)
    return values


def _types(column: np.ndarray) -> list[str]:
    if column.dtype.kind == "b":
        return ["u1"]
    own = f"{column.dtype.kind}{column.dtype.itemsize}"
    return [own] if own in _TYPES else ["f4", "f8"]


def _dimension_name(word: str, used: set[str], taken: set[str], *, exact: bool) -> str:
    """Return a name that neither the points have yet nor LAS takes for something else, of 32 bytes at most."""
    stem = (f"{word}_exact" if exact else word).replace(":", "_")  # NumPy gives out no buffer with a colon in a name
    new = free_name(_cut(stem), used, taken)
    return new if len(new.encode()) <= _ROOM else free_name(_cut(stem, _ROOM - 4), used, taken)


def _cut(text: str, room: int = _ROOM) -> str:
    """Return as much of a text as a number of bytes hold, whole characters only."""
    return text.encode()[:room].decode("utf-8", "ignore")


def _fits(dimension: Any, column: np.ndarray) -> bool:
    """Whether a dimension holds every value exactly."""
    if column.shape[1:] != (dimension.dtype.shape if dimension.dtype is not None else ()):
        return False
    if dimension.num_elements > 1:
        return dimension.dtype is not None and column.dtype == dimension.dtype.base
    if dimension.kind.name == "FloatingPoint":
        with np.errstate(over="ignore"):
            as_stored = column.astype(dimension.dtype)
        return bool(np.array_equal(as_stored, column, equal_nan=True))
    if dimension.scales is not None:
        return True  # on the grid of the file it came from
    if not len(column):
        return True
    low, high = column.min().item(), column.max().item()  # a float16 overflows when it is compared
    whole = column.dtype.kind in "biu" or bool((np.rint(column) == column).all())
    return bool(whole and low >= dimension.min and high <= dimension.max)
