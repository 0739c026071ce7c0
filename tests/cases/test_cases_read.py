"""Small files that were once read wrong, in ../shared/cases, and what is right for each."""

from pathlib import Path

import numpy as np
import pytest

import edgel
from edgel.io import FormatError, read

NAN = np.nan


@pytest.fixture(scope="module")
def cases(shared_data) -> Path:
    folder = shared_data.parent / "cases"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    return folder


READ = {
    "padding_count0.pcd": (
        [(1, 5, 9), (2, 6, 10), (3, 7, 11), (4, 8, 12)],
        {"intensity": [1, 2, 3, 4], "ring": [0, 1, 2, 3]},
    ),
    "comment_header.txt": (
        [(500001.5 + i, 5600001.25 + i, 121.5 + i) for i in range(4)],
        {"id": [1, 2, 3, 4]},
    ),
    "trailing_separator.csv": ([(1, 2, 3), (4, 5, 6)], {}),
    "missing_value.csv": ([(1, 2, 3), (4, 5, 6), (7, 8, 9)], {"reflectance": [0.5, NAN, 0.7]}),
    "msvc_nan.xyz": ([(1, 2, 3), (NAN, NAN, NAN), (4, 5, 6)], {}),
    "extra_column_later.txt": ([(1.5, 2.5, 3.5), (4.5, 5.5, 6.5)], {"column_3": [27, NAN]}),
    "paraview.csv": ([(1.5, 2.5, 3.5), (4.5, 5.5, 6.5)], {}),
    "colors_then_normals.xyz": (
        [(0.5 + i, 2.5, 3.5) for i in range(4)],
        {
            "red": [10] * 4,
            "green": [119] * 4,
            "blue": [50, 51, 52, 53],
            "nx": [0] * 4,
            "ny": [0.6] * 4,
            "nz": [0.8] * 4,
        },
    ),
    "two_scans.ptx": (
        [(101, 202, 13), (NAN, NAN, NAN), (101, 203, 13), (102, 203, 13), (501, 602, 13), (502, 602, 13)],
        {"intensity": [0.5] * 6, "scan_index": [0, 0, 0, 0, 1, 1]},
    ),
    "kitti.bin": ([(1, 2, 3), (4, 5, 6)], {"intensity": [0.5, 0.25]}),
}


@pytest.mark.parametrize("name", READ)
def test_points_and_attributes(cases, name):
    xyz, attributes = READ[name]
    cloud = read(cases / name)
    np.testing.assert_array_equal(cloud.xyz, xyz)
    assert set(attributes) <= set(cloud.attributes)
    assert set(cloud.attributes) - set(attributes) <= {"noise"}
    for column, values in attributes.items():
        np.testing.assert_array_equal(cloud.attributes[column], values)


def test_scans_of_ptx_are_grids(cases):
    cloud = read(cases / "two_scans.ptx")
    assert cloud.metadata["scan_shapes"] == ((2, 2), (1, 2))


def test_grid_with_a_gap(cases):
    pytest.importorskip("pye57", reason="the extra e57 is not installed")
    cloud = read(cases / "grid_with_gap.e57")
    assert cloud.shape == (6, 8)
    assert np.isnan(cloud.xyz).any(axis=1).sum() == 1


@pytest.mark.parametrize("name", ["open3d_metadata.json", "realsense.json", "bop_scene_camera.json"])
def test_cameras(cases, name):
    camera = edgel.io.read_intrinsics(cases / name)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (20, 20, 8, 6)
    cloud = read(cases / "depth.png", intrinsics=cases / name)
    assert set(np.unique(cloud.xyz[:, 2])) == {1.2, 1.5}


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("overflow.xyz", "row 40"),
        ("count_5000_digits.pcd", "COUNT"),
        ("laz_chunk_table.laz", "declared"),
        ("laz_layer_sizes.laz", "damaged"),
        ("png_bomb.png", "8192"),
        ("tiff_bomb.tif", "cut off"),
    ],
)
def test_what_cannot_be_taken_is_named(cases, name, message):
    with pytest.raises(ValueError, match=message) as caught:
        edgel.detect(read(cases / name, intrinsics=(20, 20, 8, 6) if "bomb" in name else None))
    assert name == "overflow.xyz" or isinstance(caught.value, FormatError)


def test_a_mesh_is_said_and_sampled(cases):
    cloud = read(cases / "mesh.ply")
    assert cloud.metadata["left_out"] == ("6 of element face",)
    assert "a mesh of 6 faces" in cloud.metadata["notices"][0]
    assert "--sample-mesh" in cloud.metadata["notices"][0]
    pytest.importorskip("trimesh", reason="the extra mesh is not installed")
    surface = read(cases / "mesh.ply", sample_mesh=600)
    assert len(surface) == 600
    on_faces = np.isclose(surface.xyz, 0) | np.isclose(surface.xyz, 1)
    assert on_faces.any(axis=1).all()
    per_face = [np.isclose(surface.xyz[:, axis], side).sum() for axis in range(3) for side in (0, 1)]
    assert min(per_face) > 80  # a hundred each


def test_no_edges_with_an_attribute_of_several_columns(cases, tmp_path):
    cloud = read(cases / "no_edges_vector_attribute.npz")
    edges = edgel.detect(cloud, min_strength=0.999)
    edgel.write(tmp_path / "a.npz", edges.to_cloud(cloud))
    found = read(tmp_path / "a.npz")
    assert len(found) == 0
    assert found.attributes["v"].shape == (0, 2)
