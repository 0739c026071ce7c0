"""``edgel convert``: from any format to any other."""

from __future__ import annotations

from io import BytesIO
from typing import Annotated

import numpy as np
import typer

from edgel._cli import files, options
from edgel._cli.errors import exit_codes
from edgel._cli.output import count, length, print_line
from edgel._cli.progress import Watch
from edgel.cloud import Cloud
from edgel.io.columns import as_table

HELP = """Convert a cloud from any format to any other, with all it carries.

What the other format has no place for is said: the file is read back and compared.

\b
Examples:
  edgel convert scan.e57 scan.ply
  edgel convert scan.las scan.pcd
  edgel convert depth.png cloud.ply --intrinsics camera.json
  edgel convert scan.pcd - | edgel detect - -o edges.ply
"""


def convert(
    source: options.Input,
    output: Annotated[str, typer.Argument(metavar="OUT", help="The cloud to write; - writes PLY to stdout.")],
    intrinsics: options.Intrinsics = None,
    check: Annotated[bool, typer.Option("--check/--no-check", help="Read the file back and compare.")] = True,
    debug: options.Debug = False,
) -> None:
    """Convert a cloud from any format to any other."""
    with exit_codes(debug=debug):
        files.check_output(output)
        files.check_input(source, intrinsics)
        with Watch() as watch:
            watch("reading")
            cloud = files.read_cloud(source, intrinsics)
            watch("writing")
            files.write_cloud(output, cloud)
            lost: list[str] = []
            if check:
                watch("comparing")
                lost = differences(cloud, read_back(output, cloud))
        if lost:
            print_line(f"{output}: the format could not keep all", style="yellow")
        for line in lost:
            print_line(f"  {line}")
        names = ", ".join(("x y z", *cloud.attributes))
        print_line(f"{'stdout' if output == files.PIPE else output}: {count(len(cloud))} points ({names})")


def read_back(output: str, cloud: Cloud) -> Cloud:
    """Return what a reader finds in the file just written."""
    if output != files.PIPE:
        return files.read_cloud(output)
    from edgel import io

    stream = BytesIO()  # what went into the pipe is gone: make it once more
    io.write(stream, cloud)
    return io.read(BytesIO(stream.getvalue()))


def differences(cloud: Cloud, kept: Cloud) -> list[str]:
    """Say what of a cloud its copy has not kept, one sentence each.

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
    same = np.isnan(kept.xyz) & np.isnan(cloud.xyz) | (kept.xyz == cloud.xyz)
    if not same.all():
        shift = np.abs(kept.xyz - cloud.xyz)[~same].max()
        lost.append(f"coordinates: rounded, by {length(float(shift))} at most" if np.isfinite(shift) else "coordinates")
    for name, values in cloud.attributes.items():
        lost += _attribute(name, values, kept)
    for name in ("shape", "viewpoint", "crs"):
        if getattr(cloud, name) is not None and getattr(kept, name) is None:
            lost.append({"shape": "organized rows and columns"}.get(name, name) + ": left out")
    return lost


def _attribute(name: str, values: np.ndarray, kept: Cloud) -> list[str]:
    columns = as_table(values)
    if name in kept.attributes:
        parts = [kept.attributes[name]]
    elif values.ndim > 1 and all(f"{name}_{i}" in kept.attributes for i in range(columns.shape[1])):
        parts = [kept.attributes[f"{name}_{i}"] for i in range(columns.shape[1])]
    elif f"{name}_exact" in kept.attributes:
        parts = [kept.attributes[f"{name}_exact"]]
    else:
        return [f"{name}: left out"]
    copy = np.column_stack([as_table(part) for part in parts])
    numbers = values.dtype.kind == "f" and copy.dtype.kind == "f"
    if copy.shape != columns.shape or not np.array_equal(copy, columns, equal_nan=numbers):
        return [f"{name}: values changed"]
    if len(parts) > 1:
        return [f"{name}: split into {name}_0 to {name}_{len(parts) - 1}"]
    return []
