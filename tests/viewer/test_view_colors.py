"""Colors of clouds and edges in the viewer."""

from dataclasses import replace

import numpy as np
from hall import TIMEOUT, hall

import edgel
from edgel import EdgeKind, plot
from edgel._viewer.colors import cloud_colors, colorings, edge_colors
from edgel._viewer.settings import Coloring
from edgel.plot.palette import KIND_COLORS


def test_colors_are_offered_where_the_file_has_them(open_session, tmp_path):
    xyz = hall()
    red = np.linspace(0, 255, len(xyz)).astype(np.uint8)
    color = {"red": red, "green": red[::-1], "blue": red // 2}
    edgel.write(tmp_path / "rgb.ply", edgel.Cloud(xyz, {**color, "intensity": red}))
    edgel.write(tmp_path / "plain.ply", edgel.Cloud(xyz))
    session = open_session([str(tmp_path / "rgb.ply"), str(tmp_path / "plain.ply")])
    assert session.wait_idle(TIMEOUT)
    rgb, plain = session.sources
    assert set(colorings(rgb)) == set(Coloring)
    assert set(colorings(plain)) == {Coloring.GREY, Coloring.HEIGHT, Coloring.NORMALS}
    own = cloud_colors(rgb, rgb.few, Coloring.OWN, np.eye(3))
    np.testing.assert_allclose(own, np.column_stack(list(color.values())), atol=1)
    for coloring in Coloring:
        drawn = cloud_colors(rgb, rgb.few, coloring, np.eye(3))
        assert drawn.shape == xyz.shape
        assert drawn.dtype == np.uint8
        assert drawn.std() > 5


def test_heights_wear_the_colors_of_pictures(open_session, tmp_path):
    x, y = np.meshgrid(np.arange(200.0), np.arange(100.0))
    steps = np.c_[x.ravel(), y.ravel(), 10 * np.floor(x.ravel() / 50)]  # four level terraces
    edgel.write(tmp_path / "steps.ply", edgel.Cloud(steps))
    session = open_session([str(tmp_path / "steps.ply")])
    assert session.wait_idle(TIMEOUT)
    (source,) = session.sources
    on_page = cloud_colors(source, source.few, Coloring.HEIGHT, np.eye(3)).astype(int)
    drawn = plot.picture(source.cloud, direction=[0, 0, -1], color_by="height", size=(800, 600)).astype(int)
    for terrace in range(4):
        middle = np.flatnonzero((steps[:, 0] == 50 * terrace + 25) & (steps[:, 1] == 50))[0]
        assert (abs(drawn - on_page[middle]).max(axis=2) <= 6).sum() > 5000


def test_unlikely_edges_are_pale():
    edges = edgel.detect(hall())
    creases = edges.take(edges.kind == EdgeKind.CREASE).take(np.arange(3))
    colors = edge_colors(replace(creases, strength=np.array([0.2, 0.35, 0.5])), by_strength=False, least=0.2)
    away = abs(colors.astype(int) - KIND_COLORS[EdgeKind.CREASE]).sum(axis=1)
    assert away[0] > away[1] > away[2] == 0
    assert (colors[:2].min(axis=1) < 200).all()  # and yet of their kind


def test_edge_colors_tell_kinds_and_strength():
    edges = edgel.detect(hall())
    crease = edges.kind == EdgeKind.CREASE
    assert (edge_colors(edges, by_strength=False, least=0.5)[crease] == KIND_COLORS[EdgeKind.CREASE]).all()
    by_strength = edge_colors(edges, by_strength=True, least=0.5).astype(int).sum(axis=1)
    assert by_strength[edges.strength.argmin()] > by_strength[edges.strength.argmax()]
