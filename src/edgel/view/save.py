"""What a pane shows, as files for the browser to download."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import edgel
from edgel.view.commands import output_name
from edgel.view.select import in_box
from edgel.view.session import Pane

_SIZE = (1600, 1200)


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
        edgel.write(Path(folder) / name, pane.edges.cloud(pane.cloud))
        return name, (Path(folder) / name).read_bytes()


def picture_file(pane: Pane, direction: np.ndarray) -> tuple[str, bytes]:
    """Draw the part of the cloud that a pane shows, with its edges, along a direction (3,) of the cloud, as PNG."""
    from edgel import plot  # not at the top: Pillow takes time to import

    assert pane.edges is not None
    cloud = pane.cloud
    on_top = np.zeros(len(cloud), bool)
    on_top[pane.edges.index] = True
    inside = in_box(cloud.xyz, pane.box)
    picture = plot.render(cloud.take(inside), rows_on_top=on_top[inside], direction=direction, size=_SIZE)
    name = output_name(pane, ".png")
    with tempfile.TemporaryDirectory() as folder:
        plot.save(Path(folder) / name, picture)
        return name, (Path(folder) / name).read_bytes()
