"""Cloud: coordinates and what belongs to them, and the one door where arrays are checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._objects import take_apart

LARGEST = 1e30
"""Largest coordinate, in magnitude: squares of distances stay far from overflow and offsets fit single precision. In
nanometres that is a hundred thousand light years."""
_LARGE = 2  # state of a point with a larger one; 1 otherwise, 0 where it is not finite


@dataclass(frozen=True, eq=False)
class Cloud:
    """A point cloud: coordinates, attributes, and what its file said about it.

    Attributes
    ----------
    xyz : (N, 3) float64
        Coordinates in the cloud's own unit and frame; NaN or inf where an organized sensor saw nothing.
    attributes : mapping of str to (N,) or (N, C) array
        Everything else known per point, by the name its file gave it (``intensity``, ``red``, ``label``...). What is
        masked, here and in `xyz`, is missing: NaN, for which integers become float64.
    shape : (int, int) or None
        Rows and columns of an organized cloud (``N == rows * columns``, row-major), None when unorganized.
    viewpoint : (3,) float64 or None
        Where the sensor stood, in the cloud's frame, when that is known.
    crs : str or None
        Coordinate reference system as WKT (or ``EPSG:n``), when the file carried one.
    metadata : mapping
        What a format needs to write the cloud back as it was (LAS scales and offsets, comments...).

    Examples
    --------
    >>> import numpy as np, edgel
    >>> cloud = edgel.Cloud(np.eye(3), {"intensity": np.array([1, 2, 3], np.uint16)})
    >>> len(cloud), cloud.is_organized
    (3, False)
    """

    xyz: np.ndarray
    attributes: Mapping[str, np.ndarray] = field(default_factory=dict)
    shape: tuple[int, int] | None = None
    viewpoint: np.ndarray | None = None
    crs: str | None = None
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        xyz = _coordinates(self.xyz)
        shape = self.shape
        if xyz.ndim == 3:
            shape = xyz.shape[:2] if shape is None else shape
            xyz = xyz.reshape(-1, 3)
        if shape is not None and shape[0] * shape[1] != len(xyz):
            raise ValueError(f"shape {tuple(shape)} of an organized cloud does not hold its {len(xyz)} points")
        attributes = {}
        for name, values in self.attributes.items():
            array = unmasked(values, f"attribute {name!r}")
            if array.ndim == 0 or len(array) != len(xyz):
                raise ValueError(
                    f"attribute {name!r:.80} has shape {array.shape}; its first axis must be {len(xyz)} long"
                )
            attributes[name] = array
        viewpoint = None if self.viewpoint is None else as_vector(self.viewpoint, "viewpoint")
        object.__setattr__(self, "xyz", xyz)
        object.__setattr__(self, "attributes", MappingProxyType(attributes))
        object.__setattr__(self, "shape", None if shape is None else (int(shape[0]), int(shape[1])))
        object.__setattr__(self, "viewpoint", viewpoint)
        object.__setattr__(self, "metadata", MappingProxyType(dict(self.metadata)))

    def __len__(self) -> int:
        return len(self.xyz)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and copy: the read-only views of the mappings are made anew."""
        parts = (self.xyz, dict(self.attributes), self.shape, self.viewpoint, self.crs, dict(self.metadata))
        return type(self), parts

    def __repr__(self) -> str:
        form = f"organized {self.shape[0]} x {self.shape[1]}" if self.shape else "unorganized"
        names = ", ".join(self.attributes) or "none"
        return f"Cloud({len(self):,} points, {form}; attributes: {names})"

    @property
    def is_organized(self) -> bool:
        """Whether the points form a grid of rows and columns, as a camera makes them."""
        return self.shape is not None

    def take(self, rows: np.ndarray) -> Cloud:
        """Return the cloud of the given rows (int or bool (N,)) with all their attributes; no longer organized."""
        return replace(
            self,
            xyz=self.xyz[rows],
            attributes={name: values[rows] for name, values in self.attributes.items()},
            shape=None,
        )

    def with_attributes(self, **attributes: np.ndarray) -> Cloud:
        """Return the same cloud with these attributes added, or replaced where the name exists."""
        return replace(self, attributes={**self.attributes, **attributes})


