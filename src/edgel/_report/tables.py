"""Tables as plain data: what a report, or a terminal, prints of edges and of the machine."""

from __future__ import annotations

import importlib.metadata
import math
import os
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from edgel._kernels.threads import num_threads
from edgel.edges import Edges
from edgel.paper import PaperEdges


@dataclass(frozen=True, eq=False)
class Table:
    """A table as plain data.

    Attributes
    ----------
    title : str
    rows : sequence of dict
        Plain values by column; all rows have the same columns, in the same order. None prints as a dash.
    formats : mapping of str to str
        Format specification by column (``",d"``, ``".1%"``...), for numbers.
    note : str
        What has to be known to read it.
    """

    title: str
    rows: Sequence[Mapping[str, Any]]
    formats: Mapping[str, str] = field(default_factory=dict)
    note: str = ""

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(self.rows[0]) if self.rows else []

    def text(self) -> list[dict[str, str]]:
        """Return the rows with every value as it is printed.

        Examples
        --------
        >>> Table("Counts", [{"name": "tee", "share": 0.0976}], {"share": ".1%"}).text()
        [{'name': 'tee', 'share': '9.8%'}]
        """
        return [{name: _as_text(value, self.formats.get(name, "")) for name, value in row.items()} for row in self.rows]


def count_table(edges: Edges) -> Table:
    """Counts of the points, of the edge points, and of each kind; a point of two kinds counts in both."""
    rows = [
        {"what": "points", "number": edges.num_points, "share": None},
        {"what": "not finite, left out", "number": edges.num_dropped, "share": None},
        {"what": "edge points", "number": len(edges), "share": edges.share},
    ]
    finite = edges.num_points - edges.num_dropped
    for name, number in edges.count_kinds().items():
        rows.append({"what": f"of kind {name}", "number": number, "share": number / finite})
    rows.append({"what": "edge points without a normal", "number": edges.num_without_normal, "share": None})
    note = "Shares are of the finite points."
    if not math.isnan(edges.median_crease_angle):
        note += f" Half of the creases turn by more than {math.degrees(edges.median_crease_angle):.1f} degrees."
    return Table("Counts", rows, {"number": ",d", "share": ".1%"}, note)


def published_last(edges: Edges, other: Edges) -> list[Edges]:
    """Two answers in the order in which they are compared."""
    return sorted((edges, other), key=lambda one: isinstance(one, PaperEdges))


def method_table(edges: Edges, other: Edges) -> Table:
    """What two methods find in the same cloud, and what of it is the same."""
    rows = []
    for one in published_last(edges, other):
        kinds = ", ".join(f"{name} {number:,}" for name, number in one.count_kinds().items())
        seconds = sum(one.seconds.values())
        rows.append(
            {"method": one.method, "edge points": len(one), "share": one.share, "seconds": seconds, "kinds": kinds}
        )
    both = len(np.intersect1d(edges.index, other.index))
    share = both / (edges.num_points - edges.num_dropped)
    rows.append({"method": "points of both", "edge points": both, "share": share, "seconds": None, "kinds": None})
    note = f"The method {other.method} was run to compare, with its own defaults."
    return Table("Both methods", rows, {"edge points": ",d", "share": ".1%", "seconds": ".2f"}, note)


def time_table(edges: Edges) -> Table:
    """Times by stage, and their sum."""
    rows = [{"stage": stage, "seconds": seconds} for stage, seconds in edges.seconds.items()]
    rows.append({"stage": "all", "seconds": sum(edges.seconds.values())})
    note = "The first run in a new process also loads the kernels, and the very first compiles them."
    return Table("Time by stage", rows, {"seconds": ".3f"}, note)


def parameter_table(edges: Edges) -> Table:
    """Parameters of the method, those it chose itself included."""
    rows = [{"parameter": "method", "value": edges.method}]
    rows += [{"parameter": name, "value": value} for name, value in edges.parameters.items()]
    why = f" Why the method {edges.method}: {edges.reason}." if edges.reason else ""
    return Table("Parameters", rows, {"value": "g"}, f"Lengths are in the cloud's unit.{why}")


def machine_table() -> Table:
    """Versions and the machine the numbers come from."""
    packages = ("edgel", "numpy", "numba")
    rows = [{"what": "processor", "value": _processor()}]
    rows.append({"what": "cores, used of present", "value": f"{num_threads()} of {os.cpu_count() or 'unknown'}"})
    rows.append({"what": "system", "value": f"{platform.system()} {platform.machine()}"})
    rows.append({"what": "Python", "value": platform.python_version()})
    rows += [{"what": name, "value": importlib.metadata.version(name)} for name in packages]
    return Table("Versions and machine", rows)


def _processor() -> str:
    """Name of the processor, where the system tells it."""
    try:
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    return found.group(1).strip() if found else platform.processor() or "unknown"


def _as_text(value: Any, spec: str) -> str:
    if value is None:
        return "\N{EN DASH}"
    if isinstance(value, str | bool) or not hasattr(value, "__format__"):
        return str(value)
    try:
        return format(value, spec)
    except (TypeError, ValueError):  # a parameter that is no number
        return str(value)
