"""The figures of the paper for any cloud and its edges: 1, 3, 4 and 5, each a PNG with panels, labels and a caption."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from edgel import plot
from edgel.cloud import Cloud, check_points
from edgel.edges import Edges
from edgel.palette import ANY_KIND
from edgel.paper import PaperEdges
from edgel.synth import Part

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DPI = 150
_WIDTH, _TALLEST = 1600, 960  # pixels: of a figure, and of its panels
_GAP, _TITLE, _AXES, _LEGEND, _LINE = 40, 56, 84, 60, 30  # pixels: beside, above and below the panels
_RIM = 0.03  # free rim round a panel with axes, as a share of it
_DRAWN = 40_000  # points of a scan drawn singly beside its part: more would close to the same surface


@dataclass(frozen=True, eq=False)
class FigureImage:
    """A figure as PNG.

    Attributes
    ----------
    number : int
        Of the paper's figure it follows: 1, 3, 4 or 5.
    caption : str
    png : bytes
        With the caption below the panels.
    png_bare : bytes
        Without, for a page that sets the caption itself.
    """

    number: int
    caption: str
    png: bytes
    png_bare: bytes


@dataclass(frozen=True, eq=False)
class _Panel:
    """One image of a figure; with `extent` (left, right, bottom, top) it has axes in the cloud's unit."""

    image: np.ndarray
    title: str = ""
    raster: bool = False  # its own pixels are what is shown, at any size
    extent: tuple[float, float, float, float] | None = None

    @property
    def aspect(self) -> float:
        """Width over height as it is shown."""
        if self.extent is None:
            return self.image.shape[1] / self.image.shape[0]
        left, right, bottom, top = self.extent
        return (right - left) / (top - bottom)


@dataclass(frozen=True, eq=False)
class _Content:
    number: int
    caption: str
    panels: Sequence[_Panel]
    legend: Sequence[tuple[tuple[int, int, int], str]] = field(default_factory=list)
    unit: str = ""


def draw_figures(cloud: Cloud, edges: Edges, *, name: str, part: Part | None = None) -> tuple[FigureImage, ...]:
    """Draw the paper's figures 1, 3, 4 and 5 of a cloud.

    Parameters
    ----------
    cloud : Cloud
    edges : Edges
        Of this cloud. Those of the published method have a projection and an edge map, which figures 1 (c) and 3 show.
    name : str
        What the captions call it.
    part : Part, optional
        The part a simulated cloud was scanned from, for figure 1 (a).

    Returns
    -------
    tuple of FigureImage
        In the order of their numbers; figure 3 only for the published method.
    """
    published = isinstance(edges, PaperEdges)
    contents = [_figure_1(cloud, edges, name, part)]
    if published:
        contents.append(_figure_3(edges, name, part))
    contents += [_figure_4(cloud, edges, name), _figure_5(cloud, edges, name)]
    return tuple(
        FigureImage(one.number, one.caption, _compose(one, caption=True), _compose(one, caption=False))
        for one in contents
    )


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


def _figure_1(cloud: Cloud, edges: Edges, name: str, part: Part | None) -> _Content:
    panels, words = [], []
    published = isinstance(edges, PaperEdges)
    direction, size = ("oblique" if published else "auto"), ((900, 800) if published else (1500, 940))
    if part is not None:
        xyz, normals = surface(part)
        image = plot.render(xyz, normals=normals, direction=direction, size=size, crop=True, point_radius=1.0)
        panels.append(_Panel(image, "the part"))
        words.append("the part: its upper surface, the one the scanner faces, without noise")
        few = _thinned(cloud)
        image = plot.render(few, direction=direction, size=size, crop=True, point_radius=1.0, greys=(20, 170))
        panels.append(_Panel(image, "the cloud"))
        drawn = f", {len(few):,} of its {len(cloud):,} points" if len(few) < len(cloud) else ""
        words.append(f"the point cloud{drawn}")
    else:
        panels.append(_Panel(plot.render(cloud, direction=direction, size=size, crop=True), "the cloud"))
        words.append("the point cloud")
    if isinstance(edges, PaperEdges):
        panels.append(_Panel(_projection(edges), "its projection", raster=True))
        words.append("its projection on the x, y plane, the lighter the higher, black where no point falls")
    if len(panels) == 1:
        return _Content(1, f"Figure 1. {name}: {words[0]}.", [replace(panels[0], title="")])
    letters = [f"({letter}) " for letter in "abc"]
    titled = [replace(panel, title=letter + panel.title) for letter, panel in zip(letters, panels, strict=False)]
    caption = "; ".join(letter + word for letter, word in zip(letters, words, strict=False))
    return _Content(1, f"Figure 1. {name}: {caption}.", titled)


def _thinned(cloud: Cloud) -> Cloud:
    """Points to be seen one by one, chosen at random: every nth of a grid would show stripes that are not there."""
    rows = check_points(cloud, minimum=1).rows
    if len(rows) > _DRAWN:
        rows = np.sort(np.random.default_rng(0).choice(rows, _DRAWN, replace=False))
    return cloud.take(rows)


