"""What the viewer saves: edges and pictures."""

import io
from dataclasses import replace

import numpy as np
import pytest
from hall import TIMEOUT
from PIL import Image

import edgel
from edgel import plot
from edgel._viewer.save import edges_file, picture_file
from edgel._viewer.settings import Coloring, Settings
from edgel.cloud import in_box


@pytest.mark.parametrize("extension", [".ply", ".pcd", ".npz", ".xyz"])
def test_saved_edges_are_those_of_detect(open_session, hall_file, extension, tmp_path):
    session = open_session([hall_file])
    assert session.wait_idle(TIMEOUT)
    name, content = edges_file(session.panes()[0], extension)
    assert name == f"a hall_edges{extension}"
    (tmp_path / name).write_bytes(content)
    written, cloud = edgel.read(tmp_path / name), edgel.read(hall_file)
    edges = edgel.detect(cloud)
    single = extension == ".pcd"  # the only precision that PCL reads
    np.testing.assert_allclose(written.xyz, cloud.xyz[edges.index], rtol=1e-7 if single else 0)


def test_picture_shows_what_is_seen(open_session, hall_file):
    session = open_session([hall_file])
    settings = Settings(crop=((0.0, 0.5), (0.0, 1.0), (0.0, 1.0)), coloring=Coloring.HEIGHT, by_strength=True)
    session.settings = settings
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    name, content = picture_file(pane, np.array([0.0, 0.0, -1.0]), settings)
    assert name == "a hall_edges.png"
    shown = np.asarray(Image.open(io.BytesIO(content)))
    cloud = pane.cloud.take(in_box(pane.cloud.xyz, pane.box))
    rows = np.flatnonzero((cloud.xyz[:, None] == pane.cloud.xyz[pane.edges.index]).all(axis=2).any(axis=1))
    edges = replace(pane.edges, index=rows, num_points=len(cloud))
    look = {"color_by": "height", "edge_color": "strength", "size": (1600, 1200)}
    np.testing.assert_array_equal(shown, plot.picture(cloud, edges, direction=[0, 0, -1], **look))
