"""Organized scans among the inputs: no points of the larger cloud, but each a view of its own, from its own sensor."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel._detect import detect
from edgel._faces import Faces
from edgel.cloud import check_points
from edgel.edges import EdgeKind
from edgel.io import read
from edgel.io.scans import Scan, organized_scans
from edgel.tiled.plan import Plan
from edgel.tiled.spool import Part

_FEWEST = 3  # points that a scan needs to have any edge


def no_edges() -> dict[str, np.ndarray]:
    """Return what is told of edge points, of none."""
    none = Faces.of_points(np.zeros((0, 3)), np.zeros((0, 3)))
    return {"kind": np.zeros(0, np.uint8), "strength": np.zeros(0), **vars(none)}


def see_scans(plan: Plan, number: int) -> None:
    """Find the edge points of all scans of a file, those again that are not yet found."""
    step = _step(number)
    missing = [k for k in range(plan.spool.parts[number].num_scans) if not plan.result(step, k).exists()]
    if missing:
        scans = organized_scans(read(plan.spool.parts[number].path))
        for k in missing:
            plan.keep(step, k, lambda scan=scans[k]: _seen(plan, scan))


def _step(number: int) -> str:
    return f"scans of {number:06d}"


def _seen(plan: Plan, scan: Scan) -> dict[str, Any]:
    finite, options = check_points(scan.cloud, minimum=0), plan.options
    if len(finite.xyz) < _FEWEST:
        return {"row": np.zeros(0, np.int64), **no_edges(), "orientation": "", "points": len(finite.xyz)}
    edges = detect(
        scan.cloud,
        kinds=EdgeKind(options.kinds),
        min_strength=options.min_strength,
        num_neighbors=options.num_neighbors,
        orient="outward" if options.orient == "outward" else "auto",
    )
    columns = {name: getattr(edges, name) for name in no_edges()}
    return {"row": scan.rows[edges.index], **columns, "orientation": edges.orientation, "points": len(finite.xyz)}


def load_scans(plan: Plan, part: Part) -> list[Any]:
    """Open what was found of the scans of a file."""
    return [plan.load(_step(part.number), k) for k in range(part.num_scans)]
