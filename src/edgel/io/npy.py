"""NumPy's .npy and .npz, never with pickled objects."""

from __future__ import annotations

import os
import zipfile
from typing import IO

import numpy as np

from edgel.cloud import Cloud, as_cloud
from edgel.io import depth
from edgel.io.arrays import read_array
from edgel.io.columns import free_name
from edgel.io.errors import FormatError, tell
from edgel.io.files import reading, replacing, wrong_magic
from edgel.io.limits import check_unpacked

# A 2-D array of more columns than this is an image, not a table of points.
_MAX_COLUMNS = 16
# Deflate packs at most 1032 bytes into one.
_MAX_ZIP_RATIO = 1032
_KEYS = ("xyz", "points")
# Keys of our own, and names of arguments of `numpy.savez`.
_RESERVED = (*_KEYS, "shape", "viewpoint", "crs", "file", "allow_pickle")


def read_npy(path: str | os.PathLike[str]) -> Cloud:
    """Read points from a .npy file.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        From (N, 3); (N, 4..16), where the further columns become ``column_3`` onwards; (H, W, 3), organized; (N,) or
        (H, W) records with fields x, y, z; or a wider (H, W), a depth image (see `edgel.io.depth.read`).

    Raises
    ------
    FormatError
        If the file is not .npy, is cut off, or holds something else.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/a.npy", np.zeros((4, 5, 3)))
    ...     read_npy(f"{folder}/a.npy")
    Cloud(20 points, organized 4 x 5; attributes: none)
    """
    name = os.fspath(path)
    with reading(path) as file:
        size = os.fstat(file.fileno()).st_size
        array = read_array(name, file, size)
    if array.dtype.names is None and array.shape[1:2] > (_MAX_COLUMNS,) and array.shape[2:] in ((), (1,)):
        return depth.read(path)
    return _cloud_of(name, array)


def _cloud_of(path: str, array: np.ndarray) -> Cloud:
    if array.dtype.names:
        try:
            return as_cloud(array)
        except (TypeError, ValueError) as error:
            raise FormatError(f"{path}: {str(error).removeprefix('points: ')}") from None
    if array.ndim == 3 and array.shape[2] == 3:
        return Cloud(_numbers(path, array))
    if array.ndim == 2 and 3 <= array.shape[1] <= _MAX_COLUMNS:
        columns = {f"column_{i}": np.ascontiguousarray(array[:, i]) for i in range(3, array.shape[1])}
        return Cloud(_numbers(path, array[:, :3]), columns)
    raise FormatError(f"{path}: an array of shape {array.shape}; (N, 3), (H, W, 3) or records with x, y, z are needed")


def _numbers(path: str, array: np.ndarray) -> np.ndarray:
    if array.dtype.kind not in "iuf":
        raise FormatError(f"{path}: coordinates of type {array.dtype}; numbers are needed")
    return np.array(array, np.float64, order="C")


def write_npy(path: str | os.PathLike[str], cloud: Cloud) -> None:
    """Write a .npy file: (N, 3) or (H, W, 3) float64, or with attributes records of x, y, z and these.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Warns
    -----
    FormatWarning
        If an attribute is left out because it holds Python objects, or is renamed because it has a coordinate's name.

    Raises
    ------
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_npy(f"{folder}/a.npy", Cloud(np.eye(3), {"label": np.arange(3)}))
    ...     np.load(f"{folder}/a.npy").dtype.names
    ('x', 'y', 'z', 'label')
    """
    array = cloud.xyz
    if cloud.attributes:
        attributes = _attributes(path, cloud, ("x", "y", "z"))
        fields = [(name, values.dtype, values.shape[1:]) for name, values in attributes.items()]
        array = np.empty(len(cloud), np.dtype([("x", "f8"), ("y", "f8"), ("z", "f8"), *fields]))
        for axis, name in enumerate("xyz"):
            array[name] = cloud.xyz[:, axis]
        for name, values in attributes.items():
            array[name] = values
    if cloud.shape is not None:
        array = array.reshape(*cloud.shape, *array.shape[1:])
    with replacing(path) as file:
        np.save(file, array, allow_pickle=False)


