"""Pictures of clouds and their edges, drawn with NumPy: a z-buffer of discs, shaded so that the shape is seen."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from edgel.cloud import as_cloud, check_rows
from edgel.edges import Edges
from edgel.io.files import replacing
from edgel.plot.drawing import Drawing, reduced, sheet_of
from edgel.plot.palette import ANY_KIND
from edgel.plot.scene import FINE, Scene

ARROW_COLOR = (20, 105, 215)  # seen on pale surfaces, white and black

_PALE = {"light": (180, 244), "dark": (150, 214)}  # greys of the slopes where arrows shall stand out


def picture(
    points: Any,
    edges: Edges | None = None,
    *,
    direction: Any = "auto",
    size: tuple[int, int] = (1200, 900),
    crop: bool = False,
    color_by: str = "grey",
    edge_color: str = "kind",
    background: str = "light",
    legend: bool = True,
    detail: tuple[Any, float] | None = None,
) -> np.ndarray:
    """Draw a cloud and its edges on top, with a legend and a scale bar.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        Points that are not finite are left out; a few far outliers may fall outside the picture.
    edges : Edges, optional
        Of these points. Those hidden behind nearer parts of the cloud are not drawn. ``edges.of_kinds("crease")`` and
        ``edges.take(edges.strength > 0.9)`` choose some.
    direction : {"auto", "top", "oblique", "sensor"} or (3,) array_like
        ``"top"`` looks down -Z as the paper does, ``"sensor"`` from the cloud's viewpoint, ``"oblique"`` from the front
        and above; ``"auto"`` takes the sensor's view where there is one. A vector points away from the viewer.
    size : (int, int)
        Width and height, in pixels.
    crop : bool
        Make the picture no larger than the cloud and the legend need.
    color_by : {"grey", "rgb", "intensity", "height", "normals"}
        Color of the surface: none but its shading; the colors or the intensity that the cloud carries; z, from violet
        to green; or the slope, with x, y, z of the normal as red, green, blue.
    edge_color : {"kind", "strength"}
        Color of the edge points: `edgel.plot.palette.KIND_COLORS`, or from light green, the weakest, to violet.
    background : {"light", "dark"}
        What the picture is drawn on.
    legend : bool
        Say below the cloud what the colors mean, and how long things are: the bar in units of the cloud, in perspective
        at half of what is seen.
    detail : ((3,) array_like, float), optional
        Show only what lies around a place, and how wide a piece, in the cloud's unit.

    Returns
    -------
    (height, width, 3) uint8
        RGB.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no finite coordinates or not what it shall be colored by, `edges` are of another cloud, an
        option is out of its range, or the legend leaves no room for the cloud.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> from edgel import plot
    >>> x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    >>> plot.save("roof.png", plot.picture(roof, edgel.detect(roof), size=(400, 300)))
    """
    look = {"direction": direction, "size": size, "crop": crop, "color_by": color_by, "edge_color": edge_color}
    return Drawing(points, edges, **look, legend=legend, detail=detail).on(background)


def render(
    points: Any,
    *,
    rows_on_top: Any = None,
    direction: Any = "auto",
    size: tuple[int, int] = (1200, 900),
    crop: bool = False,
    margin: float = 0.03,
    normals: Any = None,
    point_radius: float | None = None,
    greys: tuple[int, int] = (105, 232),
    background: str = "light",
) -> np.ndarray:
    """Draw a cloud in grey, and some of its points in red on top of it (fig. 4 of the paper).

    Parameters
    ----------
    points, direction, size, background
        As for `picture`.
    rows_on_top : (E,) int or (N,) bool, optional
        Rows drawn red: the edge points. Those hidden behind nearer parts of the cloud are not drawn.
    crop : bool
        Make the picture no larger than the cloud needs.
    margin : float
        Free rim, as a share of the smaller side.
    normals : (N, 3) array_like, optional
        Unit normals to shade by; by default the shape is taken from the picture's own depth.
    point_radius : float, optional
        Radius of a point, in pixels; by default chosen from the spacing, so that dense clouds have no holes.
    greys : (int, int)
        Grey of the darkest and of the lightest slope, 0 to 255.

    Returns
    -------
    (height, width, 3) uint8
        RGB.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no finite coordinates, or an option is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> from edgel import plot
    >>> plot.render(np.random.default_rng(0).random((1000, 3)), size=(400, 300)).shape
    (300, 400, 3)
    """
    scene = Scene(points, direction=direction, size=size, crop=crop, margin=margin, point_radius=point_radius)
    picture = _greys(
        scene, scene.shaded_by_slope() if normals is None else scene.shaded_by_normal(normals), greys, background
    )
    if rows_on_top is not None:
        picture[scene.on_top(check_rows(rows_on_top, scene.num_input)) >= 0] = ANY_KIND
    return reduced(Image.fromarray(picture))


def arrows(
    points: Any,
    at: Any,
    normals: Any,
    *,
    direction: Any = "auto",
    size: tuple[int, int] = (1200, 900),
    crop: bool = False,
    spacing: float = 0.035,
    length: float = 0.08,
    background: str = "light",
) -> np.ndarray:
    """Draw a cloud in grey, points of it in red, and the normals of an even selection of those as arrows (fig. 5).

    Parameters
    ----------
    points, direction, size, crop, background
        As for `render`.
    at : (E,) int or (N,) bool
        Rows of the points in red.
    normals : (E, 3) array_like
        Their unit normals; NaN where there is none.
    spacing : float
        Side of the cells of the picture that get one arrow each, as a share of its smaller side.
    length : float
        Length of an arrow seen from the side, in the same share; those that point at the viewer look shorter.

    Returns
    -------
    (height, width, 3) uint8
        RGB.

    Raises
    ------
    TypeError, ValueError
        As for `render`, and if there is not one normal for each point in red.
    """
    rows = check_rows(at, len(as_cloud(points)))
    normals = np.asarray(normals, float)
    if normals.shape != (len(rows), 3):
        raise ValueError(f"normals: expected ({len(rows)}, 3), one for each point in red, got {normals.shape}")
    scene = Scene(points, direction=direction, size=size, crop=crop, margin=length, point_radius=None)
    picture = _greys(scene, scene.shaded_by_slope(), _PALE[background], background)
    picture[scene.on_top(rows) >= 0] = ANY_KIND
    image = Image.fromarray(picture)
    unit = min(scene.width, scene.height)
    known = np.flatnonzero(np.isfinite(normals).all(axis=1))
    chosen, starts = scene.spread(rows[known], spacing * unit)
    along = normals[known[chosen]] @ np.column_stack([scene.camera.right, -scene.camera.up])
    _draw_arrows(ImageDraw.Draw(image), starts, starts + along * length * unit, max(1.4 * FINE, unit / 360))
    return reduced(image)


def save(path: str | os.PathLike[str], picture: np.ndarray) -> None:
    """Write a picture (H, W, 3) uint8 as PNG, in one step.

    Raises
    ------
    OSError
        If it cannot be written there.
    """
    with replacing(path) as file:
        Image.fromarray(picture).save(file, format="PNG", optimize=True)


def _greys(scene: Scene, shade: np.ndarray, greys: tuple[int, int], background: str) -> np.ndarray:
    """Paint the shade of a scene between two greys, (height, width, 3) uint8."""
    levels = (greys[0] + (greys[1] - greys[0]) * shade + 0.5).astype(np.uint8)
    painted = levels[..., None].repeat(3, axis=2)
    painted[~scene.covered] = sheet_of(background).paper
    return painted


def _draw_arrows(draw: ImageDraw.ImageDraw, starts: np.ndarray, stops: np.ndarray, width: float) -> None:
    """Draw a shaft and a head for each arrow, a dot where it points at the viewer."""
    for start, stop in zip(starts, stops, strict=True):
        length = float(np.hypot(*(stop - start)))
        if length < 3 * width:
            draw.ellipse([*(start - width), *(start + width)], fill=ARROW_COLOR)
            continue
        along = (stop - start) / length
        across = np.array([-along[1], along[0]])
        head = min(5.0 * width, 0.6 * length)
        neck = stop - along * head
        draw.line([tuple(start), tuple(neck)], fill=ARROW_COLOR, width=round(width))
        draw.polygon(
            [tuple(stop), tuple(neck + 0.4 * head * across), tuple(neck - 0.4 * head * across)], fill=ARROW_COLOR
        )
