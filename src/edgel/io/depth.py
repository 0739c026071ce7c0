"""Files of depth images (16-bit PNG or TIFF, float TIFF, .npy) and of the cameras that took them."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from edgel._depth import from_depth
from edgel._intrinsics import Intrinsics, as_intrinsics
from edgel.cloud import Cloud
from edgel.io.arrays import read_array
from edgel.io.errors import FormatError
from edgel.io.files import reading
from edgel.io.picture import read_picture
from edgel.io.yaml import read_yaml

# A file of intrinsics is some hundred bytes long.
_LONGEST_JSON = 1 << 20
_CAMERAS_OF_BOP = "scene_camera.json"
_CAMERAS = ("intrinsics.json", "camera_info.yaml", _CAMERAS_OF_BOP)


def read_intrinsics(path: str | os.PathLike[str], *, image: str | os.PathLike[str] | None = None) -> Intrinsics:
    """Read camera intrinsics from a JSON or YAML file.

    Understood are ``fx fy cx cy`` (also with a leading underscore, as the perception library's .intr files have them),
    a 3 x 3 ``camera_matrix``, ``K`` or ``intrinsic_matrix`` of rows or of nine numbers (Open3D's, column by column),
    beside them ``width``, ``height`` and ``depth_scale``, and whatever else `edgel.from_depth` takes for a camera; the
    YAML of ROS (``camera_info``) and of OpenCV.

    Parameters
    ----------
    path : path
    image : path, optional
        The depth image: of the cameras of a BOP scene that of its number is taken (``000012.png``: ``"12"``).

    Raises
    ------
    FormatError
        If the file is neither JSON nor YAML, or there is no camera in it, or several, or one with lens distortion or
        skew.

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
        entries = read_yaml(raw) if name.lower().endswith((".yaml", ".yml")) else json.loads(raw)
    except (ValueError, RecursionError) as error:
        raise FormatError(
            f"{name}: not a JSON or YAML file of camera intrinsics ({error}); fx, fy, cx and cy are needed"
        ) from None
    if not isinstance(entries, dict | list):
        raise FormatError(
            f"{name}: holds {type(entries).__name__}, not camera intrinsics; fx, fy, cx and cy are needed"
        )
    number = "" if image is None else Path(image).stem.lstrip("0") or "0"
    if isinstance(entries, dict) and isinstance(entries.get(number), dict) and "cam_K" in entries[number]:
        entries = entries[number]
    try:
        return as_intrinsics(entries)
    except (TypeError, ValueError, RecursionError) as error:
        raise FormatError(f"{name}: {str(error).removeprefix('intrinsics: ')}") from None


def read(path: str | os.PathLike[str], *, intrinsics: Any = None) -> Cloud:
    """Read a depth image as an organized cloud in the camera's frame: x right, y down, z forward.

    Parameters
    ----------
    path : path
        PNG or TIFF of one 16-bit, 32-bit or float channel, or .npy (H, W).
    intrinsics : Intrinsics, path, or another camera, optional
        The camera (see `edgel.from_depth`), or the file that holds it (see `read_intrinsics`). Without it the one
        ``*.intr``, ``intrinsics.json``, ``camera_info.yaml`` or ``scene_camera.json`` beside the image is used (that of
        BOP also above its folder), if there is exactly one.

    Returns
    -------
    Cloud
        (H, W); pixels that are not above 0 are NaN. The viewpoint is (0, 0, 0). ``metadata["notices"]`` says which
        camera was used where none was given.

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
    found = _find_intrinsics(name) if intrinsics is None else intrinsics
    is_file = isinstance(found, str | os.PathLike)
    camera = read_intrinsics(found, image=path) if is_file else as_intrinsics(found)
    try:
        cloud = from_depth(image, camera)
    except ValueError as error:  # of another size than the camera's
        raise FormatError(f"{name}: {error}") from None
    if intrinsics is not None:
        return cloud
    scale = "" if camera.depth_scale is None else f", depth_scale {camera.depth_scale:g}"
    said = f"its camera is {found}: fx {camera.fx:g}, fy {camera.fy:g}, cx {camera.cx:g}, cy {camera.cy:g}{scale}"
    return replace(cloud, metadata={"notices": (said,)})


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
    found = {*folder.glob("*.intr"), *(folder / name for name in _CAMERAS), folder.parent / _CAMERAS_OF_BOP}
    files = sorted(file for file in found if file.is_file())
    if len(files) == 1:
        return files[0]
    beside = f"{len(files)} files of cameras lie beside it" if files else "no .intr file lies beside it"
    raise FormatError(
        f"{path}: a depth image needs its camera, and {beside}; "
        "pass intrinsics=Intrinsics(fx=, fy=, cx=, cy=) or the path of a JSON or YAML file"
    )