@dataclass(frozen=True, eq=False)
class Points:
    """What the kernels work on: the finite points of an input and where they came from.

    Attributes
    ----------
    xyz : (M, 3) float64, C-contiguous
        Finite coordinates.
    rows : (M,) int64
        Row of the input (flat when organized) of each of them, ascending.
    num_input : int
        Number of points that came in, finite or not.
    """

    xyz: np.ndarray
    rows: np.ndarray
    num_input: int

    @property
    def num_dropped(self) -> int:
        """Number of points left out because a coordinate was NaN or infinite."""
        return self.num_input - len(self.rows)


def as_cloud(points: Any) -> Cloud:
    """Make a Cloud of anything that carries points.

    Parameters
    ----------
    points : Cloud, (N, 3) or (H, W, 3) array_like, records with x, y and z, or an object that carries points
        See `edgel._objects.take_apart` for the objects of other libraries that are understood; their attributes come
        along.

    Raises
    ------
    TypeError, ValueError
        If it carries no numeric coordinates of shape (N, 3) or (H, W, 3).
    """
    return points if isinstance(points, Cloud) else Cloud(*take_apart(points))


def check_points(points: Any, *, minimum: int = 3) -> Points:
    """Check the input of a public function and keep its finite points.

    Parameters
    ----------
    points : see `as_cloud`
    minimum : int
        How many finite points the caller needs at least.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no coordinates, or fewer than `minimum` finite ones, or one beyond `LARGEST`.
    """
    cloud = as_cloud(points)
    xyz = cloud.xyz
    # Kernels, not BLAS: its threads would spin for a while on the cores that ours need next.
    state = np.empty(len(xyz), np.uint8)
    run_slices(_look, len(xyz), xyz, state, size=65536)
    rows = np.flatnonzero(state > 0)
    xyz = xyz if len(rows) == len(xyz) else xyz.take(rows, axis=0)
    if (state == _LARGE).any():
        _check_size(xyz, rows, "points")
    if len(rows) < minimum:
        found = f"{len(rows)} finite points of {len(cloud)}" if len(rows) < len(cloud) else len(rows)
        raise ValueError(f"points: needs at least {minimum} points with finite coordinates, got {found}")
    return Points(np.ascontiguousarray(xyz), rows, len(cloud))


@kernel
def _look(start, stop, xyz, state):
    """Say of each point whether it is finite, and whether a coordinate is too large."""
    for p in range(start, stop):
        largest = max(abs(xyz[p, 0]), abs(xyz[p, 1]), abs(xyz[p, 2]))
        finite = math.isfinite(xyz[p, 0]) and math.isfinite(xyz[p, 1]) and math.isfinite(xyz[p, 2])
        state[p] = 0 if not finite else _LARGE if largest > LARGEST else 1


def check_rows(at: Any, num_points: int) -> np.ndarray:
    """Check row numbers (int) or a mask (bool, (N,)) of a cloud and return them as (M,) int64."""
    rows = np.asarray(at)
    if rows.ndim == 1 and rows.dtype == bool:
        if len(rows) != num_points:
            raise ValueError(f"at: a mask of {len(rows)} for {num_points} points; give one flag a point")
        return np.flatnonzero(rows)
    if rows.ndim != 1 or (rows.size and rows.dtype.kind not in "iu"):
        raise TypeError(f"at: expected (M,) row numbers or an (N,) mask, got {rows.dtype} of shape {rows.shape}")
    rows = rows.astype(np.int64)
    if rows.size and (rows.min() < 0 or rows.max() >= num_points):
        raise ValueError(f"at: rows must lie in 0..{num_points - 1}, got {rows.min()}..{rows.max()}")
    return rows


