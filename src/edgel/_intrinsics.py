"""The pinhole camera of a depth image, and the ways in which others write it down."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

ACCEPTED = (
    "accepted are an edgel.Intrinsics, (fx, fy, cx, cy), a 3 x 3 matrix, and objects or mappings of RealSense (fx fy "
    "ppx ppy), Open3D (intrinsic_matrix), ROS CameraInfo (k, K or camera_matrix) and BOP (cam_K)"
)
_FOCAL = ("fx", "fy")
_CENTRE = (("cx", "ppx"), ("cy", "ppy"))
_MATRICES = ("cam_K", "camera_matrix", "K", "k", "intrinsic_matrix")
_PROJECTIONS = ("p", "P", "projection_matrix")
_SIZE = (("width", "image_width"), ("height", "image_height"))
_DISTORTION = ("coeffs", "d", "D", "distortion_coefficients", "k1", "k2", "k3", "p1", "p2")
_NESTED = "intrinsic"  # Open3D: the camera of a recording or of a view, one level down
_ATTRIBUTES = (*_FOCAL, *sum(_CENTRE, ()), *_MATRICES, *_PROJECTIONS, *sum(_SIZE, ()), *_DISTORTION, _NESTED)


@dataclass(frozen=True)
class Intrinsics:
    """The pinhole camera of a depth image.

    Attributes
    ----------
    fx, fy : float
        Focal lengths, pixels.
    cx, cy : float
        Principal point, pixels; the centre of the first pixel is (0, 0).
    depth_scale : float or None
        Cloud units in one count of the image; None: 0.001 for integers (millimetres to metres), 1 for floats.
    width, height : int or None
        Size of the image that they belong to, checked when known.

    Examples
    --------
    >>> Intrinsics(fx=525, fy=525, cx=319.5, cy=239.5).cx
    319.5
    """

    fx: float
    fy: float
    cx: float
    cy: float
    depth_scale: float | None = None
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        for name in ("fx", "fy", "cx", "cy", "depth_scale", "width", "height"):
            value = getattr(self, name)
            if value is None and name in ("depth_scale", "width", "height"):
                continue
            number = _number(value)
            if not math.isfinite(number):
                raise ValueError(f"{name}: expected a finite number, got {value!r:.80}")
            if number <= 0 and name not in ("cx", "cy"):
                raise ValueError(f"{name}: expected a number above 0, got {value!r:.80}")
            if name in ("width", "height"):
                if number != int(number):
                    raise ValueError(f"{name}: expected a whole number of pixels, got {value!r:.80}")
                number = int(number)
            object.__setattr__(self, name, number)


def as_intrinsics(camera: Any) -> Intrinsics:
    """Make Intrinsics of whatever describes a pinhole camera.

    Parameters
    ----------
    camera : Intrinsics, (4,) or (3, 3) array_like, mapping or object
        The camera in one of the conventions that `edgel.from_depth` lists.

    Raises
    ------
    TypeError, ValueError
        If there is no camera in it, or several, or one with lens distortion or skew.

    Examples
    --------
    >>> as_intrinsics({"fx": 600, "fy": 600, "ppx": 320, "ppy": 240, "coeffs": [0, 0, 0, 0, 0]}).cx
    320.0
    """
    if isinstance(camera, Intrinsics):
        return camera
    if isinstance(camera, str | bytes | os.PathLike):
        raise TypeError("intrinsics: expected a camera, got a path or text; read it by edgel.io.read_intrinsics(path)")
    if isinstance(camera, list | tuple) or hasattr(camera, "__array__"):
        numbers = _array(camera, "intrinsics")
        fx, fy, cx, cy = numbers if numbers.shape == (4,) else _matrix(numbers, "intrinsics")
        return Intrinsics(fx, fy, cx, cy)
    if isinstance(camera, Mapping):
        return _of_entries({str(key).lstrip("_"): value for key, value in camera.items()})
    entries = {name: getattr(camera, name) for name in _ATTRIBUTES if hasattr(camera, name)}
    if not entries:
        raise TypeError(f"intrinsics: {type(camera).__name__} is no known camera; {ACCEPTED}")
    return _of_entries(entries)


def _of_entries(entries: dict[str, Any]) -> Intrinsics:
    if isinstance(entries.get(_NESTED), Mapping) or hasattr(entries.get(_NESTED), "intrinsic_matrix"):
        return as_intrinsics(entries[_NESTED])
    if entries and all(isinstance(value, Mapping) and "cam_K" in value for value in entries.values()):
        return _of_images(entries)
    for name in _DISTORTION:
        if entries.get(name) is not None and np.any(_array(entries[name], name)):
            raise ValueError(
                f"intrinsics: the camera has lens distortion ({name}: {entries[name]!r:.80}); undistort the depth "
                "image first, and pass the camera of what comes out, without distortion (of an image that ROS has "
                "rectified: np.reshape(info.p, (3, 4))[:, :3])"
            )
    width, height = (_first(entries, names)[1] or None for names in _SIZE)
    return Intrinsics(*_pinhole(entries), _depth_scale(entries), width, height)


def _of_images(entries: dict[str, Any]) -> Intrinsics:
    """Return the camera that all images of a BOP scene share."""
    cameras = {as_intrinsics(entry) for entry in entries.values()}
    if len(cameras) > 1:
        raise ValueError(
            f"intrinsics: the cameras of {len(entries)} images, which differ; pass the entry of this image alone, such "
            f"as cameras[{next(iter(entries))!r:.20}]"
        )
    return cameras.pop()


def _pinhole(entries: dict[str, Any]) -> tuple[Any, Any, Any, Any]:
    """Find fx, fy, cx, cy among the entries of a camera."""
    if entries.get("fx") is not None:
        found = [_first(entries, names) for names in (("fx",), ("fy",), *_CENTRE)]
        missing = [name for name, value in found if value is None]
        if missing:
            raise ValueError(f"intrinsics: {', '.join(missing)} of the camera not given; fx, fy, cx and cy are needed")
        _refuse_skew(entries.get("skew"))
        fx, fy, cx, cy = (value for _, value in found)
        return fx, fy, cx, cy
    name, matrix = _first(entries, _MATRICES)
    if matrix is None:
        keys = ", ".join(entries) or "nothing"
        raise ValueError(f"intrinsics: no known camera among {keys:.80}; {ACCEPTED}")
    # ROS: K is the camera of the raw image, P that of the rectified one, which depth belongs to; zeros where unknown.
    projection = _first(entries, _PROJECTIONS)[1]
    if name != "cam_K" and projection is not None:
        values = _array(projection, "P")
        if values.size == 12 and values.any():
            return _matrix(values.reshape(3, 4)[:, :3], "P")
    return _matrix(_array(matrix, name), name)


def _depth_scale(entries: dict[str, Any]) -> Any:
    scale = entries.get("depth_scale")
    if scale is None or not _number(scale) > 0:  # what is not above 0 is refused by Intrinsics
        return scale
    if "cam_K" in entries:  # BOP: millimetres in one count
        return _number(scale) / 1000
    if "depth_format" in entries:  # recordings of Open3D: counts in one metre
        return 1 / _number(scale)
    return scale


def _matrix(values: np.ndarray, name: str) -> tuple[float, float, float, float]:
    if values.shape not in ((9,), (3, 3)):
        raise ValueError(f"{name}: no camera matrix of shape {values.shape}; 3 x 3 or nine numbers are needed")
    k = values.reshape(3, 3)
    k = k.T if k[2, 0] or k[2, 1] else k  # column by column: the principal point lies in the last row
    if k[1, 0] or k[2].tolist() != [0, 0, 1]:
        raise ValueError(f"{name}: {k.tolist()} is no camera matrix; [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] is one")
    _refuse_skew(k[0, 1])
    return k[0, 0], k[1, 1], k[0, 2], k[1, 2]


def _refuse_skew(skew: Any) -> None:
    if skew is not None and _number(skew) != 0:
        raise ValueError(f"intrinsics: the camera has skew {skew!r:.40}; undistort the image to a camera without")


def _first(entries: dict[str, Any], names: tuple[str, ...]) -> tuple[str, Any]:
    """Return the first of the names that has an entry, and the entry; the first name and None if there is none."""
    return next(((name, entries[name]) for name in names if entries.get(name) is not None), (names[0], None))


def _array(values: Any, name: str) -> np.ndarray:
    """Make an array of floats; OpenCV and ROS write them under "data"."""
    try:
        return np.asarray(values["data"] if isinstance(values, Mapping) else values, np.float64)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(f"{name}: expected numbers of a camera, got {values!r:.80}; {ACCEPTED}") from None


def _number(value: Any) -> float:
    """Return a number as float, NaN where it is none."""
    if isinstance(value, bool | str | bytes):
        return math.nan
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
