import io
import json
import zipfile
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from test_io_support import assert_same, clouds, rich_cloud

from edgel import Cloud
from edgel.io import FormatError, FormatWarning, Intrinsics, read, read_intrinsics, write

CAMERA = Intrinsics(fx=100, fy=200, cx=2, cy=1)
DEPTH = np.array([[0, 1000, 2000, 3000, 4000]] * 3, np.uint16)


@settings(max_examples=40)
@given(clouds(), st.sampled_from([".npy", ".npz"]))
def test_round_trip(tmp_path_factory, cloud, suffix):
    file = tmp_path_factory.mktemp("numpy") / f"a{suffix}"
    write(file, cloud)
    assert_same(read(file), cloud, names={name: name for name in cloud.attributes})


@pytest.mark.parametrize("shape", [None, (6, 7)])
@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_rich_clouds(tmp_path, shape, suffix):
    rich = rich_cloud(holes=True)
    cloud = Cloud(rich.xyz, rich.attributes, shape, np.array([1, 2, 3.0]), "EPSG:25832")
    write(tmp_path / f"a{suffix}", cloud)
    found = read(tmp_path / f"a{suffix}")
    assert_same(found, cloud)
    assert found.attributes["normal"].shape == (42, 3)
    assert found.shape == shape
    if suffix == ".npz":
        assert found.crs == "EPSG:25832"
        assert found.viewpoint is not None
        assert found.viewpoint.tolist() == [1, 2, 3]


def test_other_arrays(tmp_path):
    file = tmp_path / "a.npy"
    np.save(file, np.arange(12, dtype=np.int16).reshape(4, 3))
    assert read(file).xyz[1].tolist() == [3, 4, 5]
    np.save(file, np.asfortranarray(np.arange(20.0).reshape(4, 5)))
    assert read(file).xyz[1].tolist() == [5, 6, 7]
    assert read(file).attributes["column_4"].tolist() == [4, 9, 14, 19]
    np.save(file, np.zeros((4, 5, 3), ">f4"))
    assert read(file).shape == (4, 5)
    np.save(file, np.array([(1, 2, 3, 4)], [("Z", "f4"), ("X", "f4"), ("Y", "f4"), ("i", "u1")]))
    assert read(file).xyz.tolist() == [[2, 3, 1]]
    np.savez_compressed(tmp_path / "a.npz", points=np.zeros((4, 5, 3)), label=np.ones((4, 5)), note=np.arange(7))
    found = read(tmp_path / "a.npz")
    assert (found.shape, found.attributes["label"].shape, found.metadata["note"].shape) == ((4, 5), (20,), (7,))


def test_bad_arrays(tmp_path):
    file, archive = tmp_path / "a.npy", tmp_path / "a.npz"
    for array in (
        np.zeros(5),
        np.zeros((5, 2)),
        np.zeros((2, 2, 2)),
        np.zeros((3, 3), complex),
        np.zeros((2, 2), "i4,i4"),
        np.zeros(4, [("x", "f8"), ("y", "V8"), ("z", "f8")]),
        np.zeros(4, [("x", "f8", 2), ("y", "f8"), ("z", "f8")]),
    ):
        np.save(file, array)
        with pytest.raises(FormatError):
            read(file)
    np.save(file, np.array([{}, 1], object), allow_pickle=True)
    with pytest.raises(FormatError, match="Python objects"):
        read(file)
    np.savez(archive, points=np.array([{}], object), allow_pickle=True)
    with pytest.raises(FormatError, match="Python objects"):
        read(archive)
    np.savez(archive, a=np.zeros((2, 3)))
    with pytest.raises(FormatError, match="its arrays are a; one called xyz or points"):
        read(archive)
    np.savez(archive, xyz=np.zeros((6, 3)), shape=np.array([2, 4]))
    with pytest.raises(FormatError, match="shape"):
        read(archive)
    with zipfile.ZipFile(archive, "w") as other:
        other.writestr("readme.txt", "hello")
    with pytest.raises(FormatError, match="its arrays are none"):
        read(archive)


@pytest.mark.parametrize(("suffix", "name"), [(".npz", "xyz"), (".npz", "shape"), (".npz", "file"), (".npz", "a\0b"),
                                              (".npy", "x"), (".npy", "Z"), (".npy", "")])  # fmt: skip
