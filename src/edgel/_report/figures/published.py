"""What the paper's figures 1, 3, 4 and 5 show, for any cloud and its edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._report.figures.compose import Content, Panel
from edgel.cloud import Cloud, check_points
from edgel.edges import Edges
from edgel.paper import PaperEdges
from edgel.plot.camera import Viewport
from edgel.plot.drawing import Drawing

_DRAWN = 40_000  # points of a scan drawn singly beside its part: more would close to the same surface
_POINT = 2.0  # their width, in pixels
_SIZE = (1500, 940)


def cloud_and_projection(cloud: Cloud, edges: Edges, part: Cloud | None) -> Content | None:
    """Make the part, the cloud, and its projection, as far as there are such; None where the cloud would be alone."""
    published = isinstance(edges, PaperEdges)
    if part is None and not published:
        return None
    panels, words = [], []
    viewport = Viewport((900, 800), "oblique", crop=True) if published else Viewport(_SIZE, crop=True)
    if part is None:
        panels.append(Panel(Drawing(cloud, None, viewport, legend=False).on, "the cloud"))
        words.append("the point cloud")
    else:
        panels.append(Panel(Drawing(part, None, viewport, legend=False).on, "the part"))
        words.append("the part: the surface that the scanner faces, without noise")
        few = _thinned(cloud)
        singly = replace(viewport, point_size=_POINT)
        panels.append(Panel(Drawing(few, None, singly, legend=False).on, "the cloud"))
        drawn = f", {len(few):,} of its {len(cloud):,} points" if len(few) < len(cloud) else ""
        words.append(f"the point cloud{drawn}")
    if isinstance(edges, PaperEdges):
        projection = _projection(edges)
        panels.append(Panel(lambda _: projection, "its projection", raster=True))
        words.append("its projection on the x, y plane, the lighter the higher, black where no point falls")
    letters = [f"({letter}) " for letter in "abc"]
    titled = [replace(panel, title=letter + panel.title) for letter, panel in zip(letters, panels, strict=False)]
    caption = "; ".join(letter + word for letter, word in zip(letters, words, strict=False))
    return Content(f"{caption}.", titled)


def projection_and_edge_map(edges: PaperEdges) -> Content:
    """Make the projection and the edge map."""
    grid = edges.grid
    extent = grid.extent
    edge_map = np.where(edges.edge_map, 0, 255).astype(np.uint8)[::-1, :, None].repeat(3, axis=2)
    panels = [
        Panel(lambda _: _projection(edges), f"(a) projection, {grid.width} x {grid.height} pixels", True, extent),
        Panel(lambda _: edge_map, f"(b) edge map, {np.count_nonzero(edges.edge_map):,} edge pixels", True, extent),
    ]
    return Content("(a) the projection; (b) the edge pixels that Canny's method finds in it, in black.", panels)


def edges_on_cloud(cloud: Cloud, edges: Edges) -> Content:
    """Make the cloud with its edge points."""
    published = isinstance(edges, PaperEdges)
    direction = "top" if published else "auto"
    drawing = Drawing(cloud, edges, Viewport(_SIZE, direction, crop=True))
    view = ", seen from above" if published else ""
    number = f"{len(edges):,} edge points ({edges.share:.1%})"
    caption = f"the cloud of {edges.num_points:,} points in grey, its {number} by their kind{view}."
    if (edges.kind & (edges.kind - 1)).any():
        caption += " Points of several kinds wear the color of the first."
    return Content(caption, [Panel(drawing.on)])


def normals_at_edges(cloud: Cloud, edges: Edges) -> Content:
    """Make the normals at the edge points."""
    direction = "oblique" if isinstance(edges, PaperEdges) else "auto"
    drawing = Drawing(cloud, edges, Viewport(_SIZE, direction, crop=True), normals=True)
    caption = "surface normals at the edge points, as arrows at an even selection of them."
    if isinstance(edges, PaperEdges):
        caption += " As in the paper they are turned so that D > 0 (eq. 20), which is not always outwards."
    if edges.num_without_normal:
        caption += f" {edges.num_without_normal:,} edge points have no normal: their neighbours span no plane."
    return Content(caption, [Panel(drawing.on)])


def _thinned(cloud: Cloud) -> Cloud:
    """Points to be seen one by one, chosen at random: every nth of a grid would show stripes that are not there."""
    rows = check_points(cloud, minimum=1).rows
    if len(rows) > _DRAWN:
        rows = np.sort(np.random.default_rng(0).choice(rows, _DRAWN, replace=False))
    return cloud.take(rows)


def _projection(edges: PaperEdges) -> np.ndarray:
    """The grey image as RGB, y upwards: (H, W, 3) uint8."""
    return np.rint(edges.image).astype(np.uint8)[::-1, :, None].repeat(3, axis=2)