def _figure_3(edges: PaperEdges, name: str, part: Part | None) -> _Content:
    grid = edges.grid
    extent = grid.extent
    edge_map = np.where(edges.edge_map, 0, 255).astype(np.uint8)[::-1, :, None].repeat(3, axis=2)
    panels = [
        _Panel(_projection(edges), f"(a) projection, {grid.width} x {grid.height} pixels", True, extent),
        _Panel(edge_map, f"(b) edge map, {np.count_nonzero(edges.edge_map):,} edge pixels", True, extent),
    ]
    caption = f"Figure 3. {name}: (a) the projection; (b) the edge pixels that Canny's method finds in it, in black."
    return _Content(3, caption, panels, unit="" if part is None else "mm")


def _figure_4(cloud: Cloud, edges: Edges, name: str) -> _Content:
    published = isinstance(edges, PaperEdges)
    direction = "top" if published else "auto"
    image = plot.render(cloud, rows_on_top=edges.index, direction=direction, size=(1500, 940), crop=True)
    view = ", seen from above" if published else ""
    caption = f"Figure 4. {name}: the point cloud in grey and its edge points in red{view}."
    legend = [
        ((190, 190, 190), f"point cloud: {edges.num_points:,} points"),
        (ANY_KIND, f"edge points: {len(edges):,} ({edges.share:.1%})"),
    ]
    return _Content(4, caption, [_Panel(image)], legend)


def _figure_5(cloud: Cloud, edges: Edges, name: str) -> _Content:
    direction = "oblique" if isinstance(edges, PaperEdges) else "auto"
    image = plot.arrows(cloud, edges.index, edges.normals[:, 0], direction=direction, size=(1500, 940), crop=True)
    caption = f"Figure 5. {name}: surface normals at the edge points, as arrows at an even selection of them."
    if isinstance(edges, PaperEdges):
        caption += " As in the paper they are turned so that D > 0 (eq. 20), which is not always outwards."
    if edges.num_without_normal:
        caption += f" {edges.num_without_normal:,} edge points have no normal: their neighbours span no plane."
    legend = [(ANY_KIND, f"edge points: {len(edges):,}"), (plot.ARROW_COLOR, "normals")]
    return _Content(5, caption, [_Panel(image)], legend)


def _projection(edges: PaperEdges) -> np.ndarray:
    """The grey image as RGB, y upwards: (H, W, 3) uint8."""
    return np.rint(edges.image).astype(np.uint8)[::-1, :, None].repeat(3, axis=2)


def _compose(content: _Content, *, caption: bool) -> bytes:
    """Set the panels side by side at one height, with titles, legend and caption, and return the PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = content.panels
    axes_strip = _AXES if any(panel.extent for panel in panels) else 0
    gaps = (len(panels) - 1) * (_GAP + axes_strip)
    aspects = sum(panel.aspect for panel in panels)
    # A picture is shown pixel for pixel where there is room: scaled up or a little down it would blur.
    natural = [panel.image.shape[0] for panel in panels if not panel.raster]
    height = round(min((_WIDTH - 2 * _GAP - axes_strip - gaps) / aspects, *(natural or [_TALLEST]), _TALLEST))
    lines = textwrap.wrap(content.caption, 120) if caption else []
    above = _TITLE if any(panel.title for panel in panels) else _GAP // 2
    below = axes_strip + _LEGEND * bool(content.legend) + _LINE * len(lines) + _GAP // 2 * (1 + bool(lines))
    total = above + height + below
    figure = Figure(figsize=(_WIDTH / _DPI, total / _DPI), dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    left = round((_WIDTH + axes_strip - height * aspects - gaps) / 2)
    for panel in panels:
        width = round(panel.aspect * height)
        axes = figure.add_axes((left / _WIDTH, below / total, width / _WIDTH, height / total))
        _show(axes, panel, content.unit)
        left += width + _GAP + axes_strip
    if content.legend:
        _legend(figure, content.legend, (below - axes_strip - _LEGEND / 2) / total)
    for number, line in enumerate(reversed(lines)):
        figure.text(0.5, (_GAP / 2 + _LINE * number) / total, line, ha="center", va="bottom", fontsize=9.5)
    with io.BytesIO() as file:
        figure.savefig(file, format="png", metadata={"Software": "edgel"})
        return file.getvalue()


def _show(axes: Axes, panel: _Panel, unit: str) -> None:
    if panel.title:
        axes.set_title(panel.title, fontsize=11, pad=6)
    if panel.extent is None:
        axes.imshow(panel.image, interpolation="nearest" if panel.raster else "antialiased", aspect="auto")
        axes.set_axis_off()
        return
    left, right, bottom, top = panel.extent
    axes.imshow(panel.image, interpolation="nearest", aspect="auto", extent=panel.extent)
    # Edges lie at the very border of a projection: the frame keeps off it.
    axes.set_xlim(left - _RIM * (right - left), right + _RIM * (right - left))
    axes.set_ylim(bottom - _RIM * (top - bottom), top + _RIM * (top - bottom))
    axes.spines[:].set_color("0.7")
    axes.set_xlabel(f"x ({unit})" if unit else "x", fontsize=9)
    axes.set_ylabel(f"y ({unit})" if unit else "y", fontsize=9)
    axes.tick_params(labelsize=8)


def _legend(figure: Any, entries: Sequence[tuple[tuple[int, int, int], str]], height: float) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=(r / 255, g / 255, b / 255), marker="o", linestyle="", markersize=8, label=label)
        for (r, g, b), label in entries
    ]
    figure.legend(
        handles=handles, loc="center", bbox_to_anchor=(0.5, height), ncols=len(handles), frameon=False, fontsize=10
    )
