"""ROS recordings by rosbags (``pip install 'edgel[ros]'``), without ROS: MCAP, rosbag 2 and rosbag 1.

A recording holds many clouds: the messages of topics of `sensor_msgs/PointCloud2`, and of depth images
(`sensor_msgs/Image`, 16UC1, mono16 or 32FC1) beside whose topic a `camera_info` was recorded.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from edgel._depth import from_depth
from edgel._objects import find_xyz
from edgel.cloud import Cloud
from edgel.io.errors import FormatError, printable
from edgel.io.files import check_readable
from edgel.io.pcd import attributes_of

EXTENSIONS = (".mcap", ".bag", ".db3")
_CLOUD, _IMAGE, _CAMERA = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
_DEPTHS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
"""Encodings of depth images: counts of a millimetre, or metres (REP 118)."""
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Numbers of sensor_msgs/PointField."""
_PLAIN = {"Profile is not ros2.": "an MCAP that is not of ROS 2; give the .bag that it was made from"}
"""What rosbags says, as its user would."""


def topics(path: str | os.PathLike[str]) -> dict[str, int]:
    """Return the topics of a recording that carry clouds or depth images with a camera, and how many messages each has.

    Examples
    --------
    >>> topics("drive.mcap")  # doctest: +SKIP
    {'/camera/depth/image_rect_raw': 300, '/velodyne_points': 100}
    """
    with _open(path) as reader, _refusing(printable(path)):
        return {topic: sum(one.msgcount for one in found) for topic, found in _offered(reader).items()}


def read(path: str | os.PathLike[str], *, topic: str | None = None, message: int = 0) -> Cloud:
    """Read one message of a recording as a cloud; see `frames`.

    Parameters
    ----------
    path : path
    topic : str, optional
        Default: the only one there is.
    message : int
        Its number on the topic, from 0.

    Raises
    ------
    FormatError
        If the file is no recording or damaged, has no such topic, none, or several and none was chosen, or has fewer
        messages; or rosbags is not installed.
    """
    if message < 0:
        raise ValueError(f"message: expected a number from 0 on, got {message}")
    number = -1
    for number, cloud in enumerate(frames(path, topic=topic)):
        if number == message:
            return cloud
    raise FormatError(f"{printable(path)}: has {number + 1} messages, no number {message}; the first is 0")


def frames(path: str | os.PathLike[str], *, topic: str | None = None) -> Iterator[Cloud]:
    """Go through the messages of a topic, each a cloud, in the order of the recording.

    Parameters
    ----------
    path : path
        An ``.mcap``, a ``.bag``, a ``.db3``, or the folder of a rosbag 2.
    topic : str, optional
        Default: the only one that carries clouds.

    Yields
    ------
    Cloud
        Of a PointCloud2 its fields as attributes (packed ``rgb`` as ``red green blue``, ``normal_x`` as ``nx`` and so
        on), organized where its height is above 1, the sensor then at the origin of its frame. Of a depth image what
        `edgel.from_depth` makes of it and the last CameraInfo before it. ``metadata["ros"]`` has the ``topic``, the
        ``stamp`` of the header in nanoseconds, and the ``frame_id``.

    Raises
    ------
    FormatError
        See `read`.

    Examples
    --------
    >>> for cloud in frames("drive.mcap", topic="/velodyne_points"):  # doctest: +SKIP
    ...     print(cloud.metadata["ros"]["stamp"], edgel.detect(cloud))
    """
    name = printable(path)
    with _open(path) as reader:
        with _refusing(name):
            offered = _offered(reader)
        chosen = _choose(name, offered, topic)
        beside = _camera_topic(chosen)
        cameras = [one for one in reader.connections if one.topic == beside and one.msgtype == _CAMERA]
        camera: Any = None
        for connection, _, raw in _guarded(name, reader.messages([*offered[chosen], *cameras])):
            with _refusing(name):
                message = reader.deserialize(raw, connection.msgtype)
            if connection.msgtype == _CAMERA:
                camera = message
            elif connection.msgtype == _CLOUD:
                yield _described(_cloud_of(name, message), message, chosen)
            elif camera is not None:
                yield _described(_depth_of(name, message, camera), message, chosen)


@contextmanager
def _open(path: str | os.PathLike[str]) -> Iterator[Any]:
    """Open a recording; whatever is wrong with it is a FormatError."""
    name = printable(path)
    if not Path(path).is_dir():
        check_readable(path)
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise FormatError(f"{name}: ROS recordings need rosbags; get it with: pip install 'edgel[ros]'") from None
    # Older rosbag 2 do not say how messages are laid out; these have not changed since ROS 2 began.
    with _refusing(name):
        reader = AnyReader([Path(path)], default_typestore=get_typestore(Stores.LATEST))
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


