"""Depth frames become organized clouds, whichever way their camera is written down."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from naive import back_project
from PIL import Image

import edgel
from edgel import Intrinsics, from_depth

WIDTH, HEIGHT = 7, 4
FX, FY, CX, CY = 100.0, 120.0, 3.25, 1.5
DEPTH = np.arange(500, 500 + 3 * WIDTH * HEIGHT, 3, dtype=np.uint16).reshape(HEIGHT, WIDTH)
K = [FX, 0, CX, 0, FY, CY, 0, 0, 1]
BY_COLUMN = [FX, 0, 0, 0, FY, 0, CX, CY, 1]
P = [FX, 0, CX, -5, 0, FY, CY, 0, 0, 0, 1, 0]
RAW = [90, 0, 3, 0, 90, 1, 0, 0, 1]
SIZE = {"width": WIDTH, "height": HEIGHT}
CAMERA = Intrinsics(FX, FY, CX, CY)
REALSENSE = {**SIZE, "fx": FX, "fy": FY, "ppx": CX, "ppy": CY, "model": "brown_conrady", "coeffs": [0.0] * 5}
ROS_2 = {**SIZE, "distortion_model": "plumb_bob", "d": [0.0] * 5, "k": K, "r": [1, 0, 0, 0, 1, 0, 0, 0, 1], "p": P}
ROS_1 = {**SIZE, "D": (0.0,) * 5, "K": tuple(K), "R": (0.0,) * 9, "P": (0.0,) * 12}
ROS_YAML = {
    "image_width": WIDTH,
    "image_height": HEIGHT,
    "camera_name": "depth",
    "camera_matrix": {"rows": 3, "cols": 3, "data": RAW},
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0, 0, 0, 0, 0]},
    "projection_matrix": {"rows": 3, "cols": 4, "data": P},
}
BOP = {"cam_K": K, "depth_scale": 1.0, "cam_R_w2c": [1, 0, 0, 0, 1, 0, 0, 0, 1]}
MAPPINGS = {
    "own": {"fx": FX, "fy": FY, "cx": CX, "cy": CY, **SIZE},
    "perception": {"_fx": FX, "_fy": FY, "_cx": CX, "_cy": CY, "_skew": 0.0, "_frame": "camera", "_K": 0},
    "RealSense": REALSENSE,
    "Open3D": {**SIZE, "intrinsic_matrix": BY_COLUMN},
    "Open3D, a view": {"extrinsic": [1] * 16, "intrinsic": {**SIZE, "intrinsic_matrix": BY_COLUMN}},
    "Open3D, a recording": {**SIZE, "intrinsic_matrix": BY_COLUMN, "depth_scale": 1000.0, "depth_format": "Z16"},
    "ROS 1": ROS_1,
    "ROS 2": ROS_2,
    "ROS, rectified": {**ROS_2, "k": RAW},
    "ROS, size unset": {**ROS_1, "width": 0, "height": 0},
    "ROS, a YAML file": ROS_YAML,
    "BOP": BOP,
    "BOP, a scene of one": {"12": BOP},
    "BOP, a scene of one camera": {"0": BOP, "1": {**BOP, "cam_R_w2c": [0, 1, 0, 1, 0, 0, 0, 0, 1]}},
}
OTHERS = {
    "Intrinsics": Intrinsics(FX, FY, CX, CY, width=WIDTH, height=HEIGHT),
    "four numbers": (FX, FY, CX, CY),
    "an array of four": np.array([FX, FY, CX, CY], np.float32),
    "a matrix": np.array(K).reshape(3, 3),
    "a matrix as lists": [[FX, 0, CX], [0, FY, CY], [0, 0, 1]],
    "an object of RealSense": SimpleNamespace(**REALSENSE),
    "an object of Open3D": SimpleNamespace(**SIZE, intrinsic_matrix=np.array(K).reshape(3, 3)),
    "an object of Open3D's views": SimpleNamespace(intrinsic=SimpleNamespace(intrinsic_matrix=np.reshape(K, (3, 3)))),
    "an object of ROS 1": SimpleNamespace(**ROS_1),
    "an object of ROS 2": SimpleNamespace(**{**ROS_2, "k": np.array(K)}),
}
EXPECTED = back_project(DEPTH, 0.001, FX, FY, CX, CY).reshape(-1, 3)


@pytest.mark.parametrize("camera", [*MAPPINGS.values(), *OTHERS.values()], ids=[*MAPPINGS, *OTHERS])
def test_every_convention_gives_the_same_cloud(camera):
    cloud = from_depth(DEPTH, camera)
    np.testing.assert_array_equal(cloud.xyz, EXPECTED)
    assert cloud.shape == (HEIGHT, WIDTH)
    assert cloud.viewpoint is not None
    assert cloud.viewpoint.tolist() == [0, 0, 0]


@pytest.mark.parametrize("camera", MAPPINGS.values(), ids=MAPPINGS)
def test_files_are_read_as_frames_are(camera, tmp_path):
    (tmp_path / "intrinsics.json").write_text(json.dumps(camera))
    Image.fromarray(DEPTH).save(tmp_path / "a.png")
    np.testing.assert_array_equal(edgel.read(tmp_path / "a.png").xyz, from_depth(DEPTH, camera).xyz)
    np.testing.assert_array_equal(edgel.read(tmp_path / "a.png", intrinsics=camera).xyz, EXPECTED)


def test_the_camera_of_open3d_itself(tmp_path):
    o3d = pytest.importorskip("open3d", reason="the extra export is not installed")
    camera = o3d.camera.PinholeCameraIntrinsic(WIDTH, HEIGHT, FX, FY, CX, CY)
    np.testing.assert_array_equal(from_depth(DEPTH, camera).xyz, EXPECTED)
    o3d.io.write_pinhole_camera_intrinsic(str(tmp_path / "camera.json"), camera)
    assert edgel.io.read_intrinsics(tmp_path / "camera.json") == Intrinsics(FX, FY, CX, CY, None, WIDTH, HEIGHT)
    points = o3d.geometry.PointCloud.create_from_depth_image(o3d.geometry.Image(DEPTH), camera).points
    np.testing.assert_allclose(np.asarray(points), EXPECTED, rtol=1e-6)  # of single precision


def test_one_name_wherever_it_is_imported_from():
    assert edgel.io.Intrinsics is edgel.Intrinsics


@pytest.mark.parametrize(
    ("depth", "scale"),
    [
        (DEPTH, 0.001),
        (DEPTH.astype(np.int32), 0.001),
        (DEPTH.astype(np.uint64), 0.001),
        (DEPTH.astype(">u2"), 0.001),
        (DEPTH.tolist(), 0.001),
        (DEPTH[:, :, None], 0.001),
        (np.asfortranarray(DEPTH), 0.001),
        (np.repeat(DEPTH, 2, axis=1)[:, ::2], 0.001),
        (DEPTH.astype(np.float32), 1),
        (DEPTH.astype(np.float64), 1),
        (DEPTH.astype(np.float16), 1),
    ],
)
def test_types_and_layouts_of_depth(depth, scale):
    before = np.array(depth)
    np.testing.assert_allclose(from_depth(depth, CAMERA).xyz, EXPECTED * (scale / 0.001), rtol=1e-3)
    np.testing.assert_array_equal(before, depth)


def test_scale_of_a_count():
    for camera, scale in [
        (Intrinsics(FX, FY, CX, CY, depth_scale=0.25), 0.25),
        ({**MAPPINGS["own"], "depth_scale": 0.25}, 0.25),
        ({**BOP, "depth_scale": 0.1}, 1e-4),
        ({"cam_K": K}, 0.001),
        ({**MAPPINGS["Open3D, a recording"], "depth_scale": 5000}, 2e-4),
    ]:
        np.testing.assert_allclose(from_depth(DEPTH, camera).xyz[:, 2], DEPTH.ravel() * scale, rtol=1e-12)
        np.testing.assert_allclose(from_depth(DEPTH, camera, depth_scale=2).xyz[:, 2], 2 * DEPTH.ravel())
    with pytest.raises(ValueError, match="depth_scale: expected a number above 0, got 0"):
        from_depth(DEPTH, CAMERA, depth_scale=0)


@pytest.mark.parametrize("nothing", [0, -1, np.nan, np.inf, -np.inf, 1e308])
def test_pixels_without_a_return(nothing):
    depth = DEPTH.astype(float)
    depth[1, 2] = nothing
    cloud = from_depth(depth, CAMERA, depth_scale=1000)
    bad = ~np.isfinite(cloud.xyz)
    assert bad[WIDTH + 2].all()
    assert bad.sum() == 3


def test_masked_pixels_are_no_return():
    mask = np.zeros(DEPTH.shape, bool)
    mask[2, 3] = True
    for depth in (np.ma.array(DEPTH, mask=mask), list(np.ma.array(DEPTH, mask=mask))):
        xyz = from_depth(depth, CAMERA).xyz
        assert np.isnan(xyz[2 * WIDTH + 3]).all()
        np.testing.assert_array_equal(np.delete(xyz, 2 * WIDTH + 3, axis=0), np.delete(EXPECTED, 2 * WIDTH + 3, axis=0))
    np.testing.assert_array_equal(from_depth(np.ma.array(DEPTH), CAMERA).xyz, EXPECTED)


@pytest.mark.parametrize("dtype", [np.uint16, np.int32, np.float32, np.float64])
@given(
    data=st.data(),
    focal=st.tuples(*[st.floats(1, 5000)] * 2),
    centre=st.tuples(*[st.floats(-100, 5000)] * 2),
    scale=st.none() | st.floats(1e-5, 10),
)
def test_back_projection(dtype, data, focal, centre, scale):
    shape = data.draw(hnp.array_shapes(min_dims=2, max_dims=2, max_side=90))
    depth = data.draw(hnp.arrays(dtype, shape))
    xyz = from_depth(depth, (*focal, *centre), depth_scale=scale).xyz.reshape(*shape, 3)
    default = 1 if depth.dtype.kind == "f" else 0.001
    np.testing.assert_array_equal(xyz, back_project(depth, scale or default, *focal, *centre))
    rows, cols = np.nonzero(np.isfinite(xyz).all(axis=2))
    x, y, z = xyz[rows, cols].T
    kept = z > 1e-300  # the smallest numbers there are lose digits
    np.testing.assert_allclose((x / z * focal[0] + centre[0])[kept], cols[kept], atol=1e-8)
    np.testing.assert_allclose((y / z * focal[1] + centre[1])[kept], rows[kept], atol=1e-8)


def test_threads_change_nothing(monkeypatch):
    depth = np.random.default_rng(0).integers(0, 5000, (300, 200)).astype(np.uint16)
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("EDGEL_NUM_THREADS", threads)
        found.append(from_depth(depth, CAMERA).xyz)
    np.testing.assert_array_equal(*found)


def test_edges_of_a_frame():
    depth = np.full((60, 80), 2000, np.uint16)
    depth[20:40, 30:50] = 1500
    edges = edgel.detect(from_depth(depth, (80, 80, 39.5, 29.5)), kinds="occluding")
    rows, cols = np.divmod(edges.index, 80)
    assert len(edges) > 60
    assert ((rows >= 19) & (rows <= 40) & (cols >= 29) & (cols <= 50)).all()


@pytest.mark.parametrize(
    ("depth", "error", "message"),
    [
        (DEPTH.ravel(), ValueError, r"depth: expected shape \(H, W\), got \(28,\).*reshape it"),
        (np.zeros((4, 7, 3)), ValueError, r"got \(4, 7, 3\).*edgel\.Cloud\(points\)"),
        (np.zeros((0, 7)), ValueError, r"shape \(0, 7\) holds no pixels"),
        (DEPTH > 0, TypeError, r"depth: expected integers or floats .* \(bool\)"),
        (DEPTH.astype(complex), TypeError, "complex128"),
        (DEPTH.astype(str), TypeError, "ndarray"),
        (object(), TypeError, r"got object .*np\.asanyarray\(frame\.get_data\(\)\)"),
        (None, TypeError, "got NoneType"),
    ],
)
def test_what_is_no_depth_image(depth, error, message):
    with pytest.raises(error, match=message):
        from_depth(depth, CAMERA)


@pytest.mark.parametrize(
    ("camera", "error", "message"),
    [
        (Intrinsics(1, 1, 1, 1, width=640, height=480), ValueError, "image is 7 x 4, the intrinsics are for 640 x 480"),
        ({**REALSENSE, "width": HEIGHT, "height": WIDTH}, ValueError, "7 x 4, the intrinsics are for 4 x 7"),
        ({**REALSENSE, "coeffs": [0.1, 0, 0, 0, 0]}, ValueError, r"distortion \(coeffs: .*undistort the depth image"),
        (SimpleNamespace(**{**ROS_1, "D": (0.1, 0, 0, 0, 0)}), ValueError, r"distortion \(D: .*info\.p"),
        ({**ROS_YAML, "distortion_coefficients": {"data": [1e-9]}}, ValueError, "lens distortion"),
        ({**ROS_YAML, "distortion_coefficients": {"k1": 1}}, ValueError, "expected numbers of a camera"),
        ({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "k1": -0.2}, ValueError, "lens distortion"),
        ({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "skew": 0.1}, ValueError, "skew 0.1; undistort"),
        ({"K": [1, 0.1, 0, 0, 1, 0, 0, 0, 1]}, ValueError, "skew .*undistort"),
        ({"fx": 1, "ppx": 2}, ValueError, "fy, cy of the camera not given"),
        ({"a": 1, "b": 2}, ValueError, "no known camera among a, b; accepted are .*RealSense.*Open3D.*ROS.*BOP"),
        ({}, ValueError, "no known camera among nothing"),
        ({"K": [1, 2]}, ValueError, r"K: no camera matrix of shape \(2,\); 3 x 3"),
        ({"K": "abc"}, ValueError, "K: expected numbers of a camera, got 'abc'"),
        ({"K": [0.0] * 9}, ValueError, "K: .* is no camera matrix"),
        ({"K": [-1, 0, 0, 0, 1, 0, 0, 0, 1]}, ValueError, "fx: expected a number above 0"),
        (np.eye(4), ValueError, r"intrinsics: no camera matrix of shape \(4, 4\)"),
        ((1, 2, 3), ValueError, r"shape \(3,\)"),
        (["a"], ValueError, "intrinsics: expected numbers of a camera"),
        ({"0": BOP, "1": {**BOP, "depth_scale": 0.1}}, ValueError, r"of 2 images, which differ.*cameras\['0'\]"),
        ({**BOP, "depth_scale": 0}, ValueError, "depth_scale: expected a number above 0, got 0"),
        ({**BOP, "depth_scale": "x"}, ValueError, "depth_scale: expected a finite number"),
        ({**MAPPINGS["own"], "width": 7.5}, ValueError, "width: expected a whole number of pixels"),
        ("camera.json", TypeError, r"edgel\.io\.read_intrinsics\(path\)"),
        (7, TypeError, "int is no known camera; accepted are"),
        (None, TypeError, "NoneType is no known camera"),
    ],
)
def test_what_is_no_camera_of_this_image(camera, error, message):
    with pytest.raises(error, match=message):
        from_depth(DEPTH, camera)


@pytest.mark.parametrize("value", [math.nan, math.inf, True, "1", None, 10**400, 1j])
def test_intrinsics_are_numbers(value):
    with pytest.raises(ValueError, match="fx: expected a finite number"):
        Intrinsics(value, 1, 1, 1)


def test_errors_of_files_name_the_file(tmp_path):
    (tmp_path / "scene_camera.json").write_text(json.dumps({"0": BOP, "1": {**BOP, "depth_scale": 0.1}}))
    with pytest.raises(edgel.FormatError, match=r"scene_camera\.json: the cameras of 2 images"):
        edgel.io.read_intrinsics(tmp_path / "scene_camera.json")
