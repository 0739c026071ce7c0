"""ROS recordings: clouds and depth images of every kind of recording, written here by rosbags itself."""

import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import edgel
from edgel._cli import app
from edgel.io import FormatError, ros
from edgel.plot.palette import kind_colors

pytest.importorskip("rosbags", reason="the extra ros is not installed")
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
KINDS = ("bag", "mcap", "db3", "folder")
NUMBERS = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


def make(store, kind, **parts):
    """A message of a kind; of ROS 1 a header has a sequence number, a camera upper-case names."""
    made = store.types[f"sensor_msgs/msg/{kind}"]
    return made(header=header(store, parts.pop("stamp", 5)), **parts)


def header(store, seconds):
    time = store.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=7)
    more = {"seq": 0} if store is ROS1 else {}
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id="sensor", **more)


def cloud2(store, records: Any, *, padding=0, big=False, stamp=5):
    """A PointCloud2 of records (N,) or (H, W), with some bytes after every row."""
    records = np.atleast_2d(records)
    field = store.types["sensor_msgs/msg/PointField"]
    fields = []
    for name in records.dtype.names:
        dtype, offset = records.dtype.fields[name][:2]
        count = int(np.prod(dtype.shape, dtype=int))
        fields.append(field(name=name, offset=offset, datatype=NUMBERS[dtype.base.str[1:]], count=count))
    rows = [row.tobytes() + bytes(padding) for row in records]
    step = records.dtype.itemsize
    return make(
        store,
        "PointCloud2",
        stamp=stamp,
        height=records.shape[0],
        width=records.shape[1],
        fields=fields,
        is_bigendian=big,
        point_step=step,
        row_step=step * records.shape[1] + padding,
        data=np.frombuffer(b"".join(rows), np.uint8),
        is_dense=False,
    )


def image(store, depth, encoding):
    data = np.frombuffer(depth.tobytes(), np.uint8)
    step = depth.shape[1] * depth.itemsize
    return make(
        store, "Image", height=len(depth), width=depth.shape[1], encoding=encoding, is_bigendian=0, step=step, data=data
    )


def camera(store, height, width, focal):
    k = np.array([focal, 0, width / 2, 0, focal, height / 2, 0, 0, 1], float)
    p = np.array([focal, 0, width / 2, 0, 0, focal, height / 2, 0, 0, 0, 1, 0], float)
    parts = {"d": np.zeros(5), "k": k, "r": np.eye(3).ravel(), "p": p}
    if store is ROS1:
        parts = {name.upper(): values for name, values in parts.items()}
    region = store.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    parts |= {"height": height, "width": width, "distortion_model": "plumb_bob", "roi": region}
    return make(store, "CameraInfo", binning_x=0, binning_y=0, **parts)


def record(folder, kind, messages):
    """Record what `messages` makes with a store, (topic, message) in order; return what to read."""
    store = ROS1 if kind == "bag" else ROS2
    path = folder / ("run.bag" if kind == "bag" else "run")
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    with Writer1(path) if kind == "bag" else Writer2(path, version=9, storage_plugin=plugin) as writer:
        known = {}
        for number, (topic, message) in enumerate(messages(store)):
            name = message.__msgtype__
            known[topic] = known.get(topic) or writer.add_connection(topic, name, typestore=store)
            serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
            writer.write(known[topic], number + 1, serialize(message, name))
    return path if kind in ("bag", "folder") else next(path.glob(f"*.{kind}"))


def some_records(seed, shape=(40,), order="<"):
    layout = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("rgb", "u4"), ("ring", "u2"), ("normal_x", "f4")]
    layout += [("normal_y", "f4"), ("normal_z", "f4"), ("history", "f4", (2,)), ("time", "f8")]
    records: Any = np.zeros(shape, [(name, order + code, *more) for name, code, *more in layout])
    rng = np.random.default_rng(seed)
    for name in records.dtype.names:
        records[name] = rng.integers(1, 200, records[name].shape)
    return records