def read_npz(path: str | os.PathLike[str]) -> Cloud:
    """Read points from a .npz file.

    Parameters
    ----------
    path : path

    Returns
    -------
    Cloud
        Coordinates from key ``xyz`` or ``points``, (N, 3) or (H, W, 3); ``shape``, ``viewpoint`` and ``crs`` as
        `write_npz` writes them; every other array whose first axis is N (or whose first two are H, W) is an attribute.

    Raises
    ------
    FormatError
        If the file is not .npz, is damaged, or has no coordinates.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.savez(f"{folder}/a.npz", points=np.eye(3), label=np.arange(3))
    ...     read_npz(f"{folder}/a.npz")
    Cloud(3 points, unorganized; attributes: label)
    """
    name = os.fspath(path)
    with reading(path) as file:
        head = file.read(512)
        if not head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
            wrong_magic(name, "a NumPy .npz archive", head)
        arrays = _read_members(name, file)
    key = next((key for key in _KEYS if key in arrays), None)
    if key is None:
        raise FormatError(f"{name}: its arrays are {', '.join(arrays) or 'none'}; one called xyz or points is needed")
    try:
        return _assemble(_cloud_of(name, arrays.pop(key)), arrays)
    except (ValueError, TypeError, OverflowError) as error:
        raise error if isinstance(error, FormatError) else FormatError(f"{name}: {error}") from None


def _read_members(path: str, file: IO[bytes]) -> dict[str, np.ndarray]:
    arrays = {}
    try:
        with zipfile.ZipFile(file) as archive:
            infos = archive.infolist()
            # All members together: they may share their packed bytes.
            check_unpacked(path, sum(info.file_size for info in infos), os.fstat(file.fileno()).st_size)
            for info in infos:
                if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                    raise FormatError(f"{path} [{info.filename}]: packed in a way that NumPy does not; pack it anew")
                if info.filename.endswith(".npy"):
                    size = min(info.file_size, (info.compress_size + 64) * _MAX_ZIP_RATIO)
                    with archive.open(info) as member:
                        arrays[info.filename[:-4]] = read_array(f"{path} [{info.filename}]", member, size)
    except (FormatError, MemoryError):
        raise
    except Exception as error:  # zipfile and zlib have a dozen errors for damage, none of them common to all
        raise FormatError(f"{path}: the .npz archive is damaged ({error}); get the file again") from None
    return arrays


def _assemble(cloud: Cloud, arrays: dict[str, np.ndarray]) -> Cloud:
    shape = cloud.shape
    if "shape" in arrays and arrays["shape"].shape == (2,):
        rows, cols = (int(length) for length in arrays.pop("shape"))
        shape = (rows, cols)
    viewpoint = arrays.pop("viewpoint") if "viewpoint" in arrays and arrays["viewpoint"].shape == (3,) else None
    crs = (
        str(arrays.pop("crs"))
        if "crs" in arrays and arrays["crs"].dtype.kind == "U" and not arrays["crs"].ndim
        else None
    )
    attributes, metadata = dict(cloud.attributes), {}
    for name, values in arrays.items():
        if shape is not None and values.shape[:2] == shape:
            attributes[name] = values.reshape(len(cloud), *values.shape[2:])
        elif values.ndim and len(values) == len(cloud):
            attributes[name] = values
        else:
            metadata[name] = values  # not one value a point: kept, but no attribute
    return Cloud(cloud.xyz, attributes, shape, viewpoint, crs, metadata)


def write_npz(path: str | os.PathLike[str], cloud: Cloud) -> None:
    """Write a .npz file: ``xyz`` (N, 3) float64, attributes by their names, ``shape``, ``viewpoint``, ``crs`` if known.

    Parameters
    ----------
    path : path
    cloud : Cloud

    Warns
    -----
    FormatWarning
        If an attribute is left out because it holds Python objects, or is renamed because its name means something else
        in the file.

    Raises
    ------
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_npz(f"{folder}/a.npz", Cloud(np.zeros((2, 3, 3))))
    ...     read_npz(f"{folder}/a.npz").shape
    (2, 3)
    """
    attributes = _attributes(path, cloud, _RESERVED)
    extra: dict[str, np.ndarray] = {}
    if cloud.shape is not None:
        extra["shape"] = np.array(cloud.shape)
    if cloud.viewpoint is not None:
        extra["viewpoint"] = cloud.viewpoint
    if cloud.crs is not None:
        extra["crs"] = np.array(cloud.crs)
    with replacing(path) as file:
        np.savez(file, allow_pickle=False, xyz=cloud.xyz, **attributes, **extra)


def _attributes(path: object, cloud: Cloud, taken: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Return what NumPy can store without pickling, under names that mean nothing else; warn of the others."""
    said: dict[str, str] = {}
    kept: dict[str, np.ndarray] = {}
    for name, values in cloud.attributes.items():
        if values.dtype.hasobject:
            said[name] = "left out, it holds Python objects; convert it to numbers"
            continue
        word = name.replace("\0", "_") or "_"  # a zip archive cuts names at the NUL
        word = word.encode("utf-8", "replace").decode()  # nor has it surrogates
        new = free_name(word, {*kept, *(other for other in cloud.attributes if other != name)}, taken)
        if new != name:
            said[name] = f"renamed {new}, the name means something else in the file"
        kept[new] = values
    tell(path, said)
    return kept
