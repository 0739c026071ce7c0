"""Between attributes of a cloud and the named columns of a file."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable

import numpy as np

from edgel.cloud import Cloud


def flat_attributes(
    cloud: Cloud,
    said: dict[str, str],
    *,
    keep_arrays: bool = False,
    taken: Collection[str] = ("x", "y", "z"),
    spell: Callable[[str], str] = lambda name: name,
) -> dict[str, np.ndarray]:
    """Return the attributes as columns that a file of named columns can hold.

    Parameters
    ----------
    cloud : Cloud
    said : dict of str to str
        Gets what became of attributes that are left out or renamed.
    keep_arrays : bool
        Leave (N, C) attributes whole, for formats whose columns may have several values.
    taken : collection of str
        Names, lower case, that mean something else in the file.
    spell : function
        How the format spells a name of one word.

    Returns
    -------
    dict of str to (N,) array
        Without what is no number. (N, C) attributes become ``name_0 .. name_{C-1}``, white space and what cannot be
        printed in names becomes ``_``, which is not said; a name that is taken gets ``_2`` and so on.
    """
    columns: dict[str, np.ndarray] = {}
    for name, values in cloud.attributes.items():
        if values.dtype.kind not in "biuf":
            said[name] = f"left out, {values.dtype} is no type of numbers"
            continue
        word = spell(plain_name(name))
        table = as_table(values) if values.ndim > 1 else values
        whole = table.ndim == 1 or (keep_arrays and table.shape[1] > 0)  # no column at all has nowhere to go
        endings = [""] if whole else [f"_{i}" for i in range(table.shape[1])]
        new = free_name(word, columns, taken, endings)
        if new != plain_name(name):
            said[name] = f"renamed {new}" + (f", the name {word} is taken" if new != word else "")
        columns |= {new: table} if whole else {new + ending: table[:, i] for i, ending in enumerate(endings)}
    return columns


def plain_name(name: str) -> str:
    r"""Return a name as one word that can be printed.

    Examples
    --------
    >>> plain_name(" two words "), plain_name("nul\0"), plain_name("")
    ('two_words', 'nul_', '_')
    """
    word = re.sub(r"\s+", "_", name.strip())
    return "".join(c if c.isprintable() else "_" for c in word) or "_"


def free_name(word: str, used: Collection[str], taken: Collection[str], endings: Iterable[str] = ("",)) -> str:
    """Return a name, or the first of ``word_2, word_3 ...`` that is neither used nor, in any case, taken.

    Examples
    --------
    >>> free_name("X", {"X_2"}, {"x"})
    'X_3'
    """
    new, number, endings = word, 2, list(endings)
    while any(new + ending in used or (new + ending).lower() in taken for ending in endings):
        new, number = f"{word}_{number}", number + 1
    return new


def as_table(values: np.ndarray) -> np.ndarray:
    """Return an attribute (N, ...) as (N, C), of no points too."""
    return values.reshape(len(values), math.prod(values.shape[1:]))


def narrowed(values: np.ndarray, codes: Iterable[str]) -> np.ndarray | None:
    """Return the values in the first of some types that holds all of them exactly, None where none does.

    Examples
    --------
    >>> narrowed(np.array([300, -1]), ["u1", "i2", "f4"])
    array([300,  -1], dtype=int16)
    >>> narrowed(np.array([2**53 + 1]), ["f4", "f8"]) is None
    True
    """
    integers = values.dtype.kind in "iu"
    low, high = (int(values.min()), int(values.max())) if integers and len(values) else (0, 0)
    for dtype in map(np.dtype, codes):
        if dtype.kind in "iu":
            fits = values.dtype.kind != "f" and np.iinfo(dtype).min <= low and high <= np.iinfo(dtype).max
        elif integers:
            fits = max(-low, high) <= 2 ** (np.finfo(dtype).nmant + 1)  # every integer up to there
        else:
            with np.errstate(over="ignore", invalid="ignore"):
                fits = np.array_equal(values.astype(dtype), values, equal_nan=values.dtype.kind == "f")
        if fits:
            return values.astype(dtype, copy=False)
    return None


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
