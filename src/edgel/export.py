"""Edges handed on: to notebooks, Matplotlib, Open3D, PyVista and pandas, each imported only when it is asked for.

None of them has the points of the cloud, which `Edges` does not keep: edge points lie at `Edges.position`.
"""

from __future__ import annotations

import base64
import html
import importlib
import io
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
from PIL import Image

from edgel.cloud import Cloud, check_points
from edgel.edges import EdgeKind, Edges, kind_names
from edgel.plot import picture
from edgel.plot.palette import KIND_COLORS, as_hex, kind_colors

_SIZE = (640, 480)  # of the picture in a notebook, in pixels
_DRAWN = 20_000  # points of a cloud that Matplotlib draws behind its edges: more take long, and show no more


def as_html(edges: Edges) -> str:
    """Return what a notebook shows of edges: a picture of the edge points alone, and their number by kind."""
    shown = f"<div><p><b>{html.escape(repr(edges))}</b></p>"
    if not len(edges):
        return shown + "</div>"
    rows = ""
    for name, number in edges.count_kinds().items():
        square = f'<span style="color:{as_hex(KIND_COLORS[EdgeKind[name.upper()]])}">&#9632;</span>'
        share = number / (edges.num_points - edges.num_dropped)
        rows += f'<tr><td style="text-align:left">{square} {name}</td><td>{number:,}</td><td>{share:.2%}</td></tr>'
    table = f"<table><tr><th>kind</th><th>edge points</th><th>of all points</th></tr>{rows}</table>"
    with io.BytesIO() as file:
        alone = replace(edges, index=np.arange(len(edges)), num_points=len(edges), num_dropped=0)
        Image.fromarray(picture(edges.position, alone, size=_SIZE)).save(file, format="PNG", optimize=True)
        image = base64.b64encode(file.getvalue()).decode()
    note = "The edge points alone; <code>edgel.plot.picture(cloud, edges)</code> draws them on their cloud."
    return f'{shown}{table}<img src="data:image/png;base64,{image}" alt="The edge points"><p>{note}</p></div>'


def draw(edges: Edges, axes: Any, points: Any) -> Any:
    """Scatter edges in Matplotlib axes; see `Edges.plot`."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plot() needs Matplotlib: pip install 'edgel[plot]', or pip install matplotlib") from error

    axes = pyplot.figure().add_subplot(projection="3d") if axes is None else axes
    count = 3 if hasattr(axes, "get_zlim") else 2
    if points is not None:
        xyz = check_points(points, minimum=1).xyz
        if len(xyz) > _DRAWN:
            xyz = xyz[np.sort(np.random.default_rng(0).choice(len(xyz), _DRAWN, replace=False))]
        axes.scatter(*xyz.T[:count], s=0.5, color="0.8", linewidths=0)
    first = np.select([(edges.kind & int(kind)) > 0 for kind in KIND_COLORS], [int(kind) for kind in KIND_COLORS])
    for kind, color in KIND_COLORS.items():
        at = edges.position[first == kind]
        if len(at):
            axes.scatter(*at.T[:count], s=3, color=as_hex(color), linewidths=0, label=kind_names(kind)[0])
    axes.set_aspect("equal")
    for name in "xyz"[:count]:
        axes.set(**{f"{name}label": name})
    if len(edges):
        axes.legend(markerscale=3)
    return axes


def to_open3d(edges: Edges) -> Any:
    """Make an ``open3d.geometry.PointCloud``; see `Edges.to_open3d`."""
    open3d = _optional("open3d")
    made = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(edges.position))
    made.colors = open3d.utility.Vector3dVector(kind_colors(edges.kind) / 255.0)
    made.normals = open3d.utility.Vector3dVector(edges.normals[:, 0])
    return made


def to_pyvista(edges: Edges) -> Any:
    """Make a ``pyvista.PolyData``; see `Edges.to_pyvista`."""
    made = _optional("pyvista").PolyData(edges.position)
    for name, values in _columns(edges).items():
        made.point_data[name] = values
    made.point_data["rgb"] = kind_colors(edges.kind)
    return made


def to_dataframe(edges: Edges) -> Any:
    """Make a ``pandas.DataFrame``; see `Edges.to_dataframe`."""
    return _optional("pandas").DataFrame(_columns(edges))


def _columns(edges: Edges) -> dict[str, np.ndarray]:
    """The columns that `Edges.to_cloud` gives a file, after the row of the input."""
    described = replace(edges, index=np.arange(len(edges))).to_cloud(Cloud(edges.position))
    return {"index": edges.index, **described.attributes}


def _optional(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{name} is not installed; get it with: pip install {name}") from error
