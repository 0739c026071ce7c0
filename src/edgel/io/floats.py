"""Sweeps of float32 without any header (.bin): KITTI's x y z intensity, and nuScenes' with a ring besides."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from edgel.cloud import Cloud
from edgel.io.errors import FormatError
from edgel.io.files import describe, reading
from edgel.io.names import find_axes
from edgel.io.text_layout import as_columns

_KITTI = ["x", "y", "z", "intensity"]
_NUSCENES = [*_KITTI, "ring"]
_FARTHEST = 1e6  # of a coordinate, metres: what is no such file has floats of any size
_MOST_RINGS = 1024
_REMEDY = "name its columns of float32 (--columns x,y,z,intensity,ring; columns= in Python)"


def read(path: str | os.PathLike[str], *, columns: str | Sequence[str] | None = None) -> Cloud:
    """Read a sweep of little-endian float32.

    Parameters
    ----------
    path : path
    columns : str or sequence of str, optional
        Names of the numbers of a point; ``_`` leaves one out. Default: ``x y z intensity`` (KITTI) or ``x y z
        intensity ring`` (nuScenes), whichever the size of the file and its values fit; ``.pcd.bin`` is nuScenes'.

    Returns
    -------
    Cloud
        ``ring`` is uint16 where it holds whole numbers, other attributes are float32.

    Raises
    ------
    FormatError
        If the size or the values fit neither, or not `columns`.
    ValueError
        If x, y and z are not among `columns`.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.array([[1, 2, 3, 0.5], [4, 5, 6, 0.25]], "<f4").tofile(f"{folder}/a.bin")
    ...     read(f"{folder}/a.bin").attributes["intensity"]
    array([0.5 , 0.25], dtype=float32)
    """
    name = os.fspath(path)
    given = None if columns is None else as_columns(columns)
    with reading(path) as file:
        raw = file.read()
    if given is not None:
        if len(raw) % (4 * len(given)):
            raise FormatError(f"{name}: its {len(raw)} bytes are not points of {len(given)} float32; {_REMEDY}")
        names = given
    else:
        names = _find_layout(name, raw)
    table = np.frombuffer(raw, "<f4").reshape(-1, len(names))
    places = [names.index(axis) for axis in find_axes(names) or ()]
    attributes = {
        column: _whole(table[:, i]) if column == "ring" else table[:, i].astype(np.float32)
        for i, column in enumerate(names)
        if i not in places and column != "_"
    }
    return Cloud(table[:, places].astype(np.float64), attributes)


def _find_layout(path: str, raw: bytes) -> list[str]:
    """Tell KITTI's layout from nuScenes': a ring is a whole number, and no coordinate lies beyond the horizon."""
    what, remedy = describe(raw[:512])
    known = not what.startswith(("an unknown", "a text that"))
    fitting = []
    for names in (_KITTI, _NUSCENES):
        if known or len(raw) % (4 * len(names)):
            continue
        table = np.frombuffer(raw, "<f4").reshape(-1, len(names))
        with np.errstate(invalid="ignore"):
            near = bool((np.abs(table[:, :3]) <= _FARTHEST).all()) and not np.isnan(table).any()
            # KITTI's intensities are a share; what is read with the wrong number of columns has coordinates there.
            share = bool(((table[:, 3] >= 0) & (table[:, 3] <= 1)).all())
        ring = names is _KITTI or _whole(table[:, 4]).dtype == np.uint16
        if near and ring:
            fitting.append((not path.lower().endswith(".pcd.bin") and names is _KITTI and share, names))
    if not fitting:
        seems = f"the file seems to be {what}: {remedy}" if known else _REMEDY
        raise FormatError(f"{path}: neither a sweep of KITTI (x y z intensity) nor of nuScenes (with ring); {seems}")
    if len(fitting) == 1:
        return fitting[0][1]
    return _KITTI if any(is_kitti for is_kitti, _ in fitting) else _NUSCENES


def _whole(values: np.ndarray) -> np.ndarray:
    """Return rings as uint16, other numbers as they are."""
    with np.errstate(invalid="ignore"):
        rings = bool(((values >= 0) & (values < _MOST_RINGS) & (values == np.rint(values))).all())
    return values.astype(np.uint16 if rings else np.float32)