def check_positions(positions: Any, name: str) -> np.ndarray:
    """Check positions (M, 3), all of which have to be finite and within `LARGEST`, and return them as float64."""
    xyz = np.ascontiguousarray(positions, dtype=np.float64)
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise ValueError(f"{name}: expected shape (M, 3), got {xyz.shape}")
    bad = np.flatnonzero(~np.isfinite(xyz).all(axis=1))
    if len(bad):
        raise ValueError(f"{name}: row {bad[0]} is not finite ({xyz[bad[0]].tolist()}); leave such rows out")
    _check_size(xyz, np.arange(len(xyz)), name)
    return xyz


def _check_size(xyz: np.ndarray, rows: np.ndarray, name: str) -> None:
    """Refuse finite coordinates (M, 3) beyond `LARGEST`; `rows` (M,) are their rows in the input."""
    large = np.flatnonzero((np.abs(xyz) > LARGEST).any(axis=1))
    if len(large):
        where = f"row {rows[large[0]]}" + (f" and {len(large) - 1:,} more" if len(large) > 1 else "")
        raise ValueError(
            f"{name}: {where} has a coordinate beyond {LARGEST:g} ({xyz[large[0]].tolist()}), too far for distances to "
            "be computed; leave it out, or choose a larger unit"
        )


def as_vector(value: Any, name: str) -> np.ndarray:
    """Check a finite (3,) vector within `LARGEST` and return it as float64."""
    vector = np.asarray(unmasked(value, name), dtype=np.float64)
    if vector.shape != (3,) or not (np.abs(vector) <= LARGEST).all():
        raise ValueError(f"{name}: expected three finite numbers of at most {LARGEST:g} in magnitude, got {value!r}")
    return vector


def unmasked(values: Any, name: str) -> np.ndarray:
    """Make an array, NaN where it was masked (`numpy.ma`); integers and flags become float64 for that.

    Raises
    ------
    ValueError
        If something is masked and the type has no NaN: texts, records, integers beyond 2^53.
    """
    several = isinstance(values, list | tuple) and any(map(np.ma.isMaskedArray, values))
    masked: Any = np.ma.array(values) if several else values
    if not np.ma.is_masked(masked):
        return np.asarray(masked)
    numbers = masked.astype(np.float64) if masked.dtype.kind in "biu" else masked
    beyond = masked.dtype.kind in "iu" and np.abs(numbers.compressed()).max(initial=0) > 2**53
    if numbers.dtype.kind not in "fc" or beyond:
        raise ValueError(f"{name}: some are masked, and {masked.dtype} has no NaN for them; fill them (.filled(value))")
    return numbers.filled(np.nan)


def in_box(xyz: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Mark the points (N, 3) inside a box, its lower and upper corner (2, 3), (N,) bool."""
    return ((xyz >= box[0]) & (xyz <= box[1])).all(axis=1)


def _coordinates(xyz: Any) -> np.ndarray:
    array = unmasked(xyz, "points")
    if array.dtype.kind not in "fiu":
        raise TypeError(
            f"points: expected numbers of shape (N, 3) or (H, W, 3), got {type(xyz).__name__} ({array.dtype})"
        )
    if array.ndim not in (2, 3) or array.shape[-1] != 3:
        raise ValueError(f"points: expected shape (N, 3) or (H, W, 3), got {array.shape}{_remedy(array)}")
    return array.astype(np.float64, copy=False)


def _remedy(array: np.ndarray) -> str:
    if array.ndim == 2 and array.shape[0] == 3:
        return "; coordinates are in its rows: pass points.T"
    if array.ndim == 2 and array.shape[1] == 2:
        return "; z is missing: pass np.column_stack([points, np.zeros(len(points))]) for a flat cloud"
    if array.ndim == 2 and array.shape[1] > 3:
        return "; pass the coordinates alone, points[:, :3]"
    if array.ndim == 1:
        return "; for one point pass points[None, :]"
    return ""
