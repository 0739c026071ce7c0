"""What a pane shows, as files for the browser to download."""

from __future__ import annotations

import io
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import edgel
from edgel._viewer.colors import colorings
from edgel._viewer.commands import output_name
from edgel._viewer.session import Pane
from edgel._viewer.settings import Coloring, Settings
from edgel.cloud import in_box

_SIZE = (1600, 1200)
_COLOR_BY = {
    Coloring.GREY: "grey",
    Coloring.OWN: "rgb",
    Coloring.HEIGHT: "height",
    Coloring.NORMALS: "normals",
    Coloring.INTENSITY: "intensity",
}


def edges_file(pane: Pane, extension: str) -> tuple[str, bytes]:
    """Write the edge points that a pane shows in a format, and return the file's name and content.

    Parameters
    ----------
    pane : Pane
        With edges.
    extension : str
        One of `edgel.io.WRITERS`.

    Raises
    ------
    FormatError, ImportError
        If the format cannot hold them, or needs a package that is not installed.
    """
    assert pane.edges is not None
    name = output_name(pane, extension)
    with tempfile.TemporaryDirectory() as folder:
        edgel.write(Path(folder) / name, pane.edges.to_cloud(pane.cloud))
        return name, (Path(folder) / name).read_bytes()


def picture_file(pane: Pane, direction: np.ndarray, settings: Settings) -> tuple[str, bytes]:
    """Draw what a pane shows along a direction (3,) of the cloud, with a legend; return the PNG's name and content."""
    from edgel import plot  # not at the top: Pillow takes time to import

    assert pane.edges is not None
    inside = in_box(pane.cloud.xyz, pane.box)
    index = (np.cumsum(inside) - 1)[pane.edges.index]
    coloring = settings.coloring if settings.coloring in colorings(pane.source) else Coloring.GREY
    picture = plot.picture(
        pane.cloud.take(inside),
        replace(pane.edges, index=index, num_points=int(inside.sum()), num_dropped=0),
        direction=direction,
        size=_SIZE,
        color_by=_COLOR_BY[coloring],
        edge_color="strength" if settings.by_strength else "kind",
    )
    name = output_name(pane, ".png")
    with tempfile.TemporaryDirectory() as folder:
        plot.save(Path(folder) / name, picture)
        return name, (Path(folder) / name).read_bytes()


def png(grey: np.ndarray) -> bytes:
    """Encode an image (H, W) uint8."""
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(grey).save(content, format="PNG")
    return content.getvalue()
