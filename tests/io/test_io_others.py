"""PTX, sweeps of float32, OBJ, meshes and cameras in YAML: what is read of them, and what is refused."""

import json

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import KDTree

import edgel
from edgel import Intrinsics
from edgel.io import FormatError, read, read_intrinsics

POSE = "5 6 7\n1 0 0\n0 1 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n5 6 7 1\n"  # a quarter turn about z, then a shift
CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
FACES = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


def put(tmp_path, name, content):
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return tmp_path / name


def test_one_scan_of_ptx_is_a_grid(tmp_path):
    rows = "1 0 0 0.5 1 2 3\n0 0 0 0 0 0 0\n0 1 0 0.25 4 5 6\n1 1 1 1 7 8 9\n2 2 2 1 7 8 9\n1.#QNAN 1 1 0 0 0 0\n"
    cloud = read(put(tmp_path, "a.ptx", f"3\r\n2\r\n{POSE}{rows}"))
    assert cloud.shape == (3, 2)
    assert cloud.viewpoint is not None
    assert cloud.viewpoint.tolist() == [5, 6, 7]
    np.testing.assert_array_equal(cloud.xyz[[0, 2, 3]], [(5, 7, 7), (4, 6, 7), (4, 7, 8)])
    assert np.isnan(cloud.xyz[1]).all()
    assert np.isnan(cloud.xyz[5]).any()
    assert cloud.attributes["red"].dtype == np.uint8
    assert cloud.attributes["blue"].tolist() == [3, 0, 6, 9, 9, 0]
    assert cloud.attributes["intensity"].tolist() == [0.5, 0, 0.25, 1, 1, 0]


def test_scans_of_ptx_with_and_without_colors(tmp_path):
    scans = f"1\n1\n{POSE}1 0 0 0.5 1 2 3\n" + f"1\n2\n{POSE}1 0 0 0.5\n0 0 0 0.5\n"
    cloud = read(put(tmp_path, "a.ptx", scans))
    assert cloud.metadata["scan_shapes"] == ((1, 1), (1, 2))
    assert cloud.attributes["scan_index"].tolist() == [0, 1, 1]
    np.testing.assert_array_equal(cloud.attributes["red"], [1, np.nan, np.nan])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 3\n4 5 6\n", "a list of points is .pts or .xyz"),
        (f"2\n2\n{POSE}1 2 3 4\n", "declared 4 points, found 1"),
        (f"99999999999\n99999999999\n{POSE}1 2 3 4\n", "cut off"),
        ("1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 4\n", "no pose"),
        (f"1\n2\n{POSE}1 2 3 4\n1 2 x 4\n", "scan 1, point 2: expected 4 numbers, found '1 2 x 4'"),
        (f"1\n1\n{POSE.replace('7 1', 'nan 1')}1 2 3 4\n", "pose"),
        (f"1\n1\n{POSE}1 2 3 4 5\n", "scan 1, point 1"),
        ("\n\n", "no scan"),
    ],
)
def test_damaged_ptx(tmp_path, text, message):
    with pytest.raises(FormatError, match=message):
        read(put(tmp_path, "a.ptx", text))


def sweep(num, columns):
    rng = np.random.default_rng(num)
    table = rng.normal(size=(num, columns)) * 30
    table[:, 3] = rng.random(num) if columns == 4 else rng.integers(0, 256, num)
    if columns == 5:
        table[:, 4] = rng.integers(0, 32, num)
    return table.astype("<f4")


@pytest.mark.parametrize("num", [1, 5, 80, 1000])  # sizes that both fit among them
def test_kitti_and_nuscenes(tmp_path, num):
    kitti, nuscenes = sweep(num, 4), sweep(num, 5)
    cloud = read(put(tmp_path, "a.bin", kitti.tobytes()))
    np.testing.assert_array_equal(cloud.xyz, kitti[:, :3])
    np.testing.assert_array_equal(cloud.attributes["intensity"], kitti[:, 3])
    for name in ("a.bin", "a.pcd.bin"):
        cloud = read(put(tmp_path, name, nuscenes.tobytes()))
        np.testing.assert_array_equal(cloud.xyz, nuscenes[:, :3])
        np.testing.assert_array_equal(cloud.attributes["ring"], nuscenes[:, 4])
        assert cloud.attributes["ring"].dtype == np.uint16