@pytest.mark.parametrize("kind", KINDS)
def test_clouds_of_every_recording(tmp_path, kind):
    first, second = some_records(1), some_records(2, (4, 10))
    path = record(
        tmp_path,
        kind,
        lambda store: [("/points", cloud2(store, first)), ("/points", cloud2(store, second, padding=6, stamp=9))],
    )
    assert ros.topics(path) == {"/points": 2}
    clouds = list(ros.frames(path))
    for cloud, records in zip(clouds, (first, second), strict=True):
        flat = records.ravel()
        np.testing.assert_array_equal(cloud.xyz, np.c_[flat["x"], flat["y"], flat["z"]])
        assert set(cloud.attributes) == {"red", "green", "blue", "ring", "nx", "ny", "nz", "history", "time"}
        np.testing.assert_array_equal(cloud.attributes["red"], flat["rgb"] >> 16 & 255)
        np.testing.assert_array_equal(cloud.attributes["blue"], flat["rgb"] & 255)
        np.testing.assert_array_equal(cloud.attributes["nx"], flat["normal_x"])
        np.testing.assert_array_equal(cloud.attributes["history"], flat["history"])
        assert (cloud.attributes["ring"].dtype, cloud.attributes["time"].dtype) == (np.uint16, np.float64)
    assert (clouds[0].shape, clouds[1].shape) == (None, (4, 10))
    assert clouds[0].viewpoint is None
    np.testing.assert_array_equal(clouds[1].viewpoint, 0)
    assert clouds[1].metadata["ros"] == {"topic": "/points", "stamp": 9 * 10**9 + 7, "frame_id": "sensor"}
    if kind != "folder":
        np.testing.assert_array_equal(edgel.read(path).xyz, clouds[0].xyz)
        np.testing.assert_array_equal(edgel.read(path, topic="/points", message=1).xyz, clouds[1].xyz)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("encoding", "dtype", "unit"), [("16UC1", "u2", 0.001), ("32FC1", "f4", 1.0)])
def test_depth_images_with_their_camera(tmp_path, kind, encoding, dtype, unit):
    depth = np.arange(1, 13, dtype=dtype).reshape(3, 4)
    depth[1, 2] = 0

    def messages(store):
        color = make(
            store,
            "Image",
            height=1,
            width=1,
            encoding="rgb8",
            is_bigendian=0,
            step=3,
            data=np.zeros(3, np.uint8),
        )
        yield "/depth/image", image(store, depth, encoding)  # before its camera: nobody knows where it looks
        yield "/depth/camera_info", camera(store, 3, 4, 10.0)
        yield "/color/camera_info", camera(store, 1, 1, 10.0)
        yield "/color/image", color
        yield "/depth/image", image(store, depth, encoding)

    path = record(tmp_path, kind, messages)
    assert list(ros.topics(path)) == ["/depth/image"]
    (cloud,) = ros.frames(path)
    expected = edgel.from_depth(depth.astype(float) * unit, (10.0, 10.0, 2.0, 1.5))
    np.testing.assert_allclose(cloud.xyz, expected.xyz, rtol=1e-12)
    assert cloud.shape == (3, 4)


def test_the_command_line_takes_a_topic_and_a_message(tmp_path):
    clouds = [some_records(seed) for seed in range(3)]
    path = record(tmp_path, "mcap", lambda store: [("/a", cloud2(store, clouds[0])), ("/b", cloud2(store, clouds[1]))])
    for words, found in ((["--topic", "/a"], clouds[0]), (["--topic", "/b:0"], clouds[1])):
        result = CliRunner().invoke(app, ["convert", str(path), str(tmp_path / "copy.npy"), *words])
        assert result.exit_code == 0, result.output
        np.testing.assert_array_equal(edgel.read(tmp_path / "copy.npy").xyz[:, 1], found["y"])
    result = CliRunner().invoke(app, ["info", str(path), "--topic", "/b:7"])
    assert result.exit_code == 3
    assert "no number 7" in result.output


def test_big_endian_clouds(tmp_path):
    records = some_records(3, order=">")
    path = record(tmp_path, "mcap", lambda store: [("/points", cloud2(store, records, big=True))])
    cloud = edgel.read(path)
    np.testing.assert_array_equal(cloud.xyz[:, 2], records["z"])
    np.testing.assert_array_equal(cloud.attributes["green"], records["rgb"] >> 8 & 255)


