"""Edges handed on: to notebooks, Matplotlib, Open3D, PyVista and pandas, each imported only when it is asked for.

None of them has the points of the cloud, which `Edges` does not keep: edge points lie at `Edges.position`.
"""

from __future__ import annotations

import base64
import html
import importlib
import importlib.util
import io
import sys
from contextlib import redirect_stdout
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
_WIDE, _DOT = 4.0, 0.02  # of the whole and of a point in viser, whose camera is made for things of some units
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


def draw(edges: Edges, axes: Any, points: Any, backend: str) -> Any:
    """Draw edges by Matplotlib, PyVista or viser; see `Edges.plot`."""
    drawn_by = {"matplotlib": _in_matplotlib, "pyvista": _in_pyvista, "viser": _in_viser}
    if backend == "auto":
        interactive = axes is None and "ipykernel" in sys.modules and importlib.util.find_spec("viser") is not None
        backend = "viser" if interactive else "matplotlib"
    if backend not in drawn_by:
        raise ValueError(f"backend: expected auto, {', '.join(drawn_by)}, got {backend!r:.40}")
    if axes is not None and backend != "matplotlib":
        raise ValueError(f"axes: are Matplotlib's; leave them out for {backend}")
    xyz = np.empty((0, 3))
    if points is not None:
        xyz = check_points(points, minimum=1).xyz
        if len(xyz) > _DRAWN:
            xyz = xyz[np.sort(np.random.default_rng(0).choice(len(xyz), _DRAWN, replace=False))]
    return drawn_by[backend](edges, xyz, axes)


def _in_matplotlib(edges: Edges, xyz: np.ndarray, axes: Any) -> Any:
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plot() needs Matplotlib: pip install 'edgel[plot]', or pip install matplotlib") from error

    axes = pyplot.figure().add_subplot(projection="3d") if axes is None else axes
    count = 3 if hasattr(axes, "get_zlim") else 2
    if len(xyz):
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


def _in_pyvista(edges: Edges, xyz: np.ndarray, _: Any) -> Any:
    plotter = _optional("pyvista").Plotter()
    if len(xyz):
        plotter.add_points(xyz, color="lightgrey", point_size=2)
    if len(edges):
        plotter.add_points(to_pyvista(edges), scalars="rgb", rgb=True, point_size=5)
    return plotter


def _in_viser(edges: Edges, xyz: np.ndarray, _: Any) -> Any:
    """A page of its own within the notebook's: nothing listens once it is made."""
    viser, display = _optional("viser"), _optional("IPython.display")
    places = np.concatenate([edges.position, xyz, np.zeros((0 if len(edges) + len(xyz) else 1, 3))])
    low, high = places.min(axis=0), places.max(axis=0)
    scale = _WIDE / float((high - low).max() or 1.0)
    with redirect_stdout(io.StringIO()):  # its banner
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
        grey = np.full((len(xyz), 3), 200, np.uint8)
        for name, at, colors in (("cloud", xyz, grey), ("edges", edges.position, kind_colors(edges.kind))):
            drawn = ((at - (low + high) / 2) * scale).astype(np.float32)
            if len(drawn):
                server.scene.add_point_cloud(f"/{name}", drawn, colors, point_size=_DOT, precision="float32")
        page = html.escape(server.scene.as_html(), quote=True)
        server.stop()
    frame = f'<iframe srcdoc="{page}" width="100%" height="480" title="The edge points" frameborder="0"></iframe>'
    return display.HTML(f"<div>{frame}</div>")


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