def test_sweeps_of_other_columns(tmp_path):
    file = put(tmp_path, "a.bin", sweep(7, 6).tobytes())
    cloud = read(file, columns="x,y,z,intensity,_,time")
    np.testing.assert_array_equal(cloud.attributes["time"], sweep(7, 6)[:, 5])
    assert list(cloud.attributes) == ["intensity", "time"]
    with pytest.raises(FormatError, match="168 bytes are not points of 5 float32"):
        read(file, columns="x,y,z,a,b")
    for content, message in [
        (np.random.default_rng(0).bytes(80), "--columns"),
        (b"CCB3" + bytes(76), "CloudCompare"),
        (b"0.5 1.5 2.5 3\n" * 8, "a text of x y z columns"),
    ]:
        with pytest.raises(FormatError, match=message):
            read(put(tmp_path, "b.bin", content))


def test_vertices_of_obj(tmp_path):
    text = "# a cloud\nmtllib a.mtl\nv 1 2 3 0.2 0.4 1\nv 4 5 6 0 1 0 # red\nvn 0 0 1\nvn 1 0 0\nvt 0 0\nl 1 2\n"
    cloud = read(put(tmp_path, "a.obj", text))
    assert cloud.xyz.tolist() == [[1, 2, 3], [4, 5, 6]]
    found = {name: values.tolist() for name, values in cloud.attributes.items()}
    assert found == {"red": [51, 0], "green": [102, 255], "blue": [255, 0], "nx": [0, 1], "ny": [0, 0], "nz": [1, 0]}
    assert cloud.metadata["left_out"] == ("1 texture coordinates", "1 lines")
    assert read(put(tmp_path, "b.obj", "v 1 2 3 1.0\n")).attributes == {}
    for text, message in [
        (CUBE + FACES, "a mesh of 6 faces.*--sample-mesh"),
        ("v 1 2\n", "expected v x y z"),
        ("v 1 2 3\nv 1 2 x\n", "line 2 of those with v"),
        ("v 1 2 3 4 5\n", "vertices of 5 numbers"),
        ("hello\n", "no vertices"),
    ]:
        with pytest.raises(FormatError, match=message):
            read(put(tmp_path, "c.obj", text))


def as_ply(binary):
    text = f"ply\nformat {'binary_little_endian' if binary else 'ascii'} 1.0\nelement vertex 3\nproperty float x\n"
    text += "property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    vertices, face = np.array([[0, 0, 0], [4, 0, 0], [0, 3, 0]], "<f4"), np.arange(3, dtype="<i4")
    return text.encode() + (
        vertices.tobytes() + b"\3" + face.tobytes() if binary else b"0 0 0\n4 0 0\n0 3 0\n3 0 1 2\n"
    )


STL = (
    "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 4 0 0\nvertex 0 3 0\nendloop\nendfacet\nendsolid a\n"
)
MESHES = {
    "ascii.ply": as_ply(False),
    "binary.ply": as_ply(True),
    "a.obj": "mtllib ../secret.mtl\nv 0 0 0\nv 4 0 0\nv 0 3 0\nf 1 2 3\n",
    "a.off": "OFF\n3 1 0\n0 0 0\n4 0 0\n0 3 0\n3 0 1 2\n",
    "a.STL": STL,
}


@pytest.mark.parametrize("name", MESHES)
def test_meshes_are_sampled(tmp_path, name):
    pytest.importorskip("trimesh", reason="the extra mesh is not installed")
    file = put(tmp_path, name, MESHES[name])
    cloud = read(file, sample_mesh=500)
    assert len(cloud) == 500
    x, y, z = cloud.xyz.T
    assert (z == 0).all()
    assert ((x >= 0) & (y >= 0) & (x / 4 + y / 3 <= 1 + 1e-9)).all()
    assert [values[0] for values in cloud.attributes.values()] == [0, 0, 1]
    np.testing.assert_array_equal(cloud.xyz, read(file, sample_mesh=500).xyz)


