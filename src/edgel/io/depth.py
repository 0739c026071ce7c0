"""Files of depth images (16-bit PNG or TIFF, float TIFF, .npy) and of the cameras that took them."""

from __future__ import annotations

import json
import os
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

# A file of intrinsics is some hundred bytes long.
_LONGEST_JSON = 1 << 20


def read_intrinsics(path: str | os.PathLike[str]) -> Intrinsics:
    """Read camera intrinsics from a JSON file.

    Understood are ``fx fy cx cy`` (also with a leading underscore, as the perception library's .intr files have them),
    a 3 x 3 ``camera_matrix``, ``K`` or ``intrinsic_matrix`` of rows or of nine numbers (Open3D's, column by column),
    beside them ``width``, ``height`` and ``depth_scale``, and whatever else `edgel.from_depth` takes for a camera.

    Raises
    ------
    FormatError
        If the file is no JSON, or there is no camera in it, or several, or one with lens distortion or skew.

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
    if not isinstance(entries, dict | list):
        raise FormatError(
            f"{name}: holds {type(entries).__name__}, not camera intrinsics; fx, fy, cx and cy are needed"
        )
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
        The camera (see `edgel.from_depth`), or the JSON file that holds it (see `read_intrinsics`). Without it the one
        ``*.intr`` or ``intrinsics.json`` in the image's folder is used, if there is exactly one.

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
    camera = read_intrinsics(camera) if isinstance(camera, str | os.PathLike) else as_intrinsics(camera)
    try:
        return from_depth(image, camera)
    except ValueError as error:  # of another size than the camera's
        raise FormatError(f"{name}: {error}") from None


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
