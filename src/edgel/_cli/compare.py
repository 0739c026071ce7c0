"""What a file keeps of a cloud: read back and compared, and asked before the input itself is replaced."""

from __future__ import annotations

import os
import re
import tempfile
import warnings
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from edgel._cli import files
from edgel._cli.errors import ExitCode, Failure, failing_as
from edgel._cli.output import count, length
from edgel.cloud import Cloud
from edgel.io.columns import as_table
from edgel.io.errors import FormatWarning


def read_back(output: str, cloud: Cloud) -> Cloud:
    """Return what a reader finds in the file just written; what went into a pipe is gone, and made once more."""
    return files.read_cloud(output) if os.path.isfile(output) else read_copy(output, cloud)


def read_copy(output: str, cloud: Cloud) -> Cloud:
    """Return what a reader would find in an output, from a copy written elsewhere."""
    from edgel import io

    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / ("stdout.ply" if output == files.PIPE else Path(output).name)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FormatWarning)  # the comparison tells the same
            io.write(copy, cloud)
        return io.read(copy)


def check_kept(output: str, original: Cloud, cloud: Cloud) -> None:
    """Raise a `Failure` if a file that replaces its own input would hold less of it, before it does.

    Parameters
    ----------
    output : str
        The input itself.
    original : Cloud
        As it was read.
    cloud : Cloud
        What shall be written, with every point and attribute of `original`.
    """
    with failing_as(ExitCode.OUTPUT, output):
        kept = read_copy(output, cloud)
    lost = differences(cloud, kept)
    for name, value in original.metadata.items():
        if name not in ("left_out", "notices") and not (name in kept.metadata and _same(value, kept.metadata[name])):
            lost[name] = "left out"
    if lost:
        what = "; ".join(FormatWarning(output, lost).lines())
        raise Failure(
            ExitCode.OUTPUT, f"{output}: is the input itself, and would hold less than now ({what}); name another file"
        )


def told_once(cloud: Cloud, said: Mapping[str, str], found: Mapping[str, str]) -> dict[str, str]:
    """Return what a writer said of a cloud, which knows why, and what the comparison found besides."""
    parts = {re.sub(r"_\d+$", "", name) for name in said if name not in cloud.attributes}  # said column by column
    return {**said, **{name: what for name, what in found.items() if name not in said and name not in parts}}


def differences(cloud: Cloud, kept: Cloud) -> dict[str, str]:
    """Say what of a cloud, and of the file it was read from, its copy has not kept, by its name.

    Examples
    --------
    >>> import numpy as np
    >>> cloud = Cloud(np.eye(3), {"label": np.array([1, 2, 3])})
    >>> differences(cloud, Cloud(np.eye(3)))
    {'label': 'left out'}
    """
    lost: dict[str, str] = {}
    if len(kept) != len(cloud):
        return {"points": f"{count(len(kept))} of {count(len(cloud))}"}
    with np.errstate(invalid="ignore"):
        close = np.abs(kept.xyz - cloud.xyz) <= 4 * np.spacing(np.abs(cloud.xyz))  # decimals of a LAS grid, as doubles
    same = np.isnan(kept.xyz) & np.isnan(cloud.xyz) | (kept.xyz == cloud.xyz) | close
    if not same.all():
        shift = np.abs(kept.xyz - cloud.xyz)[~same].max()
        lost["coordinates"] = f"rounded, by {length(float(shift))} at most" if np.isfinite(shift) else "changed"
    for name, values in cloud.attributes.items():
        what = _attribute(name, values, kept, cloud.attributes)
        lost |= {} if what is None else {name: what}
    for name in ("shape", "viewpoint", "crs"):
        if getattr(cloud, name) is not None and getattr(kept, name) is None:
            lost["organized rows and columns" if name == "shape" else name] = "left out"
    return lost | dict.fromkeys([*cloud.metadata.get("left_out", ()), *_extended_records(cloud, kept)], "left out")


def _extended_records(cloud: Cloud, kept: Cloud) -> list[str]:
    """Name the extended records (EVLR) of a LAS file that a copy has not, but for COPC's, which order its points."""
    found, copies = (
        [(evlr.user_id, evlr.record_id) for evlr in getattr(c.metadata.get("las_header"), "evlrs", None) or ()]
        for c in (cloud, kept)
    )
    return [f"extended record (EVLR) {user} {number}" for user, number in found if (user, number) not in copies]


def _attribute(name: str, values: np.ndarray, kept: Cloud, names: Collection[str]) -> str | None:
    """Say what a copy has not kept of an attribute, None where all; `names` are the original's attributes."""
    columns = as_table(values)
    split = [f"{name}_{i}" for i in range(columns.shape[1] if values.ndim > 1 else 0)]
    if split and not set(split) - set(kept.attributes):
        parts = [kept.attributes[part] for part in split]
    elif name in kept.attributes:
        parts = [kept.attributes[name]]
    elif f"{name}_exact" in kept.attributes:
        parts = [kept.attributes[f"{name}_exact"]]
    else:
        others = (
            other for other in kept.attributes if other not in names and _same_column(kept.attributes[other], values)
        )
        other = next(others, None)
        return "left out" if other is None else f"renamed {other}"
    copy = np.column_stack([as_table(part) for part in parts])
    if copy.shape != columns.shape or not _same_column(copy, columns):
        return "values changed"
    return f"split into {name}_0 to {name}_{len(parts) - 1}" if len(parts) > 1 else None


def _same_column(copy: np.ndarray, values: np.ndarray) -> bool:
    return np.array_equal(copy, values, equal_nan=values.dtype.kind == "f" and copy.dtype.kind == "f")


def _same(value: Any, other: Any) -> bool:
    """Whether a copy has the same metadata; what has no equality of its own, as LAS headers, is compared by type."""
    if isinstance(value, np.ndarray):
        return np.array_equal(value, other)
    return value == other if isinstance(value, str | int | float | tuple) else type(value) is type(other)
