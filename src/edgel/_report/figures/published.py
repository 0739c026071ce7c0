"""The paper's figures 1, 3, 4 and 5 for any cloud and its edges."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from edgel import plot
from edgel._report.figures.compose import Content, Panel
from edgel.cloud import Cloud, check_points
from edgel.edges import Edges
from edgel.paper import PaperEdges
from edgel.plot.drawing import Drawing
from edgel.plot.palette import ANY_KIND
from edgel.synth import Part

_DRAWN = 40_000  # points of a scan drawn singly beside its part: more would close to the same surface
_SINGLE = {"light": (20, 170), "dark": (105, 240)}  # greys of single points, which have to stand out from the sheet
_SIZE = (1500, 940)


def figure_1(cloud: Cloud, edges: Edges, name: str, part: Part | None) -> Content:
    """Make the part, the cloud, and its projection, as far as there are such."""
    panels, words = [], []
    published = isinstance(edges, PaperEdges)
    direction, size = ("oblique" if published else "auto"), ((900, 800) if published else _SIZE)
    look = {"direction": direction, "size": size, "crop": True}
    if part is not None:
        xyz, normals = surface(part)
        solid = partial(plot.render, xyz, normals=normals, point_radius=1.0, **look)
        panels.append(Panel(lambda sheet: solid(background=sheet), "the part"))
        words.append("the part: its upper surface, the one the scanner faces, without noise")
        few = _thinned(cloud)
        dots = partial(plot.render, few, point_radius=1.0, **look)
        panels.append(Panel(lambda sheet: dots(greys=_SINGLE[sheet], background=sheet), "the cloud"))
        drawn = f", {len(few):,} of its {len(cloud):,} points" if len(few) < len(cloud) else ""
        words.append(f"the point cloud{drawn}")
    else:
        panels.append(Panel(Drawing(cloud, **look, legend=False).on, "the cloud"))
        words.append("the point cloud")
    if isinstance(edges, PaperEdges):
        projection = _projection(edges)
        panels.append(Panel(lambda _: projection, "its projection", raster=True))
        words.append("its projection on the x, y plane, the lighter the higher, black where no point falls")
    if len(panels) == 1:
        return Content(1, f"Figure 1. {name}: {words[0]}.", [replace(panels[0], title="")])
    letters = [f"({letter}) " for letter in "abc"]
    titled = [replace(panel, title=letter + panel.title) for letter, panel in zip(letters, panels, strict=False)]
    caption = "; ".join(letter + word for letter, word in zip(letters, words, strict=False))
    return Content(1, f"Figure 1. {name}: {caption}.", titled)


def figure_3(edges: PaperEdges, name: str, part: Part | None) -> Content:
    """Make the projection and the edge map."""
    grid = edges.grid
    extent = grid.extent
    edge_map = np.where(edges.edge_map, 0, 255).astype(np.uint8)[::-1, :, None].repeat(3, axis=2)
    panels = [
        Panel(lambda _: _projection(edges), f"(a) projection, {grid.width} x {grid.height} pixels", True, extent),
        Panel(lambda _: edge_map, f"(b) edge map, {np.count_nonzero(edges.edge_map):,} edge pixels", True, extent),
    ]
    caption = f"Figure 3. {name}: (a) the projection; (b) the edge pixels that Canny's method finds in it, in black."
    return Content(3, caption, panels, unit="" if part is None else "mm")


def figure_4(cloud: Cloud, edges: Edges, name: str) -> Content:
    """Make the cloud with its edge points."""
    published = isinstance(edges, PaperEdges)
    direction = "top" if published else "auto"
    drawing = Drawing(cloud, edges, direction=direction, size=_SIZE, crop=True)
    view = ", seen from above" if published else ""
    number = f"{len(edges):,} edge points ({edges.share:.1%})"
    caption = f"Figure 4. {name}: the cloud of {edges.num_points:,} points in grey, its {number} by their kind{view}."
    if (edges.kind & (edges.kind - 1)).any():
        caption += " Points of several kinds wear the color of the first."
    return Content(4, caption, [Panel(drawing.on)])


def figure_5(cloud: Cloud, edges: Edges, name: str) -> Content:
    """Make the normals at the edge points."""
    direction = "oblique" if isinstance(edges, PaperEdges) else "auto"
    normals = edges.normals[:, 0]
    drawn = partial(plot.arrows, cloud, edges.index, normals, direction=direction, size=_SIZE, crop=True)
    caption = f"Figure 5. {name}: surface normals at the edge points, as arrows at an even selection of them."
    if isinstance(edges, PaperEdges):
        caption += " As in the paper they are turned so that D > 0 (eq. 20), which is not always outwards."
    if edges.num_without_normal:
        caption += f" {edges.num_without_normal:,} edge points have no normal: their neighbours span no plane."
    legend = [(ANY_KIND, f"edge points: {len(edges):,}"), (plot.ARROW_COLOR, "normals")]
    return Content(5, caption, [Panel(lambda sheet: drawn(background=sheet))], legend)


def surface(part: Part, *, step: float = 0.25) -> tuple[np.ndarray, np.ndarray]:
    """Sample the surface of a part that is seen from above, closely enough to be drawn from the side too.

    Parameters
    ----------
    part : Part
    step : float
        Distance between samples, mm.

    Returns
    -------
    xyz, normals : (N, 3) float64
    """
    low, high = part.bounds
    x, y = np.meshgrid(np.arange(low[0], high[0], step), np.arange(low[1], high[1], step))
    places = [np.column_stack([x.ravel(), y.ravel()])]
    # Towards an outline the surface falls ever steeper, as a root: there samples lie closer by the square.
    inward = (np.arange(1, round(40.0 / step)) * step) ** 2 / 110.0
    for edge in part.edges:
        if edge.kind == "occluding":
            line = edge.points[:: max(int(step / 0.05), 1), :2]
            along = np.gradient(line, axis=0)
            across = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
            shift = inward[:, None] * across[:, None]
            places += [(line[:, None] + shift).reshape(-1, 2), (line[:, None] - shift).reshape(-1, 2)]
    at = np.concatenate(places)
    hits = part.look(at[:, 0], at[:, 1])
    hit = hits.surface >= 0
    return np.column_stack([at, hits.z])[hit], hits.normals[hit]


def _thinned(cloud: Cloud) -> Cloud:
    """Points to be seen one by one, chosen at random: every nth of a grid would show stripes that are not there."""
    rows = check_points(cloud, minimum=1).rows
    if len(rows) > _DRAWN:
        rows = np.sort(np.random.default_rng(0).choice(rows, _DRAWN, replace=False))
    return cloud.take(rows)


def _projection(edges: PaperEdges) -> np.ndarray:
    """The grey image as RGB, y upwards: (H, W, 3) uint8."""
    return np.rint(edges.image).astype(np.uint8)[::-1, :, None].repeat(3, axis=2)
