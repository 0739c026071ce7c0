"""SVG: a drawing to scale, seen along an axis."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np

from edgel.curves._curves import CurveKind, Curves
from edgel.curves._labels import SIZE, place_labels
from edgel.edges import EdgeKind
from edgel.io.files import replacing

VIEWS = {"top": (0, 1), "front": (0, 2), "right": (1, 2)}
"""The axes that go right and up."""
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Millimetres."""
_COLORS = {
    EdgeKind.CREASE: "#111",
    EdgeKind.BOUNDARY: "#1f5fbf",
    EdgeKind.OCCLUDING: "#2a8a4a",
    EdgeKind.COLOR: "#a0408a",
}
_STROKE, _MARGIN = 0.25, 5.0  # millimetres on paper


def write(path: str | os.PathLike[str], curves: Curves, *, view: str, unit: str, scale: float) -> None:
    """Write the curves in millimetres on paper, circles that face the view as circles."""
    if view not in VIEWS:
        raise ValueError(f"view: expected one of {', '.join(VIEWS)}, got {view!r}")
    if unit not in UNITS:
        raise ValueError(f"unit: expected one of {', '.join(UNITS)}, got {unit!r}")
    if not (scale > 0 and math.isfinite(scale)):
        raise ValueError(f"scale: expected a number above 0, got {scale}")
    text = drawing(curves, view, UNITS[unit] * scale)
    with replacing(path) as file:
        file.write(text.encode())


def drawing(curves: Curves, view: str, factor: float, labels: Sequence[str] = ()) -> str:
    """Return an SVG in which a unit of the cloud has so many millimetres, with labels where there is room."""
    right, up = VIEWS[view]
    flat = curves.vertices[:, [right, up]]
    low, high = (flat.min(axis=0), flat.max(axis=0)) if len(flat) else (np.zeros(2), np.zeros(2))
    width, height = (high - low) * factor + 2 * _MARGIN

    def on_paper(places: np.ndarray) -> np.ndarray:
        moved = (places[..., [right, up]] - low) * factor + _MARGIN
        return np.stack([moved[..., 0], height - moved[..., 1]], axis=-1)

    depth = next(axis for axis in range(3) if axis not in (right, up))
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.4f}mm" height="{height:.4f}mm" '
        f'viewBox="0 0 {width:.4f} {height:.4f}" fill="none" stroke-width="{_STROKE}" stroke-linecap="round">',
    ]
    for curve in range(len(curves)):
        color = _COLORS.get(EdgeKind(int(curves.edge[curve])), "#666")
        path = on_paper(curves.points_of(curve))
        if curves.kind[curve] == CurveKind.CIRCLE and abs(curves.direction[curve, depth]) > 1 - 1e-6:
            x, y = on_paper(curves.centre[curve])
            lines.append(
                f'<circle cx="{x:.5f}" cy="{y:.5f}" r="{curves.radius[curve] * factor:.5f}" stroke="{color}"/>'
            )
        else:
            places = " ".join(f"{x:.5f},{y:.5f}" for x, y in path)
            lines.append(f'<polyline points="{places}" stroke="{color}"/>')
    if labels:
        paths = [on_paper(curves.points_of(curve)) for curve in range(len(curves))]
        importance = np.where(curves.kind == CurveKind.CIRCLE, np.inf, curves.length)
        for curve, (x, y) in place_labels(paths, labels, importance, width, height).items():
            color = _COLORS.get(EdgeKind(int(curves.edge[curve])), "#666")
            lines.append(f'<text x="{x:.2f}" y="{y:.2f}" font-size="{SIZE:g}" fill="{color}">{labels[curve]}</text>')
    return "\n".join([*lines, "</svg>"]) + "\n"