@contextmanager
def _refusing(name: str) -> Iterator[None]:
    """Turn what rosbags raises on a damaged file into a FormatError: errors of its own, and of unpacking."""
    try:
        yield
    except (FormatError, PermissionError):
        raise
    except Exception as error:  # also MemoryError: a damaged length asks for more than there is
        said = _PLAIN.get(str(error)) or printable(str(error), 200) or type(error).__name__
        raise FormatError(f"{name}: cannot be read as a ROS recording: {said}") from error


def _guarded(name: str, messages: Iterator[Any]) -> Iterator[Any]:
    """Go through messages, refusing as `_refusing` does what is damaged."""
    while True:
        with _refusing(name):
            message = next(messages, None)
        if message is None:
            return
        yield message


def _offered(reader: Any) -> dict[str, list[Any]]:
    """Connections of the topics that carry clouds, or images with a camera beside them, by topic in order."""
    cameras = {one.topic for one in reader.connections if one.msgtype == _CAMERA}
    found: dict[str, list[Any]] = {}
    for one in sorted(reader.connections, key=lambda one: one.topic):
        if one.msgtype == _CLOUD or (one.msgtype == _IMAGE and _camera_topic(one.topic) in cameras):
            found.setdefault(one.topic, []).append(one)
    # A color image has a camera too.
    return {topic: ones for topic, ones in found.items() if ones[0].msgtype == _CLOUD or _is_depth(reader, ones)}


def _is_depth(reader: Any, connections: list[Any]) -> bool:
    first = next(iter(reader.messages(connections)), None)
    return first is not None and reader.deserialize(first[2], _IMAGE).encoding in _DEPTHS


def _camera_topic(topic: str) -> str:
    return topic.rpartition("/")[0] + "/camera_info"


def _choose(name: str, offered: dict[str, list[Any]], topic: str | None) -> str:
    if topic is None and len(offered) == 1:
        return next(iter(offered))
    if topic in offered:
        return topic  # pyright: ignore[reportReturnType]
    known = ", ".join(map(printable, offered))
    if not offered:
        raise FormatError(f"{name}: no topic of PointCloud2, nor of depth images with a camera_info beside it")
    if topic is None:
        raise FormatError(f"{name}: clouds on several topics; choose one with topic=, of {known}")
    raise FormatError(f"{name}: no clouds on {printable(topic)}; there are some on {known}")


def _cloud_of(name: str, message: Any) -> Cloud:
    """Make a cloud of a PointCloud2."""
    known = [field for field in message.fields if field.datatype in _TYPES and field.name]
    names: list[str] = [field.name for field in known]
    height, width, step, row = (int(getattr(message, key)) for key in ("height", "width", "point_step", "row_step"))
    layout: Any = {"names": names, "offsets": [field.offset for field in known], "itemsize": step}
    layout["formats"] = [_format_of(field, ">" if message.is_bigendian else "<") for field in known]
    with _refusing(name):
        shape, strides = (height, width), (row or width * step, step)
        table = np.ndarray(shape, np.dtype(layout), np.ascontiguousarray(message.data), strides=strides)
        records = table.reshape(-1)
    axes = find_xyz(names)
    if axes is None:
        raise FormatError(f"{name}: a PointCloud2 without x, y and z: {', '.join(map(printable, names))}")
    others = {name: records[name] for name in names if name not in axes}
    attributes = attributes_of({name: part.astype(part.dtype.newbyteorder("=")) for name, part in others.items()})
    xyz = np.column_stack([records[axis].astype(np.float64) for axis in axes])
    organized = height > 1 and width > 1
    return Cloud(xyz, attributes, (height, width) if organized else None, np.zeros(3) if organized else None)


def _format_of(field: Any, order: str) -> tuple[str, tuple[int, ...]]:
    """Type of a field; colors packed into a float are NaN for some alphas, which a float need not keep."""
    code = "u4" if field.name.lower() in ("rgb", "rgba") and _TYPES[field.datatype] == "f4" else _TYPES[field.datatype]
    return order + code, (field.count,) if field.count > 1 else ()


def _depth_of(name: str, message: Any, camera: Any) -> Cloud:
    """Make an organized cloud of a depth image and its camera."""
    if message.encoding not in _DEPTHS:
        known = ", ".join(_DEPTHS)
        raise FormatError(f"{name}: an image of {printable(message.encoding, 40)}; depth is {known}")
    dtype = np.dtype((">" if message.is_bigendian else "<") + _DEPTHS[message.encoding])
    with _refusing(name):
        shape, strides = (message.height, message.width), (message.step, dtype.itemsize)
        depth = np.ndarray(shape, dtype, np.ascontiguousarray(message.data), strides=strides)
        return from_depth(depth.astype(dtype.newbyteorder("=")), camera)


def _described(cloud: Cloud, message: Any, topic: str) -> Cloud:
    stamp = message.header.stamp
    facts = {"topic": topic, "stamp": stamp.sec * 10**9 + stamp.nanosec, "frame_id": message.header.frame_id}
    return replace(cloud, metadata={**cloud.metadata, "ros": facts})
