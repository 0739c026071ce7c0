"""The page of curves: three views with the measures on them, and the table of all."""

from __future__ import annotations

import html
from pathlib import Path

import numpy as np

from edgel.curves import CurveKind, Curves, measures
from edgel.curves._svg import VIEWS, drawing
from edgel.io.files import replacing

_WIDE = 240.0  # millimetres
_LABELLED = 60  # of the longest curves, beside the circles
_COLUMNS = ("name", "edge", "length", "length_std", "diameter", "diameter_std", "angle", "angle_std", "position_std")
_STYLE = (
    "body{font:15px/1.5 system-ui,sans-serif;max-width:1000px;margin:2em auto;padding:0 1em}"
    "svg{max-width:100%;height:auto;border:1px solid #ddd}"
    "table{border-collapse:collapse;font-size:13px}td,th{padding:.2em .7em;text-align:right;"
    "border-bottom:1px solid #eee}td:first-child,th:first-child{text-align:left}"
)


def write_lines_page(folder: str | Path, title: str, curves: Curves, unit: str | None) -> Path:
    """Write ``lines.html`` into a folder, which is made if need be, and return its path."""
    page = Path(folder) / "lines.html"
    page.parent.mkdir(parents=True, exist_ok=True)
    extent = np.ptp(curves.vertices, axis=0) if len(curves) else np.ones(3)
    labels = _labels(curves)
    parts = [f"<h1>Lines of {html.escape(title)}</h1>"]
    lengths = html.escape(unit or "the unit of the cloud")
    told = f"Lengths in {lengths}, angles in degrees, with standard deviations. What has no label stands in "
    told += "the table."
    parts.append(f"<p>{html.escape(repr(curves))}. {told}</p>")
    for view, axes in VIEWS.items():
        factor = _WIDE / max(float(extent[list(axes)].max()), 1e-300)
        parts += [f"<h2>{view.capitalize()}</h2>", drawing(curves, view, factor, labels)]
    table = measures(curves)
    parts.append(
        "<h2>Measures</h2><table><tr>" + "".join(f"<th>{name.replace('_', ' ')}</th>" for name in _COLUMNS) + "</tr>"
    )
    for row in zip(*(table[name].tolist() for name in _COLUMNS), strict=True):
        parts.append("<tr>" + "".join(f"<td>{_shown(value)}</td>" for value in row) + "</tr>")
    parts.append("</table>")
    head = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{html.escape(title)}</title>'
    head += f"<style>{_STYLE}</style>"
    with replacing(page) as file:
        file.write((head + "\n".join(parts) + "</html>\n").encode())
    return page


def _shown(value: float | str) -> str:
    if isinstance(value, str):
        return html.escape(value)
    return "" if value != value else f"{value:.5g}"


def _labels(curves: Curves) -> list[str]:
    """Return what stands on the picture: diameters of circles, radii of arcs, lengths of the longest others."""
    longest = set(np.argsort(-curves.length, kind="stable")[:_LABELLED].tolist())
    labels = []
    for k in range(len(curves)):
        if curves.kind[k] == CurveKind.CIRCLE:
            labels.append(f"\u2300{curves.diameter[k]:.4g}")
        elif curves.kind[k] == CurveKind.ARC:
            labels.append(f"R{curves.radius[k]:.4g}" if k in longest else "")
        else:
            labels.append(f"{curves.length[k]:.4g}" if k in longest else "")
    return labels