def test_samples_lie_evenly_by_area(tmp_path):
    pytest.importorskip("trimesh", reason="the extra mesh is not installed")
    plate = "v 0 0 0\nv 9 0 0\nv 9 1 0\nv 0 1 0\nv 1 0 0\nf 1 5 4\nf 5 2 3 4\n"  # faces of very unlike size
    xyz = read(put(tmp_path, "a.obj", plate), sample_mesh=2000).xyz
    counts = np.histogram(xyz[:, 0], bins=9, range=(0, 9))[0]
    assert np.abs(counts / counts.mean() - 1).max() < 0.12
    nearest = KDTree(xyz).query(xyz, k=2)[0][:, 1]
    assert nearest.min() > 0.7 * np.median(nearest)


def test_what_cannot_be_sampled(tmp_path):
    pytest.importorskip("trimesh", reason="the extra mesh is not installed")
    for name, content, message in [
        ("a.obj", CUBE, "no faces|no mesh"),
        ("b.off", "OFF\n3 1 0\n0 0 0\n0 0 0\n0 0 0\n3 0 1 2\n", "area of its faces is 0"),
        ("c.stl", "no mesh at all", "no mesh|no faces"),
        ("d.ply", b"ply\nformat ascii 1.0\n", "no mesh"),
    ]:
        with pytest.raises(FormatError, match=message):
            read(put(tmp_path, name, content), sample_mesh=10)
    for number in (0, -1, 2.5, True, 10**9, 10**5000, np.nan):
        with pytest.raises(ValueError, match="sample_mesh: expected a number of points"):
            read(tmp_path / "a.obj", sample_mesh=number)  # pyright: ignore[reportArgumentType]
    with pytest.raises(FormatError, match="--sample-mesh"):
        read(put(tmp_path, "e.stl", STL))


def test_options_for_other_files(tmp_path):
    edgel.write(tmp_path / "a.npy", edgel.Cloud(np.eye(3)))
    with pytest.raises(ValueError, match=r"columns: .*a\.npy is no text"):
        read(tmp_path / "a.npy", columns="x,y,z")
    with pytest.raises(ValueError, match=r"sample_mesh: .*a\.npy is no mesh"):
        read(tmp_path / "a.npy", sample_mesh=10)


OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
"""
ROS = """image_width: 640
image_height: 480
camera_name: depth
camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 510, 240, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""
ECHO = """header:
  frame_id: depth
height: 480
width: 640
distortion_model: plumb_bob
d: [0.0, 0.0]
k:
- 500.0
- 0.0
- 320.0
- 0.0
- 510.0
- 240.0
- 0.0
- 0.0
- 1.0
---
height: 1
"""


@pytest.mark.parametrize("text", [OPENCV, ROS, ECHO])
def test_cameras_in_yaml(tmp_path, text):
    camera = read_intrinsics(put(tmp_path, "a.yaml", text))
    assert camera == Intrinsics(500, 510, 320, 240, None, 640, 480)


@pytest.mark.parametrize(
    "text",
    [
        "a: [",
        "a: &x [1]\nb: *x\n",
        "!!python/object/apply:os.getcwd []",
        "",
        "fx: " + "9" * 5000,
        b"\xff\0",
        "fx: .nan",
    ],
)
def test_bad_cameras_in_yaml(tmp_path, text):
    with pytest.raises(FormatError):
        read_intrinsics(put(tmp_path, "a.yaml", text))


def test_the_camera_that_was_found_is_said(tmp_path):
    depth = np.full((480, 640), 1000, np.uint16)
    (tmp_path / "depth").mkdir()
    Image.fromarray(depth).save(tmp_path / "depth" / "000012.png")
    scene = {str(i): {"cam_K": [500 + i, 0, 320, 0, 510, 240, 0, 0, 1], "depth_scale": 0.1} for i in (1, 12)}
    put(tmp_path, "scene_camera.json", json.dumps(scene))
    cloud = read(tmp_path / "depth" / "000012.png")
    (notice,) = cloud.metadata["notices"]
    assert "scene_camera.json: fx 512, fy 510, cx 320, cy 240, depth_scale 0.0001" in notice
    assert np.allclose(cloud.xyz[:, 2], 0.1)
    put(tmp_path / "depth", "camera_info.yaml", ROS)
    with pytest.raises(FormatError, match="2 files of cameras"):
        read(tmp_path / "depth" / "000012.png")
    assert "notices" not in read(tmp_path / "depth" / "000012.png", intrinsics=(500, 510, 320, 240)).metadata