def test_names_that_mean_something_else_are_renamed_and_said(tmp_path, suffix, name):
    cloud = Cloud(np.eye(3), {name: np.arange(3), "o": np.array([{}] * 3, object), "t": np.array(["a", "b", "c"])})
    with pytest.warns(FormatWarning, match=r"renamed.*; o: left out, it holds Python objects"):
        write(tmp_path / f"a{suffix}", cloud)
    found = read(tmp_path / f"a{suffix}")
    first, text = found.attributes.values()
    assert (first.tolist(), text.tolist()) == ([0, 1, 2], ["a", "b", "c"])
    np.testing.assert_array_equal(found.xyz, cloud.xyz)


def test_promise_of_a_trillion_points_is_not_believed(tmp_path):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)})
    (tmp_path / "a.npy").write_bytes(head.getvalue() + bytes(100))
    with pytest.raises(FormatError, match=r"declared an array of shape \(1000000000000, 3\)"):
        read(tmp_path / "a.npy")
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("xyz.npy", head.getvalue() + bytes(100))
    with pytest.raises(FormatError, match=r"declared an array of shape"):
        read(tmp_path / "a.npz")


@settings(max_examples=150)
@given(st.data())
def test_cut_or_damaged_anywhere(tmp_path_factory, data):
    suffix = data.draw(st.sampled_from([".npy", ".npz"]))
    file = tmp_path_factory.mktemp("numpy") / f"a{suffix}"
    cloud = rich_cloud(4)
    write(file, Cloud(cloud.xyz, {"label": np.arange(4)}))
    raw = bytearray(file.read_bytes())
    if data.draw(st.booleans()):
        raw = raw[: data.draw(st.integers(0, len(raw)))]
    else:
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    file.write_bytes(bytes(raw))
    with suppress(FormatError):
        read(file)


def expected_depth(depth):
    z = np.where(depth > 0, depth, np.nan)
    v, u = np.mgrid[:3, :5]
    return np.stack([(u - 2) / 100 * z, (v - 1) / 200 * z, z], axis=-1).reshape(-1, 3)


@pytest.mark.parametrize(
    ("name", "array", "scale"),
    [
        ("a.png", DEPTH, 0.001),
        ("a.tif", DEPTH, 0.001),
        ("a.tiff", DEPTH.astype(np.float32), 1),
        ("a.tif", DEPTH.astype(np.int32), 0.001),
        ("a.npy", DEPTH, 0.001),
        ("a.npy", DEPTH.astype(np.float64), 1),
        ("a.npy", DEPTH[:, :, None].astype(np.float32), 1),
    ],
)
def test_depth_images(tmp_path, name, array, scale):
    if name.endswith(".npy"):
        np.save(tmp_path / name, array)
    else:
        Image.fromarray(array).save(tmp_path / name)
    found = read(tmp_path / name, intrinsics=CAMERA)
    np.testing.assert_allclose(found.xyz, expected_depth(DEPTH * scale), atol=1e-12)
    assert found.shape == (3, 5)
    assert found.viewpoint is not None
    assert found.viewpoint.tolist() == [0, 0, 0]
    scaled = read(tmp_path / name, intrinsics=Intrinsics(100, 200, 2, 1, depth_scale=0.5))
    np.testing.assert_allclose(scaled.xyz, expected_depth(DEPTH * 0.5), atol=1e-9)


