"""What ``edgel detect`` says of the edges it found: as a table, and as JSON."""

from __future__ import annotations

import math
import sys
from typing import Any

from edgel._cli.output import count, time_rows
from edgel.edges import EdgeKind, Edges

ORIENTATIONS = {
    "sensor": "normals look towards it",
    "normals": "on the side of those that came with the cloud",
    "outward": "normals look out of what the surface holds",
    "unknown": "normals look upwards; --viewpoint or --orient outward tell the outside",
}
"""What `edgel.Edges.orientation` means."""


def creases(edges: Edges) -> dict[str, Any]:
    """Return the median angle of the creases, in degrees (NaN where none is known), and how many bend which way."""
    convex = edges.convex[(edges.kind & EdgeKind.CREASE) > 0]
    return {
        "median_angle_degrees": math.degrees(edges.median_crease_angle),
        "convex": int((convex > 0).sum()),
        "concave": int((convex < 0).sum()),
    }


def crease_remark(edges: Edges) -> str:
    """Say of the creases what is known of both their faces."""
    known = creases(edges)
    angle = known["median_angle_degrees"]
    words = [] if math.isnan(angle) else [f"median angle {angle:.1f} degrees"]
    return ", ".join(words + [f"{count(known[name])} {name}" for name in ("convex", "concave") if known[name]])


def collect(edges: Edges, not_selected: int, by_stage: dict[str, float]) -> dict[str, Any]:
    """Return what ``--json`` prints of the edges."""
    return {
        "orientation": edges.orientation,
        "method": edges.method,
        "reason": edges.reason,
        "points": edges.num_points,
        "not_selected": not_selected,
        "not_finite": edges.num_dropped - not_selected,
        "edge_points": len(edges),
        "share": edges.share,
        "kinds": edges.count_kinds(),
        "creases": creases(edges),
        "normals_undefined": edges.num_without_normal,
        "parameters": dict(edges.parameters),
        "seconds": by_stage,
        "peak_memory_bytes": peak_memory(),
    }


def headline(edges: Edges) -> str:
    """Say how many edge points there are, in some words."""
    num = edges.num_points - edges.num_dropped
    return f"{count(len(edges))} edge points of {count(num)}, {edges.share:.1%}"


def summary(edges: Edges, not_selected: int, unit: str | None, by_stage: dict[str, float]) -> list[tuple[str, ...]]:
    """Return the rows of the table."""
    rows: list[tuple[str, ...]] = [("points", count(edges.num_points))]
    if not_selected:
        rows.append(("left out", count(not_selected), "by --where"))
    if edges.num_dropped > not_selected:
        rows.append(("not finite", count(edges.num_dropped - not_selected), "left out"))
    those = "points looked at" if not_selected else "finite points"
    rows.append(("edge points", count(len(edges)), f"{edges.share:.1%} of the {those}"))
    for name, number in edges.count_kinds().items():
        rows.append((f"  {name}", count(number), crease_remark(edges) if name == "crease" else ""))
    if edges.num_without_normal:
        rows.append(("normals undefined", count(edges.num_without_normal), "the neighbours span no plane"))
    rows.append(("method", edges.method, edges.reason))
    rows.append(("orientation", edges.orientation, ORIENTATIONS[edges.orientation]))
    if unit is not None:
        rows.append(("unit", "", f"{unit}, says the file"))
    rows += time_rows(by_stage)
    if (peak := peak_memory()) is not None:
        rows.append(("memory", f"{peak / 1e6:,.0f} MB", "at most, that of the program itself included"))
    return rows


def peak_memory() -> int | None:
    """Return the most memory this process has held, in bytes, None where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
