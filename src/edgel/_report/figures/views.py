"""Figures that the paper has not: the edges kind by kind, the most marked places, and what both methods find."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from edgel._report.figures.compose import Box, Color, Content, Panel
from edgel._report.tables import published_last
from edgel.cloud import Cloud
from edgel.edges import Edges, kind_names
from edgel.plot.camera import Viewport
from edgel.plot.drawing import Drawing
from edgel.plot.palette import KIND_COLORS
from edgel.plot.zbuffer import SUPERSAMPLING, ZBuffer

_PART = 1 / 9  # width of a detail, as a share of the whole
_POINTS = 40  # that it has at least from side to side
_DETAILS = 3
_OVERVIEW, _DETAIL = (456, 342), (342, 342)  # as large as they are shown beside each other
_HALF = (740, 600)


def each_kind(cloud: Cloud, edges: Edges) -> Content:
    """Make one panel for each kind that occurs."""
    kinds = [kind for kind in KIND_COLORS if ((edges.kind & int(kind)) > 0).any()]
    size = (1500 // len(kinds), round(1500 / len(kinds) * 0.8))
    panels = []
    for kind in kinds:
        found = edges.take((edges.kind & int(kind)) > 0)
        found = replace(found, kind=np.full(len(found), int(kind), np.uint8))  # each in the color of this kind
        drawing = Drawing(cloud, found, Viewport(size, crop=True), legend=False)
        panels.append(Panel(drawing.on, f"{kind_names(kind)[0]}: {len(found):,}"))
    return Content("the edge points of each kind alone. A point of several kinds is in several panels.", panels)


def strongest_places(cloud: Cloud, edges: Edges) -> Content:
    """Make an overview and the places where the edges are most marked."""
    overview = Drawing(cloud, edges, Viewport(_OVERVIEW), legend=False)
    boxes, panels = [], []
    for letter, strong in zip("bcd", strongest(overview.buffer, edges), strict=False):
        boxes.append(replace(strong.box, name=letter))
        at = cloud.xyz[edges.index[strong.edge]]
        depth = overview.buffer.camera.project(at[None])[:, 2]
        width = (strong.box.right - strong.box.left) * float(np.squeeze(overview.buffer.pixel_size(depth)))
        drawing = Drawing(cloud, edges, Viewport(_DETAIL, detail=(at, width)), legend=False)
        panels.append(Panel(drawing.on, f"({letter}) {width:.3g} wide"))
    whole = Panel(overview.on, "(a) the whole", boxes=boxes)
    caption = "where edges are most marked, by the sum of their strength; widths in the cloud's unit."
    return Content(caption, [whole, *panels], kind_legend(edges))


@dataclass(frozen=True)
class StrongPlace:
    """Where edges are strong: the edge point nearest to its middle, and the part of the picture around it."""

    edge: int
    box: Box


def strongest(buffer: ZBuffer, edges: Edges) -> list[StrongPlace]:
    """Choose the parts of a picture in which the edges seen are strongest, no two of them overlapping."""
    shown = buffer.overlay(edges.index)
    y, x = np.nonzero(shown >= 0)
    strength = edges.strength[shown[y, x]]
    side = max(_PART * buffer.width, min(_POINTS * buffer.spacing, buffer.width / 3))
    free = np.ones(len(y), bool)
    chosen = []
    while free.any() and len(chosen) < _DETAILS:
        cells = np.floor(y / side).astype(int) * buffer.width + np.floor(x / side).astype(int)
        best = np.bincount(cells[free], strength[free]).argmax()
        inside = free & (cells == best)
        off = np.hypot(y[inside] - np.median(y[inside]), x[inside] - np.median(x[inside]))
        middle = np.flatnonzero(inside)[off.argmin()]
        ends = np.array([x[middle] - side / 2, y[middle] - side / 2, x[middle] + side / 2, y[middle] + side / 2])
        box = Box(*(ends / SUPERSAMPLING).tolist())
        chosen.append(StrongPlace(int(shown[y[middle], x[middle]]), box))
        free &= np.maximum(np.abs(y - y[middle]), np.abs(x - x[middle])) > side
    return chosen


def both_methods(cloud: Cloud, edges: Edges, other: Edges) -> Content:
    """Make the answers of the two methods beside each other."""
    panels = []
    for letter, one in zip("ab", published_last(edges, other), strict=True):
        title = f"({letter}) {one.method}: {len(one):,} edge points ({one.share:.1%})"
        panels.append(Panel(Drawing(cloud, one, Viewport(_HALF), legend=False).on, title))
    legend = list(dict.fromkeys(kind_legend(edges) + kind_legend(other)))
    return Content("what the two methods find, in one view.", panels, legend)


def kind_legend(edges: Edges) -> list[tuple[Color, str]]:
    """Color and name of each kind that occurs."""
    names = edges.count_kinds()
    return [(color, kind_names(kind)[0]) for kind, color in KIND_COLORS.items() if kind_names(kind)[0] in names]
