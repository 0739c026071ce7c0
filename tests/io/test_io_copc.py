"""COPC as other readers see it: laspy's own and copclib."""

import laspy
import numpy as np
import pytest

from edgel import Cloud
from edgel.io import FormatWarning, read, write


@pytest.fixture
def town():
    """100,000 points, denser in one corner, with a time and a column of ours."""
    rng = np.random.default_rng(3)
    plan = np.concatenate([rng.random((60_000, 2)) * 500, rng.random((40_000, 2)) * 40])
    xyz = np.column_stack([plan, 5 * np.sin(plan[:, 0] / 50)]).round(3) + [512_000, 5_400_000, 0]
    return Cloud(xyz, {"gps_time": np.arange(len(xyz)) * 0.25, "edge_kind": rng.integers(0, 9, len(xyz), np.uint8)})


def by_time(cloud):
    order = np.argsort(cloud.attributes["gps_time"])
    return cloud.xyz[order], cloud.attributes["edge_kind"][order]


def test_points_and_columns_come_back(town, tmp_path):
    write(tmp_path / "a.copc.laz", town)
    found = read(tmp_path / "a.copc.laz")
    for mine, theirs in zip(by_time(found), by_time(town), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-9)
    write(tmp_path / "b.copc.laz", found)  # its records of the octree are written anew
    assert len(read(tmp_path / "b.copc.laz")) == len(town)


def test_a_box_and_a_level_are_read_alone(town, tmp_path):
    write(tmp_path / "a.copc.laz", town)
    box = laspy.copc.Bounds(np.array([512_010.0, 5_400_010]), np.array([512_090.0, 5_400_070]))
    with laspy.CopcReader.open(tmp_path / "a.copc.laz") as reader:
        inside = ((town.xyz[:, :2] >= box.mins) & (town.xyz[:, :2] <= box.maxs)).all(axis=1)
        assert len(reader.query(box)) == inside.sum() > 1000
        coarse = reader.query(level=0)
        info = reader.copc_info
    assert 2_000 < len(coarse) < 20_000
    x, y, _ = np.floor(
        (np.column_stack([np.asarray(coarse[axis]) for axis in "xyz"]) - (info.center - info.halfsize)) / info.spacing
    ).T
    assert len(np.unique(np.stack([x, y]), axis=1).T) > 0.8 * len(coarse)  # spread out, one in each cell
    assert info.gps_max == town.attributes["gps_time"].max()


def test_another_library_finds_every_node_in_its_place(town, tmp_path):
    copclib = pytest.importorskip("copclib")
    write(tmp_path / "a.copc.laz", town)
    reader = copclib.FileReader(str(tmp_path / "a.copc.laz"))
    assert len(reader.GetAllPoints()) == len(town)
    assert len(reader.GetAllNodes()) > 4
    assert reader.ValidateSpatialBounds()


def test_old_formats_become_new_ones(shared_data, tmp_path):
    cloud = read(shared_data / "airborne" / "autzen_trim.laz")
    write(tmp_path / "a.copc.laz", cloud)
    with laspy.open(tmp_path / "a.copc.laz") as reader:
        assert (str(reader.header.version), reader.header.point_format.id) == ("1.4", 7)
        assert reader.header.global_encoding.wkt
    found = read(tmp_path / "a.copc.laz")
    degrees = np.sort(found.attributes["scan_angle"] * 0.006)
    np.testing.assert_allclose(degrees, np.sort(cloud.attributes["scan_angle_rank"]), atol=0.004)
    assert found.crs == cloud.crs


@pytest.mark.parametrize("count", [0, 1, 30_000])
def test_no_points_and_points_at_one_place(tmp_path, count):
    write(tmp_path / "a.copc.laz", Cloud(np.ones((count, 3))))
    assert len(read(tmp_path / "a.copc.laz")) == count
    with laspy.CopcReader.open(tmp_path / "a.copc.laz") as reader:
        assert len(reader.query()) == count


def test_a_crs_that_copc_does_not_ask_for_is_told(tmp_path):
    with pytest.warns(FormatWarning, match="asks for WKT"):
        write(tmp_path / "a.copc.laz", Cloud(np.eye(3), crs="EPSG:25832"))
    assert read(tmp_path / "a.copc.laz").crs == "EPSG:25832"