def test_what_cannot_be_read_says_why(tmp_path):
    records = some_records(4)
    both = record(tmp_path, "mcap", lambda store: [(f"/{name}", cloud2(store, records)) for name in "ab"])
    with pytest.raises(FormatError, match="choose one with topic=, of /a, /b"):
        edgel.read(both)
    with pytest.raises(FormatError, match="no clouds on /c; there are some on /a, /b"):
        edgel.read(both, topic="/c")
    with pytest.raises(FormatError, match="has 1 messages, no number 3"):
        edgel.read(both, topic="/a", message=3)
    with pytest.raises(ValueError, match="message: expected a number from 0 on"):
        edgel.read(both, topic="/a", message=-1)
    (tmp_path / "other").mkdir()
    none = record(tmp_path / "other", "bag", lambda store: [("/info", camera(store, 3, 4, 10.0))])
    with pytest.raises(FormatError, match="no topic of PointCloud2"):
        edgel.read(none)
    edgel.write(tmp_path / "a.ply", edgel.Cloud(np.eye(3)))
    with pytest.raises(ValueError, match=r"topic: .*a.ply is no ROS recording"):
        edgel.read(tmp_path / "a.ply", topic="/a")
    head = b"".join(len(text).to_bytes(4, "little") + text for text in (b"ros1", b"someone"))
    (tmp_path / "one.mcap").write_bytes(b"\x89MCAP0\r\n\x01" + len(head).to_bytes(8, "little") + head)
    with pytest.raises(FormatError, match=r"one.mcap: .* not of ROS 2; give the .bag"):
        edgel.read(tmp_path / "one.mcap")


def what_is_said(path):
    """The message of the FormatError, where there is one; nothing else may be raised."""
    try:
        return f"{path}: {len(list(ros.frames(path)))} messages"
    except FormatError as error:
        return str(error)


@pytest.mark.parametrize("kind", ["bag", "mcap", "db3"])
def test_damaged_recordings_are_refused(tmp_path, kind):
    path = record(tmp_path, kind, lambda store: [("/points", cloud2(store, some_records(5)))])
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for number in range(30):
        broken = bytearray(whole[: rng.integers(0, len(whole))] if number % 2 else whole)
        for place in rng.integers(0, max(len(broken), 1), 8 * (number % 2 == 0)):
            broken[place] ^= 1 << rng.integers(8)
        path.write_bytes(bytes(broken))
        assert path.name in what_is_said(path)


def test_edges_and_lines_as_messages(tmp_path, monkeypatch):
    """The example: what it records holds the edges and lines of what it read, with their times and frames."""
    x, y = (values.ravel() for values in np.meshgrid(np.arange(30.0), np.arange(30.0)))
    roof = np.zeros(900, [("x", "f4"), ("y", "f4"), ("z", "f4")])
    roof["x"], roof["y"], roof["z"] = x, y, 20 - abs(x - 12)
    path = record(tmp_path, "mcap", lambda store: [("/points", cloud2(store, roof, stamp=second)) for second in (3, 4)])
    example = Path(__file__).parents[2] / "examples" / "ros_markers.py"
    monkeypatch.setattr(sys, "argv", [str(example), str(path), str(tmp_path / "edges"), "--frames", "1"])
    runpy.run_path(str(example), run_name="__main__")
    found = edgel.detect(edgel.read(path))
    (cloud,) = ros.frames(tmp_path / "edges")
    assert cloud.metadata["ros"] == {"topic": "/edges", "stamp": 3 * 10**9 + 7, "frame_id": "sensor"}
    np.testing.assert_array_equal(cloud.xyz, found.position.astype(np.float32))
    np.testing.assert_array_equal(cloud.attributes["kind"], found.kind)
    colors = np.c_[cloud.attributes["red"], cloud.attributes["green"], cloud.attributes["blue"]]
    np.testing.assert_array_equal(colors, kind_colors(found.kind))
    curves = edgel.curves.trace(edgel.read(path), found)
    with AnyReader([tmp_path / "edges"]) as reader:
        marker: Any
        (marker,) = [
            reader.deserialize(raw, one.msgtype) for one, _, raw in reader.messages() if one.topic == "/edge_lines"
        ]
    assert marker.type == marker.LINE_LIST
    assert len(marker.points) == 2 * (len(curves.vertices) - len(curves)) == len(marker.colors)
    length = sum(
        np.linalg.norm([a.x - b.x, a.y - b.y, a.z - b.z])
        for a, b in zip(marker.points[::2], marker.points[1::2], strict=True)
    )
    assert length == pytest.approx(curves.length.sum(), rel=1e-6)
