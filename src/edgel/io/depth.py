"""Depth images (16-bit PNG or TIFF, float TIFF, .npy) and the camera that took them."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from edgel.cloud import Cloud
from edgel.io.arrays import read_array
from edgel.io.errors import FormatError
from edgel.io.files import reading
from edgel.io.picture import read_picture

# A file of intrinsics is some hundred bytes long.
_LONGEST_JSON = 1 << 20


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
        for name in ("fx", "fy", "cx", "cy", "depth_scale"):
            value = getattr(self, name)
            if value is None and name == "depth_scale":
                continue
            if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not math.isfinite(value):
                raise ValueError(f"{name}: expected a finite number, got {value!r}")
            if name not in ("cx", "cy") and value <= 0:
                raise ValueError(f"{name}: expected a number above 0, got {value!r}")


def read_intrinsics(path: str | os.PathLike[str]) -> Intrinsics:
    """Read camera intrinsics from a JSON file.

    Understood are ``fx fy cx cy`` (also with a leading underscore, as the perception library's .intr files have them),
    a 3 x 3 ``camera_matrix``, ``K`` or ``intrinsic_matrix`` of rows or of nine numbers (Open3D's, column by column),
    and beside them ``width``, ``height`` and ``depth_scale``.

    Raises
    ------
    FormatError
        If the file is no JSON, or no camera is in it, or the camera has skew.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "camera.intr")
    ...     _ = file.write_text('{"_fx": 1122.0, "_fy": 1122.0, "_cx": 511.5, "_cy": 384.0}')
    ...     read_intrinsics(file).fx
    1122.0
    """
    name = os.fspath(path)
    with reading(path) as file:
        raw = file.read(_LONGEST_JSON + 1)
    try:
        if len(raw) > _LONGEST_JSON:
            raise ValueError(f"it is longer than {_LONGEST_JSON} bytes")
        entries = json.loads(raw)
    except (ValueError, RecursionError) as error:
        raise FormatError(
            f"{name}: not a JSON file of camera intrinsics ({error}); fx, fy, cx and cy are needed"
        ) from None
    if not isinstance(entries, dict):
        raise FormatError(
            f"{name}: holds {type(entries).__name__}, not camera intrinsics; fx, fy, cx and cy are needed"
        )
    # Open3D nests the camera of a recording one level down.
    nested = entries.get("intrinsic")
    camera = {key.lstrip("_"): value for key, value in (nested if isinstance(nested, dict) else entries).items()}
    try:
        fx, fy, cx, cy, skew = _camera(camera)
        if skew:
            raise FormatError(f"{name}: the camera has skew {skew}; undistort the image to a camera without")
        size = [int(camera[key]) if camera.get(key) is not None else None for key in ("width", "height")]
        return Intrinsics(fx, fy, cx, cy, camera.get("depth_scale"), size[0], size[1])
    except FormatError:
        raise
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise FormatError(
            f"{name}: no usable camera intrinsics in it ({error}); fx, fy, cx and cy are needed"
        ) from None


def _camera(camera: dict[str, Any]) -> tuple[float, float, float, float, float]:
    if "fx" in camera:
        fx, fy, cx, cy = (float(camera[key]) for key in ("fx", "fy", "cx", "cy"))
        return fx, fy, cx, cy, float(camera.get("skew") or 0)
    for key in ("camera_matrix", "K", "intrinsic_matrix"):
        if key in camera:
            matrix = (
                camera[key]["data"] if isinstance(camera[key], dict) else camera[key]
            )  # OpenCV and ROS: under "data"
            flat = np.asarray(matrix, np.float64)
            if flat.shape not in ((9,), (3, 3)):
                raise ValueError(f"{key} has shape {flat.shape}")
            k = flat.reshape(3, 3)
            k = k.T if k[2, 0] or k[2, 1] else k  # column by column: the principal point lies in the last row
            return k[0, 0], k[1, 1], k[0, 2], k[1, 2], k[0, 1]
    raise KeyError("neither fx nor camera_matrix, K or intrinsic_matrix")


def read(path: str | os.PathLike[str], *, intrinsics: Intrinsics | str | os.PathLike[str] | None = None) -> Cloud:
    """Read a depth image as an organized cloud in the camera's frame: x right, y down, z forward.

    Parameters
    ----------
    path : path
        PNG or TIFF of one 16-bit, 32-bit or float channel, or .npy (H, W).
    intrinsics : Intrinsics or path, optional
        The camera, or the JSON file that holds it (see `read_intrinsics`). Without it the one ``*.intr`` or
        ``intrinsics.json`` in the image's folder is used, if there is exactly one.

    Returns
    -------
    Cloud
        (H, W); pixels that are not above 0 are NaN. The viewpoint is (0, 0, 0).

    Raises
    ------
    FormatError
        If the file is not a depth image, or no intrinsics are given or found, or they belong to another size.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/depth.npy", np.full((4, 20), 2.0))
    ...     cloud = read(f"{folder}/depth.npy", intrinsics=Intrinsics(fx=10, fy=10, cx=0, cy=0))
    >>> cloud.shape, cloud.xyz[1]
    ((4, 20), array([0.2, 0. , 2. ]))
    """
    name = os.fspath(path)
    image = _read_image(name)
    camera = _find_intrinsics(name) if intrinsics is None else intrinsics
    if not isinstance(camera, Intrinsics):
        camera = read_intrinsics(camera)
    height, width = image.shape
    if camera.width not in (None, width) or camera.height not in (None, height):
        raise FormatError(
            f"{name}: the image is {width} x {height}, the intrinsics are for {camera.width} x {camera.height}; "
            "pass those of this image"
        )
    scale = camera.depth_scale or (1.0 if image.dtype.kind == "f" else 0.001)
    rows, cols = np.arange(height)[:, None], np.arange(width)
    xyz = np.empty((height, width, 3))
    with np.errstate(over="ignore", invalid="ignore"):  # an absurd depth becomes infinite: a point that is not there
        z = image * np.float64(scale)
        z[~(np.isfinite(z) & (z > 0))] = np.nan
        xyz[..., 2] = z
        np.multiply((cols - camera.cx) / camera.fx, z, out=xyz[..., 0])
        np.multiply((rows - camera.cy) / camera.fy, z, out=xyz[..., 1])
    return Cloud(xyz, viewpoint=np.zeros(3))


def _read_image(path: str) -> np.ndarray:
    if path.lower().endswith(".npy"):
        with reading(path) as file:
            image = read_array(path, file, os.fstat(file.fileno()).st_size)
    else:
        image = read_picture(path)
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[:, :, 0]
    if image.ndim != 2 or image.dtype.kind not in "iuf" or not image.size:
        raise FormatError(f"{path}: {image.dtype} of shape {image.shape} is no depth image; (H, W) numbers are needed")
    return image


def _find_intrinsics(path: str) -> Path:
    folder = Path(path).parent
    found = sorted({*folder.glob("*.intr"), *folder.glob("intrinsics.json")})
    if len(found) == 1:
        return found[0]
    beside = f"{len(found)} intrinsics files lie beside it" if found else "no .intr file lies beside it"
    raise FormatError(
        f"{path}: a depth image needs its camera, and {beside}; "
        "pass intrinsics=Intrinsics(fx=, fy=, cx=, cy=) or the path of a JSON file"
    )
