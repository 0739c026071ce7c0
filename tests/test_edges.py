"""The answer itself: its parts, what it writes into a cloud, and that every format keeps that."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

import edgel
from edgel import EdgeKind, Edges
from edgel._faces import Faces
from edgel.edges import as_kinds, kind_names

NAN = np.nan
LABELS = ["edge_kind", "edge_strength", "edge_angle", "edge_convex", "nx", "ny", "nz"]
MORE = ["nx2", "ny2", "nz2", "tx", "ty", "tz", "edge_x", "edge_y", "edge_z", "edge_std", "edge_scale"]


def cloud_of_five():
    points = np.array([[0.0, 0, 0], [1, 0.25, 3], [2, 0, 0], [NAN, 0, 0], [4, 5, 0]]) + [500_000, 5_000_000, 0]
    return edgel.Cloud(points, {"intensity": np.arange(5, dtype=np.uint16)}, crs="EPSG:25832")


def edges_of_three(kind=(EdgeKind.CREASE, EdgeKind.BOUNDARY | EdgeKind.CREASE, EdgeKind.OCCLUDED)):
    """A convex crease, a concave one at the boundary, and a point whose neighbours span no plane."""
    index = np.array([0, 1, 4])
    normals = np.full((3, 2, 3), NAN)
    normals[0], normals[1, 0], normals[1, 1] = [[0, 0, 1], [1, 0, 0]], [0, 0.6, 0.8], [0, 0, 1]
    direction = np.full((3, 3), NAN)
    direction[:2] = [[0, 1, 0], [1, 0, 0]]
    return Edges(
        index=index,
        kind=np.array(kind, np.uint8),
        strength=np.array([1.0, 0.5, 0.1]),
        position=cloud_of_five().xyz[index] + [0.001, 0, 0],
        position_std=np.array([0.01, 0.002, NAN]),
        scale=np.array([0.5, 2.0, NAN]),
        direction=direction,
        normals=normals,
        angle=np.array([np.pi / 2, np.arccos(0.8), NAN]),
        convex=np.array([1, -1, 0], np.int8),
        orientation="sensor",
        num_points=5,
        num_dropped=1,
        method="surface",
        reason="",
        parameters={},
        seconds={},
    )


def test_counts_and_shares():
    edges = edges_of_three()
    assert len(edges) == 3
    assert edges.share == 0.75
    assert edges.num_without_normal == 1
    assert edges.count_kinds() == {"boundary": 1, "occluded": 1, "crease": 2}
    assert edges.median_crease_angle == pytest.approx((np.pi / 2 + np.arccos(0.8)) / 2)
    assert np.isnan(edges.of_kinds("occluded").median_crease_angle)
    assert repr(edges) == "Edges(3 of 5 points, 75.0%, 1 not finite; method surface)"


def test_those_inside_a_box():
    edges, cloud = edges_of_three(), cloud_of_five()
    low, high = [-np.inf, 5_000_000.25, -np.inf], [500_001, np.inf, np.inf]
    np.testing.assert_array_equal(edges.crop(cloud, [low, high]).index, [1])  # on two faces of the box
    assert len(edges.crop(cloud, [[-np.inf] * 3, [np.inf] * 3])) == 3
    for none in ([high, low], [0, 1], [[np.nan] * 3, high]):
        with pytest.raises(ValueError, match="box: expected a lower and an upper corner"):
            edges.crop(cloud, none)


def test_only_some_kinds():
    edges = edges_of_three()
    assert edges.of_kinds(["boundary", "occluded", "crease"]) is edges
    found = edges.of_kinds("crease")
    assert found.index.tolist() == [0, 1]
    assert found.kind.tolist() == [8, 8]
    assert found.kind.dtype == np.uint8
    assert found.convex.tolist() == [1, -1]
    assert found.normals.shape == (2, 2, 3)
    assert len(edges.of_kinds("color")) == 0


def test_parts_of_the_published_answer_keep_their_planes():
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    found = edgel.paper.detect(np.c_[x.ravel(), y.ravel(), 9.0 * (x.ravel() > 15)])
    half = found.take(np.arange(len(found)) % 2 == 0)
    np.testing.assert_array_equal(half.planes.normals, half.normals[:, 0])
    assert half.image is found.image


def test_kinds_by_name():
    assert as_kinds("color") == as_kinds(EdgeKind.COLOR) == EdgeKind.COLOR
    assert as_kinds(np.uint8(9)) == as_kinds(9) == EdgeKind.CREASE | EdgeKind.BOUNDARY  # pyright: ignore[reportArgumentType]
    assert kind_names(as_kinds(["Crease", "occluding"])) == ["occluding", "crease"]


def test_one_face_leaves_the_rest_unknown():
    fields = vars(Faces.of_points(np.zeros((3, 3)), np.eye(3)))
    assert set(fields) < {field.name for field in dataclasses.fields(Edges)}
    np.testing.assert_array_equal(fields["normals"][:, 0], np.eye(3))
    for name in ("direction", "angle", "position_std"):
        assert np.isnan(fields[name]).all()
    assert np.isnan(fields["normals"][:, 1]).all()
    assert Faces.of_points(np.empty((0, 3)), np.empty((0, 3))).normals.shape == (0, 2, 3)


def test_the_cloud_of_the_edge_points():
    cloud, edges = cloud_of_five(), edges_of_three()
    found = edges.to_cloud(cloud)
    assert list(found.attributes) == ["intensity", *LABELS, *MORE]
    assert found.crs == cloud.crs
    np.testing.assert_array_equal(found.xyz, cloud.xyz[edges.index])
    np.testing.assert_array_equal(found.attributes["edge_x"], edges.position[:, 0])
    np.testing.assert_array_equal(found.attributes["edge_std"], np.array([0.01, 0.002, NAN], np.float32))
    np.testing.assert_array_equal(found.attributes["nx2"], np.array([1, 0, NAN], np.float32))
    np.testing.assert_array_equal(found.attributes["ty"], np.array([1, 0, NAN], np.float32))
    types = {"edge_kind": "u1", "edge_convex": "i1", "edge_x": "f8", "edge_y": "f8", "edge_z": "f8"}
    for name in [*LABELS, *MORE]:
        assert found.attributes[name].dtype == types.get(name, "f4"), name


def test_the_labelled_cloud():
    cloud = cloud_of_five()
    found = edges_of_three().label(cloud)
    assert list(found.attributes) == ["intensity", *LABELS]
    assert found.attributes["edge_kind"].tolist() == [8, 9, 0, 0, 4]
    assert found.attributes["edge_convex"].tolist() == [1, -1, 0, 0, 0]
    np.testing.assert_array_equal(
        found.attributes["edge_angle"], np.array([np.pi / 2, np.arccos(0.8), NAN, NAN, NAN], np.float32)
    )
    np.testing.assert_array_equal(found.attributes["nz"], np.array([1, 0.8, NAN, NAN, NAN], np.float32))
    organized = edgel.Cloud(cloud.xyz[:4].reshape(2, 2, 3))
    edges = edges_of_three().take(np.array([0, 1]))
    assert edges.label(organized).shape == (2, 2)


@pytest.mark.parametrize("whole", [False, True], ids=["edge points", "whole cloud"])
@pytest.mark.filterwarnings("ignore:.*coordinates:edgel.FormatWarning")  # PCD shifts these
@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".las", ".laz", ".xyz", ".csv", ".npy", ".npz", ".e57"])
def test_every_format_but_pts_keeps_what_is_known_of_the_edges(tmp_path, suffix, whole):
    if suffix == ".e57":
        pytest.importorskip("pye57")
    cloud, edges = cloud_of_five(), edges_of_three()
    written = edges.label(cloud) if whole else edges.to_cloud(cloud)
    if whole and suffix in (".las", ".laz", ".e57"):  # these hold no points without a place
        written = written.take(np.flatnonzero(np.isfinite(written.xyz).all(axis=1)))
    edgel.write(tmp_path / f"a{suffix}", written)
    found = edgel.read(tmp_path / f"a{suffix}")
    np.testing.assert_allclose(
        found.xyz, written.xyz, rtol=0, atol=1e-6 if suffix in (".las", ".laz", ".pcd") else 1e-9
    )

    for name in LABELS if whole else [*LABELS, *MORE]:
        values = found.attributes[name]
        np.testing.assert_array_equal(values, written.attributes[name], err_msg=name)
        if suffix == ".ply" and values.dtype.kind == "i":  # Open3D reads no shorter integers with a sign
            assert values.dtype == np.int32, name
        elif suffix not in (".xyz", ".csv"):  # a text has no types
            assert values.dtype == written.attributes[name].dtype, name


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".las", ".xyz", ".npz"])
def test_no_edges_can_be_written_too(tmp_path, suffix):
    none = edges_of_three().of_kinds("color")
    edgel.write(tmp_path / f"a{suffix}", none.to_cloud(cloud_of_five()))
    found = edgel.read(tmp_path / f"a{suffix}")
    assert len(found) == 0
    assert {*LABELS, *MORE} <= set(found.attributes)


def test_columns_of_the_input_make_room():
    points = np.random.default_rng(0).random((300, 3))
    edges = edgel.paper.detect(points)
    own = {name: np.arange(300.0) for name in ("NX", "ny", "input_ny", "tx", "label", " edge_kind")}
    whole, some = edges.label(edgel.Cloud(points, own)), edges.to_cloud(edgel.Cloud(points, own))
    for cloud, rows in ((whole, np.arange(300)), (some, edges.index)):
        for name in ("input_NX", "input_ny_2", "input_ny", "label", "input_edge_kind"):
            assert np.array_equal(cloud.attributes[name], rows)
        assert cloud.attributes["edge_kind"].dtype == np.uint8
        assert not {"NX", " edge_kind"} & set(cloud.attributes)
    assert np.array_equal(whole.attributes["tx"], np.arange(300))  # label has no tangent
    assert np.array_equal(some.attributes["input_tx"], edges.index)


def test_edges_of_a_scale_are_those_in_between_and_those_whose_scale_is_not_known():
    edges = edges_of_three()
    assert edges.of_scale(1.0).index.tolist() == edges.index[1:].tolist()
    assert edges.of_scale(high=1.0).index.tolist() == edges.index[[0, 2]].tolist()
    with pytest.raises(ValueError, match="low, high: expected two lengths"):
        edges.of_scale(2.0, 1.0)


def test_edges_are_joined_by_row_and_the_first_ones_count():
    edges = edges_of_three()
    other = replace(edges, strength=edges.strength / 2)
    joined = edges.take(np.array([0, 2])).join(other)
    assert joined.index.tolist() == edges.index.tolist()
    assert joined.strength.tolist() == [edges.strength[0], other.strength[1], edges.strength[2]]
