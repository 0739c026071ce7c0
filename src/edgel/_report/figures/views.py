"""Figures that the paper has not: the edges kind by kind, the most marked places, and what both presets find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._report.figures.compose import Content, Panel
from edgel.cloud import Cloud
from edgel.edges import Edges
from edgel.plot.drawing import Drawing
from edgel.plot.palette import KIND_COLORS
from edgel.plot.scene import FINE, Scene

_PART = 1 / 9  # width of a detail, as a share of the whole
_POINTS = 40  # that it has at least from side to side
_DETAILS = 3
_OVERVIEW, _DETAIL = (456, 342), (342, 342)  # as large as they are shown beside each other
_HALF = (740, 600)


def figure_6(cloud: Cloud, edges: Edges, name: str) -> Content:
    """Make one panel for each kind that occurs."""
    kinds = [kind for kind in KIND_COLORS if ((edges.kind & int(kind)) > 0).any()]
    size = (1500 // len(kinds), round(1500 / len(kinds) * 0.8))
    panels = []
    for kind in kinds:
        found = edges.take((edges.kind & int(kind)) > 0)
        found = replace(found, kind=np.full(len(found), int(kind), np.uint8))  # each in the color of this kind
        drawing = Drawing(cloud, found, size=size, crop=True, legend=False)
        panels.append(Panel(drawing.on, f"{str(kind.name).lower()}: {len(found):,}"))
    caption = f"Figure 6. {name}: the edge points of each kind alone. A point of several kinds is in several panels."
    return Content(6, caption, panels)


def figure_8(cloud: Cloud, edges: Edges, name: str) -> Content:
    """Make an overview and the places where the edges are most marked."""
    scene = Scene(cloud, direction="auto", size=_OVERVIEW, crop=False, margin=0.03)
    places = strongest(scene, edges)
    boxes, panels = [], []
    for letter, (row, box) in zip("bcd", places, strict=False):
        boxes.append((*box, letter))
        at = cloud.xyz[edges.index[row]]
        width = (box[2] - box[0]) * scene.frame.pixel
        width *= 1.0 if scene.camera.eye is None else float(scene.camera.place(at[None])[0, 2])
        drawing = Drawing(cloud, edges, size=_DETAIL, legend=False, detail=(at, width))
        panels.append(Panel(drawing.on, f"({letter}) {width:.3g} wide"))
    overview = Panel(Drawing(cloud, edges, size=_OVERVIEW, legend=False).on, "(a) the whole", boxes=boxes)
    caption = (
        f"Figure 8. {name}: where edges are most marked, by the sum of their strength; widths in the cloud's unit."
    )
    return Content(8, caption, [overview, *panels], kind_legend(edges))


def strongest(scene: Scene, edges: Edges) -> list[tuple[int, tuple[float, float, float, float]]]:
    """Choose the parts of a picture in which the edges seen are strongest, no two of them overlapping.

    Returns
    -------
    list of (int, (left, top, right, bottom))
        The edge point nearest to the middle of each part, and the part around it, in pixels of the picture.
    """
    shown = scene.on_top(edges.index)
    downs, columns = np.nonzero(shown >= 0)
    strength = edges.strength[shown[downs, columns]]
    cell = max(_PART * scene.width, min(_POINTS * scene.spacing, scene.width / 3))
    free = np.ones(len(downs), bool)
    chosen = []
    while free.any() and len(chosen) < _DETAILS:
        cells = np.floor(downs / cell).astype(int) * scene.width + np.floor(columns / cell).astype(int)
        best = np.bincount(cells[free], strength[free]).argmax()
        inside = free & (cells == best)
        middle = np.median(downs[inside]), np.median(columns[inside])
        nearest = np.flatnonzero(inside)[np.hypot(downs[inside] - middle[0], columns[inside] - middle[1]).argmin()]
        down, column = downs[nearest], columns[nearest]
        box = np.array([column - cell / 2, down - cell / 2, column + cell / 2, down + cell / 2]) / FINE
        chosen.append((int(shown[down, column]), tuple(box.tolist())))
        free &= np.maximum(np.abs(downs - down), np.abs(columns - column)) > cell
    return chosen


def figure_9(cloud: Cloud, edges: Edges, other: Edges, name: str) -> Content:
    """Make the answers of the two presets beside each other."""
    panels = []
    for letter, one in zip("ab", sorted((edges, other), key=lambda one: one.preset), strict=True):
        title = f"({letter}) {one.preset}: {len(one):,} edge points ({one.share:.1%})"
        panels.append(Panel(Drawing(cloud, one, size=_HALF, legend=False).on, title))
    legend = list(dict.fromkeys(kind_legend(edges) + kind_legend(other)))
    return Content(9, f"Figure 9. {name}: what the two presets find, in one view.", panels, legend)


def kind_legend(edges: Edges) -> list[tuple[tuple[int, int, int], str]]:
    """Color and name of each kind that occurs."""
    names = edges.count_kinds()
    return [(color, str(kind.name).lower()) for kind, color in KIND_COLORS.items() if str(kind.name).lower() in names]
