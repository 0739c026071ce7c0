"""Edges in notebooks and in other libraries: the same points, colors and columns, and a clear word where one lacks."""

import base64
import io
import pickle
import re
import sys
import threading

import numpy as np
import pytest
from PIL import Image

import edgel
from edgel import EdgeKind
from edgel.plot import palette


@pytest.fixture(scope="module")
def cloud():
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    return edgel.Cloud(np.column_stack([x.ravel(), y.ravel(), -np.abs(x.ravel() - 20)]))


@pytest.fixture(scope="module")
def edges(cloud):
    return edgel.detect(cloud)


def image_in(page):
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data, validate=True))))


def test_a_notebook_shows_picture_and_numbers(edges):
    page = edges._repr_html_()
    for name, number in edges.count_kinds().items():
        assert f"{name}</td><td>{number:,}</td>" in page
        assert palette.as_hex(palette.KIND_COLORS[EdgeKind[name.upper()]]) in page
    assert "edge points alone" in page
    shown = image_in(page)
    assert shown.shape == (480, 640, 3)
    for kind in (EdgeKind.CREASE, EdgeKind.BOUNDARY):
        assert (shown == palette.KIND_COLORS[kind]).all(axis=2).sum() > 50


def test_a_notebook_shows_that_there_are_no_edges(edges):
    page = edges.take(np.empty(0, int))._repr_html_()
    assert "0 of 1,200 points" in page
    assert "<img" not in page


def test_a_notebook_draws_with_viser_where_it_is(cloud, edges, monkeypatch, capsys):
    """The page holds itself, and no server is left behind."""
    pytest.importorskip("viser")
    pytest.importorskip("IPython")
    before = {thread.name for thread in threading.enumerate()}
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    shown = edges.plot(points=cloud).data
    assert shown.startswith("<div><iframe srcdoc=")
    assert capsys.readouterr().out == ""
    assert "&lt;html" in shown
    assert not {thread.name for thread in threading.enumerate() if "viser" in thread.name.lower()} - before
    monkeypatch.delitem(sys.modules, "ipykernel")
    assert hasattr(edges.plot(), "get_zlim")


def test_other_backends_are_checked(edges):
    with pytest.raises(ValueError, match="backend: expected auto, matplotlib, pyvista, viser"):
        edges.plot(backend="plotly")
    with pytest.raises(ValueError, match="leave them out for viser"):
        edges.plot(object(), backend="viser")


def test_edges_keep_no_cloud(edges):
    assert len(pickle.dumps(edges)) < len(edges) * 140 + 2000


def test_a_table_has_the_columns_of_the_file(cloud, edges):
    pytest.importorskip("pandas")
    table = edges.to_dataframe()
    written = edges.to_cloud(cloud).attributes
    assert list(table.columns) == ["index", *written]
    assert table["index"].tolist() == edges.index.tolist()
    for name, values in written.items():
        np.testing.assert_array_equal(table[name], values)


def test_open3d_gets_places_colors_and_normals(edges):
    pytest.importorskip("open3d")
    made = edges.to_open3d()
    np.testing.assert_array_equal(made.points, edges.position)
    np.testing.assert_array_equal(made.normals, edges.normals[:, 0])
    np.testing.assert_allclose(np.asarray(made.colors) * 255, palette.kind_colors(edges.kind))


def test_pyvista_gets_places_and_columns(cloud, edges):
    pytest.importorskip("pyvista")
    made = edges.to_pyvista()
    np.testing.assert_array_equal(made.points, edges.position)
    assert set(made.point_data.keys()) == {"index", "rgb", *edges.to_cloud(cloud).attributes}
    np.testing.assert_array_equal(made.point_data["rgb"], palette.kind_colors(edges.kind))


@pytest.mark.parametrize("name", ["open3d", "pyvista", "pandas"])
def test_what_is_not_installed_is_named_with_its_remedy(edges, monkeypatch, name):
    monkeypatch.setitem(sys.modules, name, None)
    method = {"open3d": edges.to_open3d, "pyvista": edges.to_pyvista, "pandas": edges.to_dataframe}[name]
    with pytest.raises(ImportError, match=f"pip install {name}"):
        method()


@pytest.fixture
def figure():
    from matplotlib import pyplot

    pyplot.switch_backend("agg")
    yield pyplot.figure()
    pyplot.close("all")


@pytest.mark.parametrize("projection", ["3d", None])
def test_matplotlib_draws_each_point_once_in_the_color_of_its_kind(cloud, edges, figure, projection):
    axes = edges.plot(figure.add_subplot(projection=projection), points=cloud)
    behind, *drawn = axes.collections
    assert len(behind.get_offsets()) == len(cloud)
    assert sum(len(one.get_offsets()) for one in drawn) == len(edges)
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names == list(edges.count_kinds())
    for one, name in zip(drawn, names, strict=True):
        color = np.array(palette.KIND_COLORS[EdgeKind[name.upper()]]) / 255
        np.testing.assert_allclose(one.get_facecolor()[0][:3], color, atol=1e-6)
    figure.canvas.draw()


def test_matplotlib_axes_are_made_where_none_are_given(edges, figure):
    axes = edges.take(np.empty(0, int)).plot()
    assert axes.name == "3d"
    assert axes.get_legend() is None
