"""Figures of a cloud and its edges, the paper's and further ones, each a PNG with panels, labels and a caption."""

from __future__ import annotations

from importlib.util import find_spec

from edgel._report.figures.compose import FigureImage, figure_image
from edgel._report.figures.published import figure_1, figure_3, figure_4, figure_5
from edgel._report.figures.views import figure_6, figure_8, figure_9
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
    """Draw the paper's figures 1, 3, 4 and 5 of a cloud, and what the paper has not.

    Parameters
    ----------
    cloud : Cloud
    edges : Edges
        Of this cloud. Those of the published method have a projection and an edge map, which figures 1 (c) and 3 show.
    name : str
        What the captions call it.
    part : Cloud, optional
        Evenly sampled points, dense and without noise, of the surface that a simulated cloud was scanned from, for
        figure 1 (a).
    other : Edges, optional
        What another method finds in this cloud, for figure 9.

    Returns
    -------
    tuple of FigureImage
        In the order of their numbers; figure 3 only for the published method, 6 (each kind alone) only where there are
        several, 8 (the most marked places) only where there are edges.
    """
    contents = [figure_1(cloud, edges, name, part)]
    if isinstance(edges, PaperEdges):
        contents.append(figure_3(edges, name))
    contents += [figure_4(cloud, edges, name), figure_5(cloud, edges, name)]
    if len(edges.count_kinds()) > 1:
        contents.append(figure_6(cloud, edges, name))
    if len(edges):
        contents.append(figure_8(cloud, edges, name))
    if other is not None:
        contents.append(figure_9(cloud, edges, other, name))
    return tuple(map(figure_image, contents))
