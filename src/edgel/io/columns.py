"""Between attributes of a cloud and the named columns of a file."""

from __future__ import annotations

import math
import re

import numpy as np

from edgel.cloud import Cloud
from edgel.io.errors import FormatError

COLORS = ["red", "green", "blue"]


def flat_attributes(cloud: Cloud, path: object, *, keep_arrays: bool = False) -> dict[str, np.ndarray]:
    """Return the attributes as columns that a file of named columns can hold.

    Parameters
    ----------
    cloud : Cloud
    path : object
        Named in errors.
    keep_arrays : bool
        Leave (N, C) attributes whole, for formats whose columns may have several values.

    Returns
    -------
    dict of str to (N,) array
        (N, C) attributes become ``name_0 .. name_{C-1}``, white space in names becomes ``_``.

    Raises
    ------
    FormatError
        If an attribute is not numeric, or two columns would get one name.
    """
    columns: dict[str, np.ndarray] = {}
    for name, values in cloud.attributes.items():
        if values.dtype.kind not in "biuf":
            raise FormatError(
                f"{path}: attribute {name!r} holds {values.dtype}, not numbers; leave it out or convert it"
            )
        word = re.sub(r"\s+", "_", name.strip()) or "_"
        parts = {word: values}
        if values.ndim > 1:
            table = as_table(values)
            whole = keep_arrays and table.shape[1]  # no column at all has nowhere to go
            parts = {word: table} if whole else {f"{word}_{i}": table[:, i] for i in range(table.shape[1])}
        for part, column in parts.items():
            if part in columns or part.lower() in ("x", "y", "z"):
                raise FormatError(f"{path}: two columns would be called {part!r}; rename attribute {name!r}")
            columns[part] = column
    return columns


def as_table(values: np.ndarray) -> np.ndarray:
    """Return an attribute (N, ...) as (N, C), of no points too."""
    return values.reshape(len(values), math.prod(values.shape[1:]))


def fits_float32(xyz: np.ndarray) -> bool:
    """Whether every coordinate keeps its exact value as float32."""
    with np.errstate(over="ignore"):
        # In slices: the first that does not fit ends it, and nothing of the cloud's size is allocated.
        for start in range(0, len(xyz), 65536):
            part = xyz[start : start + 65536]
            if not np.array_equal(part, part.astype(np.float32), equal_nan=True):
                return False
    return True


def one_line(text: object) -> str:
    """Return a text with every run of white space as one blank, to go into a line of a header."""
    return " ".join(str(text).split())
