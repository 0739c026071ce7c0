"""What a file keeps of a cloud: read back and compared, and asked before the input itself is replaced."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from edgel._cli import files
from edgel._cli.errors import ExitCode, Failure, failing_as
from edgel._cli.output import count, length
from edgel.cloud import Cloud
from edgel.io.columns import as_table


def read_back(output: str, cloud: Cloud) -> Cloud:
    """Return what a reader finds in the file just written; what went into a pipe is gone, and made once more."""
    return files.read_cloud(output) if os.path.isfile(output) else read_copy(output, cloud)


def read_copy(output: str, cloud: Cloud) -> Cloud:
    """Return what a reader would find in an output, from a copy written elsewhere."""
    from edgel import io

    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / ("stdout.ply" if output == files.PIPE else Path(output).name)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", io.FormatWarning)  # the comparison tells the same
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
            lost.append(f"{name}: left out")
    if lost:
        what = "; ".join(lost)
        raise Failure(
            ExitCode.OUTPUT, f"{output}: is the input itself, and would hold less than now ({what}); name another file"
        )


def differences(cloud: Cloud, kept: Cloud) -> list[str]:
    """Say what of a cloud, and of the file it was read from, its copy has not kept, one sentence each.

    Examples
    --------
    >>> import numpy as np
    >>> cloud = Cloud(np.eye(3), {"label": np.array([1, 2, 3])})
    >>> differences(cloud, Cloud(np.eye(3)))
    ['label: left out']
    """
    lost = []
    if len(kept) != len(cloud):
        return [f"points: {count(len(kept))} of {count(len(cloud))}"]
    with np.errstate(invalid="ignore"):
        close = np.abs(kept.xyz - cloud.xyz) <= 4 * np.spacing(np.abs(cloud.xyz))  # decimals of a LAS grid, as doubles
    same = np.isnan(kept.xyz) & np.isnan(cloud.xyz) | (kept.xyz == cloud.xyz) | close
    if not same.all():
        shift = np.abs(kept.xyz - cloud.xyz)[~same].max()
        lost.append(f"coordinates: rounded, by {length(float(shift))} at most" if np.isfinite(shift) else "coordinates")
    for name, values in cloud.attributes.items():
        lost += _attribute(name, values, kept, cloud.attributes)
    for name in ("shape", "viewpoint", "crs"):
        if getattr(cloud, name) is not None and getattr(kept, name) is None:
            lost.append({"shape": "organized rows and columns"}.get(name, name) + ": left out")
    left_out = [*cloud.metadata.get("left_out", ()), *_extended_records(cloud, kept)]
    return lost + [f"{what}: left out" for what in left_out]


def _extended_records(cloud: Cloud, kept: Cloud) -> list[str]:
    """Name the extended records (EVLR) of a LAS file that a copy has not, but for COPC's, which order its points."""
    found, copies = (
        [(evlr.user_id, evlr.record_id) for evlr in getattr(c.metadata.get("las_header"), "evlrs", None) or ()]
        for c in (cloud, kept)
    )
    return [f"extended record (EVLR) {user} {number}" for user, number in found if (user, number) not in copies]


def _attribute(name: str, values: np.ndarray, kept: Cloud, names: Collection[str]) -> list[str]:
    """Say what of an attribute a copy has not kept; `names` are those of all attributes of the original."""
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
        return [f"{name}: left out" if other is None else f"{name}: renamed {other}"]
    copy = np.column_stack([as_table(part) for part in parts])
    if copy.shape != columns.shape or not _same_column(copy, columns):
        return [f"{name}: values changed"]
    if len(parts) > 1:
        return [f"{name}: split into {name}_0 to {name}_{len(parts) - 1}"]
    return []


def _same_column(copy: np.ndarray, values: np.ndarray) -> bool:
    return np.array_equal(copy, values, equal_nan=values.dtype.kind == "f" and copy.dtype.kind == "f")


def _same(value: Any, other: Any) -> bool:
    """Whether a copy has the same metadata; what has no equality of its own, as LAS headers, is compared by type."""
    if isinstance(value, np.ndarray):
        return np.array_equal(value, other)
    return value == other if isinstance(value, str | int | float | tuple) else type(value) is type(other)