@pytest.mark.parametrize(
    "entries",
    [
        {"fx": 100, "fy": 200, "cx": 2, "cy": 1},
        {"_fx": 100, "_fy": 200, "_cx": 2, "_cy": 1, "_skew": 0.0, "_K": 0, "_width": 5, "_height": 3, "_frame": "a"},
        {"camera_matrix": [[100, 0, 2], [0, 200, 1], [0, 0, 1]]},
        {"K": [100, 0, 2, 0, 200, 1, 0, 0, 1]},
        {"camera_matrix": {"rows": 3, "cols": 3, "data": [100, 0, 2, 0, 200, 1, 0, 0, 1]}},
        {"intrinsic_matrix": [100, 0, 0, 0, 200, 0, 2, 1, 1], "width": 5, "height": 3},
        {"intrinsic": {"intrinsic_matrix": [100, 0, 0, 0, 200, 0, 2, 1, 1]}},
    ],
)
def test_intrinsics_files(tmp_path, entries):
    (tmp_path / "intrinsics.json").write_text(json.dumps(entries))
    camera = read_intrinsics(tmp_path / "intrinsics.json")
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (100, 200, 2, 1)
    Image.fromarray(DEPTH).save(tmp_path / "a.png")
    for found in (read(tmp_path / "a.png"), read(tmp_path / "a.png", intrinsics=tmp_path / "intrinsics.json")):
        np.testing.assert_allclose(found.xyz, expected_depth(DEPTH * 0.001), atol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[1]",
        "{}",
        '{"fx": 1}',
        '{"fx": "a", "fy": 1, "cx": 1, "cy": 1}',
        '{"fx": -1, "fy": 1, "cx": 1, "cy": 1}',
        '{"fx": NaN, "fy": 1, "cx": 1, "cy": 1}',
        '{"fx": null, "fy": 1, "cx": 1, "cy": 1}',
        '{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "skew": 0.1}',
        '{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": "a"}',
        '{"K": [1, 2]}',
        '{"K": 0}',
    ],
)
def test_bad_intrinsics_files(tmp_path, text):
    (tmp_path / "a.intr").write_text(text)
    with pytest.raises(FormatError, match=r"a\.intr"):
        read_intrinsics(tmp_path / "a.intr")


def test_depth_images_without_or_with_wrong_camera(tmp_path):
    Image.fromarray(DEPTH).save(tmp_path / "a.png")
    with pytest.raises(FormatError, match=r"no \.intr file.*pass intrinsics="):
        read(tmp_path / "a.png")
    with pytest.raises(FormatError, match="the image is 5 x 3, the intrinsics are for 640 x 480"):
        read(tmp_path / "a.png", intrinsics=Intrinsics(1, 1, 1, 1, width=640, height=480))
    (tmp_path / "a.intr").write_text("{}")
    (tmp_path / "b.intr").write_text("{}")
    with pytest.raises(FormatError, match="2 files of cameras"):
        read(tmp_path / "a.png")
    np.save(tmp_path / "wide.npy", np.ones((20, 30)))
    with pytest.raises(FormatError, match="depth image needs its camera"):
        read(tmp_path / "wide.npy")
    write(tmp_path / "a.ply", Cloud(np.eye(3)))
    with pytest.raises(ValueError, match=r"intrinsics: .* is no depth image"):
        read(tmp_path / "a.ply", intrinsics=CAMERA)
    with pytest.raises(ValueError, match="fx: expected a number above 0"):
        Intrinsics(0, 1, 1, 1)


def test_pictures_that_are_no_depth(tmp_path):
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "a.png")
    with pytest.raises(FormatError, match="mode RGB, not depth"):
        read(tmp_path / "a.png", intrinsics=CAMERA)
    Image.fromarray(DEPTH).save(tmp_path / "b.png")
    raw = (tmp_path / "b.png").read_bytes()
    for stop in range(8, len(raw) - 24, 5):
        (tmp_path / "b.png").write_bytes(raw[:stop])
        with pytest.raises(FormatError):
            read(tmp_path / "b.png", intrinsics=CAMERA)
    (tmp_path / "b.png").write_bytes(b"ply\n")
    with pytest.raises(FormatError, match=r"name it \.ply"):
        read(tmp_path / "b.png", intrinsics=CAMERA)


def test_shared_depth_images(shared_data):
    found = read(shared_data / "structured_light" / "depth_0.npy")
    assert found.shape == (772, 1032)
    assert 0.3 < np.isnan(found.xyz[:, 2]).mean() < 0.37
    depth = np.load(shared_data / "structured_light" / "depth_0.npy")[:, :, 0]
    row, col = np.argwhere(depth > 0)[1000]
    x, y, z = found.xyz[row * 1032 + col]
    assert z == depth[row, col]
    np.testing.assert_allclose([x / z * 1122 + 511.5, y / z * 1122 + 384], [col, row])
    for sensor, shape in (("ensenso", (512, 640)), ("primesense", (480, 640))):
        assert read(shared_data / "two_depth_sensors" / sensor / "depth_0.npy").shape == shape
