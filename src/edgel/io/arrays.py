"""One .npy array, read with its promises checked first."""

from __future__ import annotations

import math
import sys
import warnings
from typing import IO

import numpy as np
from numpy.lib import format as npy_format

from edgel.io.errors import FormatError
from edgel.io.files import wrong_magic

# A cloud has three axes, what lies beside it in an archive perhaps a few more; NumPy knows 64.
_MOST_AXES = 32


def read_array(path: str, file: IO[bytes], size: int) -> np.ndarray:
    """Read one .npy array of a file or archive member of `size` bytes; FormatError if it is not whole."""
    head = file.read(8)
    if not head.startswith(b"\x93NUMPY"):
        wrong_magic(path, "a NumPy array", head + file.read(512))
    try:
        readers = {1: npy_format.read_array_header_1_0, 2: npy_format.read_array_header_2_0}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # headers that Python 2 wrote, and words that are no Python
            shape, fortran, dtype = readers[min(head[6], 2)](file)
    except Exception as error:  # the header is a Python literal: many errors are possible, all mean a damaged file
        raise FormatError(f"{path}: the .npy header is damaged ({error}); get the file again") from None
    if dtype.hasobject:
        raise FormatError(f"{path}: holds Python objects, which may run code when loaded; save plain numbers")
    if any(length < 0 for length in shape):
        raise FormatError(f"{path}: the .npy header promises an array of shape {shape}; get the file again")
    count = math.prod(shape)  # Python's integers do not overflow
    if count * max(dtype.itemsize, 1) > size or len(shape) > _MOST_AXES or max(shape, default=0) > size:
        raise FormatError(
            f"{path}: declared an array of shape {shape}, the file has {size} bytes; it is cut off: get it again"
        )
    raw = file.read(count * dtype.itemsize)
    if len(raw) < count * dtype.itemsize:
        found = len(raw) // dtype.itemsize
        raise FormatError(f"{path}: declared {count} values, found {found}; the file is cut off: get it again")
    array = np.frombuffer(bytearray(raw), dtype, count) if raw else np.empty(count, dtype)
    _check_texts(path, array)
    return array.reshape(shape, order="F" if fortran else "C")


def _check_texts(path: str, array: np.ndarray) -> None:
    """Refuse characters beyond Unicode, over which Python fails wherever it meets them."""
    for name in array.dtype.names or ():
        _check_texts(path, array[name])
    if array.dtype.kind == "U" and array.dtype.itemsize:
        codes = np.ascontiguousarray(array).view(array.dtype.byteorder.replace("|", "=") + "u4")
        if codes.size and int(codes.max()) > sys.maxunicode:
            raise FormatError(f"{path}: holds texts of characters that do not exist; get the file again")
