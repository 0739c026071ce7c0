"""Line elements (OBJ, PLY) and the table of measures (CSV)."""

from __future__ import annotations

import csv
import io
import os

import numpy as np

from edgel.curves._curves import Curves
from edgel.curves._measures import measures
from edgel.io.files import replacing


def write_obj(path: str | os.PathLike[str], curves: Curves) -> None:
    """Write vertices and one ``l`` a curve."""
    lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in curves.vertices.tolist()]
    for curve in range(len(curves)):
        numbers = range(int(curves.start[curve]) + 1, int(curves.start[curve + 1]) + 1)
        lines.append("l " + " ".join(map(str, numbers)))
    with replacing(path) as file:
        file.write(("\n".join(lines) + "\n").encode())


def write_ply(path: str | os.PathLike[str], curves: Curves) -> None:
    """Write vertices (double) and edges (vertex1, vertex2, and the number of the curve), binary."""
    first = np.arange(len(curves.vertices))
    inner = np.ones(len(first), bool)
    inner[curves.start[1:] - 1] = False
    first = first[inner]
    edges = np.empty(len(first), [("vertex1", "<i4"), ("vertex2", "<i4"), ("curve", "<i4")])
    edges["vertex1"], edges["vertex2"] = first, first + 1
    edges["curve"] = np.searchsorted(curves.start, first, side="right") - 1
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(curves.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element edge {len(edges)}\nproperty int vertex1\nproperty int vertex2\nproperty int curve\nend_header\n"
    )
    with replacing(path) as file:
        file.write(header.encode() + curves.vertices.astype("<f8").tobytes() + edges.tobytes())


def write_csv(path: str | os.PathLike[str], curves: Curves) -> None:
    """Write the table of `measures`; cells are empty where it has NaN."""
    table = measures(curves)
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(table)
    for row in zip(*(values.tolist() for values in table.values()), strict=True):
        rows.writerow("" if isinstance(value, float) and value != value else value for value in row)
    with replacing(path) as file:
        file.write(text.getvalue().encode())
