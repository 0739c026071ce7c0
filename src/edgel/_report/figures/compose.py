"""Panels side by side with titles, axes, legend and caption, as one PNG."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from edgel.plot.palette import THEMES, Theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Color = tuple[int, int, int]

_DPI = 150
_WIDTH, _TALLEST = 1600, 960  # pixels: of a figure, and of its panels
_GAP, _TITLE, _AXES, _LEGEND, _LINE = 40, 56, 84, 60, 30  # pixels: beside, above and below the panels
_SMALL = {"format": "WEBP", "lossless": True, "method": 2, "quality": 50}  # of the effort, not of the picture
_LETTER = 20  # pixels: of the caption
_RIM = 0.03  # free rim round a panel with axes, as a share of it


@dataclass(frozen=True, eq=False)
class FigureImage:
    """A figure as it is written.

    Attributes
    ----------
    number : int
        From 1, in the order in which the page shows them.
    caption : str
    png : bytes
        On white, with the caption below the panels.
    light, dark : bytes
        Without it, for a page that sets the caption itself, as lossless WebP: half the size of a PNG.
    """

    number: int
    caption: str
    png: bytes
    light: bytes
    dark: bytes


@dataclass(frozen=True)
class Box:
    """A place marked in an image, in its pixels, and what it is called."""

    left: float
    top: float
    right: float
    bottom: float
    name: str = ""


@dataclass(frozen=True, eq=False)
class Panel:
    """One image of a figure.

    Attributes
    ----------
    image : callable
        Gives the image (H, W, 3) uint8 on a background of `edgel.plot.picture`.
    title : str
    raster : bool
        Its own pixels are what is shown, at any size.
    extent : (left, right, bottom, top) or None
        With it the panel has axes in the cloud's unit.
    boxes : sequence of Box
        Places marked in it.
    """

    image: Callable[[str], np.ndarray]
    title: str = ""
    raster: bool = False
    extent: tuple[float, float, float, float] | None = None
    boxes: Sequence[Box] = ()

    def aspect(self, image: np.ndarray) -> float:
        """Width over height as its image is shown."""
        if self.extent is None:
            return image.shape[1] / image.shape[0]
        left, right, bottom, top = self.extent
        return (right - left) / (top - bottom)


@dataclass(frozen=True, eq=False)
class Content:
    """What a figure holds: panels, a legend where they have none themselves, and the caption without its number."""

    caption: str
    panels: Sequence[Panel]
    legend: Sequence[tuple[Color, str]] = field(default_factory=list)


def figure_image(content: Content, number: int, name: str) -> FigureImage:
    """Draw a figure of a cloud of some name on white and on black."""
    caption = f"Figure {number}. {name}: {content.caption}"
    light, dark = (
        _compose(content, [panel.image(background) for panel in content.panels], THEMES[background])
        for background in ("light", "dark")
    )
    captioned = _with_caption(light, caption, THEMES["light"])
    forms = ((captioned, {"format": "PNG"}), (light, _SMALL), (dark, _SMALL))
    with ThreadPoolExecutor(len(forms)) as pool:  # packing takes as long as drawing
        files = pool.map(lambda image, form: _encoded(image, **form), *zip(*forms, strict=True))
        return FigureImage(number, caption, *files)


def _encoded(image: Image.Image, **form: Any) -> bytes:
    with io.BytesIO() as file:
        image.save(file, **form)
        return file.getvalue()


def _with_caption(image: Image.Image, caption: str, theme: Theme) -> Image.Image:
    """Set the caption below a figure."""
    font = ImageFont.load_default(_LETTER)
    lines = textwrap.wrap(caption, 120)
    canvas = Image.new("RGB", (image.width, image.height + _LINE * len(lines) + _GAP // 2), theme.background)
    canvas.paste(image)
    draw = ImageDraw.Draw(canvas)
    for number, line in enumerate(lines):
        place = (image.width / 2, image.height + _LINE * (number + 0.5))
        draw.text(place, line, fill=theme.ink, font=font, anchor="mm")
    return canvas


def _compose(content: Content, images: Sequence[np.ndarray], theme: Theme) -> Image.Image:
    """Set the panels side by side at one height, with titles and legend."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = content.panels
    axes_strip = _AXES if any(panel.extent for panel in panels) else 0
    gaps = (len(panels) - 1) * (_GAP + axes_strip)
    aspects = [panel.aspect(image) for panel, image in zip(panels, images, strict=True)]
    # A picture is shown pixel for pixel where there is room: scaled up or a little down it would blur.
    natural = [len(image) for panel, image in zip(panels, images, strict=True) if not panel.raster]
    height = round(min((_WIDTH - 2 * _GAP - axes_strip - gaps) / sum(aspects), *(natural or [_TALLEST]), _TALLEST))
    above = _TITLE if any(panel.title for panel in panels) else _GAP // 2
    below = axes_strip + _LEGEND * bool(content.legend) + _GAP // 2
    total = above + height + below
    figure = Figure(figsize=(_WIDTH / _DPI, total / _DPI), dpi=_DPI, facecolor=_share(theme.background))
    canvas = FigureCanvasAgg(figure)
    ink = _share(theme.ink)
    left = round((_WIDTH + axes_strip - height * sum(aspects) - gaps) / 2)
    for panel, image, aspect in zip(panels, images, aspects, strict=True):
        width = round(aspect * height)
        axes = figure.add_axes((left / _WIDTH, below / total, width / _WIDTH, height / total), facecolor="none")
        _show(axes, panel, image, ink)
        left += width + _GAP + axes_strip
    if content.legend:
        _legend(figure, content.legend, (below - axes_strip - _LEGEND / 2) / total, ink)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _show(axes: Axes, panel: Panel, image: np.ndarray, ink: tuple[float, float, float]) -> None:
    if panel.title:
        axes.set_title(panel.title, fontsize=11, pad=6, color=ink)
    if panel.extent is None:
        axes.imshow(image, interpolation="nearest" if panel.raster else "antialiased", aspect="auto")
        axes.set_axis_off()
        for box in panel.boxes:
            corners = [box.left, box.right, box.right, box.left, box.left], [box.top] * 2 + [box.bottom] * 2 + [box.top]
            axes.plot(*corners, color=ink, linewidth=1.2, scalex=False, scaley=False)
            place = {"xy": (box.left, box.top), "xytext": (2, -3), "textcoords": "offset points", "va": "top"}
            axes.annotate(box.name, **place, fontsize=10, color=ink)
        return
    left, right, bottom, top = panel.extent
    axes.imshow(image, interpolation="nearest", aspect="auto", extent=panel.extent)
    # Edges lie at the very border of a projection: the frame keeps off it.
    axes.set_xlim(left - _RIM * (right - left), right + _RIM * (right - left))
    axes.set_ylim(bottom - _RIM * (top - bottom), top + _RIM * (top - bottom))
    axes.spines[:].set_color("0.6")
    axes.set_xlabel("x", fontsize=9, color=ink)
    axes.set_ylabel("y", fontsize=9, color=ink)
    axes.tick_params(labelsize=8, color="0.6", labelcolor=ink)


def _legend(figure: Figure, entries: Sequence[tuple[Color, str]], height: float, ink: Any) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=_share(color), marker="o", linestyle="", markersize=8, label=label)
        for color, label in entries
    ]
    place = {"loc": "center", "bbox_to_anchor": (0.5, height)}
    figure.legend(handles=handles, **place, ncols=len(handles), frameon=False, fontsize=10, labelcolor=ink)


def _share(color: Color) -> tuple[float, float, float]:
    """A color as Matplotlib takes it."""
    r, g, b = color
    return r / 255, g / 255, b / 255
