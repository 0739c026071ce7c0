"""What other libraries hold a cloud in is taken as it is, with what it says of each point."""

from types import SimpleNamespace

import laspy
import numpy as np
import pytest

import edgel
from edgel.cloud import as_cloud

FIELDS = [("y", "f4"), ("X", "f8"), ("z", "i2"), ("label", "u1"), ("rest", "f4", (2,))]
RECORDS = np.zeros(6, FIELDS)
RECORDS["X"], RECORDS["y"], RECORDS["z"], RECORDS["label"] = np.arange(6), 0.5, [3, 1, 4, 1, 5, 9], np.arange(6) % 2
XYZ = np.column_stack([RECORDS["X"], RECORDS["y"], RECORDS["z"]])


def test_records():
    for points in (RECORDS, RECORDS.view(np.recarray), RECORDS[::-1][::-1]):
        cloud = as_cloud(points)
        np.testing.assert_array_equal(cloud.xyz, XYZ)
        assert {name: values.dtype.str for name, values in cloud.attributes.items()} == {"label": "|u1", "rest": "<f4"}
        assert cloud.attributes["rest"].shape == (6, 2)
    grid = as_cloud(RECORDS.reshape(2, 3))
    assert grid.shape == (2, 3)
    np.testing.assert_array_equal(grid.attributes["label"], RECORDS["label"])


def test_masked_records_are_missing():
    masked = np.ma.array(RECORDS[["X", "y", "z", "label"]])
    masked["X"][2] = np.ma.masked
    cloud = as_cloud(masked)
    assert np.isnan(cloud.xyz[2, 0])
    np.testing.assert_array_equal(np.isnan(cloud.xyz).sum(), 1)


@pytest.mark.parametrize("fields", [[("x", "f4"), ("y", "f4")], [("x", "f4"), ("y", "f4"), ("z", "O")]])
def test_records_without_coordinates(fields):
    with pytest.raises(TypeError, match="x, y and z are needed"):
        edgel.detect(np.zeros(5, fields))


def test_detect_takes_them():
    rng = np.random.default_rng(0)
    points = np.zeros(500, FIELDS)
    for name in ("X", "y"):
        points[name] = rng.random(500)
    expected = edgel.detect(np.column_stack([points["X"], points["y"], points["z"]]))
    edges = edgel.detect(points)
    np.testing.assert_array_equal(edges.index, expected.index)
    assert "label" in edges.to_cloud(points).attributes


def test_plyfile():
    plyfile = pytest.importorskip("plyfile")
    vertices = plyfile.PlyElement.describe(
        RECORDS[["X", "y", "z", "label"]].astype([(n, "f4") for n in "xyzl"]), "vertex"
    )
    for points in (vertices, plyfile.PlyData([vertices])):
        cloud = as_cloud(points)
        np.testing.assert_array_equal(cloud.xyz, XYZ)
        np.testing.assert_array_equal(cloud.attributes["l"], RECORDS["label"])


def test_laspy():
    las = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
    las.xyz = XYZ
    las.classification = RECORDS["label"]
    cloud = as_cloud(las)
    np.testing.assert_allclose(cloud.xyz, XYZ, atol=1e-2)
    np.testing.assert_array_equal(cloud.attributes["classification"], RECORDS["label"])
    assert not {"X", "Y", "Z"} & set(cloud.attributes)


def test_open3d():
    o3d = pytest.importorskip("open3d", reason="the extra export is not installed")
    tensors = o3d.t.geometry.PointCloud(o3d.core.Tensor(XYZ))
    tensors.point.colors = o3d.core.Tensor(np.tile([0, 0.2, 1], (6, 1)))
    tensors.point.label = o3d.core.Tensor(RECORDS["label"][:, None])
    cloud = as_cloud(tensors)
    np.testing.assert_array_equal(cloud.xyz, XYZ)
    np.testing.assert_array_equal(cloud.attributes["label"], RECORDS["label"])
    for points in (tensors, tensors.to_legacy()):
        found = as_cloud(points).attributes
        assert [int(found[name][0]) for name in ("red", "green", "blue")] == [0, 51, 255]


def test_tables_and_others():
    table = SimpleNamespace(to_records=lambda index: RECORDS)  # as a table of pandas does
    np.testing.assert_array_equal(as_cloud(table).xyz, XYZ)
    for name in ("xyz", "points"):
        np.testing.assert_array_equal(as_cloud(SimpleNamespace(**{name: XYZ})).xyz, XYZ)
