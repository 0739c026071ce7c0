"""Figures of a cloud and its edges, each a PNG with panels, labels and a caption."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

from edgel._report.figures.compose import Content, FigureImage, figure_image
from edgel._report.figures.published import (
    cloud_and_projection,
    edges_on_cloud,
    normals_at_edges,
    projection_and_edge_map,
)
from edgel._report.figures.views import both_methods, each_kind, strongest_places
from edgel.cloud import Cloud
from edgel.edges import Edges
from edgel.paper import PaperEdges

__all__ = ["FigureImage", "check_drawing", "draw_figures"]


def check_drawing() -> None:
    """Raise an `ImportError` where Matplotlib, which sets the figures, is not installed."""
    if find_spec("matplotlib") is None:
        raise ImportError("figures need Matplotlib: pip install 'edgel[plot]', or pip install matplotlib")


def draw_figures(
    cloud: Cloud, edges: Edges, *, name: str, part: Cloud | None = None, other: Edges | None = None
) -> tuple[FigureImage, ...]:
    """Draw a cloud with its edges, their normals, and more; of the published method the paper's own figures too.

    Parameters
    ----------
    cloud : Cloud
    edges : Edges
        Of this cloud. Those of the published method have a projection and an edge map, which are shown.
    name : str
        What the captions call it.
    part : Cloud, optional
        Evenly sampled points, dense and without noise, of the surface that a simulated cloud was scanned from.
    other : Edges, optional
        What another method finds in this cloud.

    Returns
    -------
    tuple of FigureImage
        In the order of the page, by which they are numbered: the edges; part, cloud and projection; the edge map; the
        normals; each kind alone, where there are several; the most marked places, where there are edges; both methods.
    """
    contents = [edges_on_cloud(cloud, edges), cloud_and_projection(cloud, edges, part)]
    if isinstance(edges, PaperEdges):
        contents.append(projection_and_edge_map(edges))
    contents.append(normals_at_edges(cloud, edges))
    if isinstance(edges, PaperEdges):
        contents = [_as_in_the_paper(*pair) for pair in zip(contents, (4, 1, 3, 5), strict=True)]
    if len(edges.count_kinds()) > 1:
        contents.append(each_kind(cloud, edges))
    if len(edges):
        contents.append(strongest_places(cloud, edges))
    if other is not None:
        contents.append(both_methods(cloud, edges, other))
    there = [content for content in contents if content is not None]
    return tuple(figure_image(content, number, name) for number, content in enumerate(there, start=1))


def _as_in_the_paper(content: Content | None, number: int) -> Content | None:
    """Say which figure of the paper this is."""
    return content and replace(content, caption=f"{content.caption} As figure {number} of the paper.")
