"""Edges and lines of a ROS recording as ROS messages: a PointCloud2 and a Marker for each cloud.

    python examples/ros_markers.py drive.mcap edges            # a rosbag 2 in the folder edges, for RViz or Foxglove
    python examples/ros_markers.py drive.bag edges --topic /velodyne_points --frames 10

It needs no ROS (``pip install 'edgel[ros]'``). In a node of yours `edge_points` and `lines` do the same with the
message types of ``sensor_msgs.msg`` and ``visualization_msgs.msg``: pass a `types` that looks them up by name.
"""

import argparse
import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

import edgel
from edgel.plot.palette import KIND_COLORS, kind_colors

FLOAT32, UINT8 = 7, 2  # numbers of sensor_msgs/PointField
LINE_LIST, ADD = 5, 0  # of visualization_msgs/Marker
COLUMNS = {"x": "f4", "y": "f4", "z": "f4", "rgb": "u4", "strength": "f4", "kind": "u1"}


def header(types: Mapping[str, Any], facts: Mapping[str, Any]) -> Any:
    """Make the header of a message from what `edgel.io.ros.frames` knows of its cloud."""
    seconds, rest = divmod(facts["stamp"], 10**9)
    stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=rest)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=facts["frame_id"])


def edge_points(types: Mapping[str, Any], edges: edgel.Edges, facts: Mapping[str, Any]) -> Any:
    """Make a sensor_msgs/PointCloud2 of the places on the edges: x y z, rgb by kind, strength, kind."""
    records = np.zeros(len(edges), np.dtype([*COLUMNS.items()]))
    for name, values in zip("xyz", edges.position.T, strict=True):
        records[name] = values
    records["rgb"] = kind_colors(edges.kind).astype(np.uint32) @ [1 << 16, 1 << 8, 1]
    records["strength"], records["kind"] = edges.strength, edges.kind
    field, offset, fields = types["sensor_msgs/msg/PointField"], 0, []
    for name, code in COLUMNS.items():  # the bits of rgb stand in a float, as PCL has it
        fields.append(field(name=name, offset=offset, datatype=UINT8 if code == "u1" else FLOAT32, count=1))
        offset += np.dtype(code).itemsize
    return types["sensor_msgs/msg/PointCloud2"](
        header=header(types, facts),
        height=1,
        width=len(edges),
        fields=fields,
        is_bigendian=False,
        point_step=records.itemsize,
        row_step=records.nbytes,
        data=records.view(np.uint8),
        is_dense=True,
    )


def lines(types: Mapping[str, Any], curves: edgel.curves.Curves, facts: Mapping[str, Any], width: float) -> Any:
    """Make a visualization_msgs/Marker of curves: a list of straight pieces in the colors of their kinds."""
    point, color = types["geometry_msgs/msg/Point"], types["std_msgs/msg/ColorRGBA"]
    places, colors = [], []
    for number, (begin, end) in enumerate(itertools.pairwise(curves.start)):
        kind = edgel.EdgeKind(int(curves.edge[number]))
        shade = color(*(float(part) / 255 for part in KIND_COLORS[kind]), 1.0)
        for pair in itertools.pairwise(curves.vertices[begin:end].tolist()):
            places += [point(*place) for place in pair]
            colors += [shade, shade]
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    span = types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)  # it stays until the next
    nothing = {"text": "", "mesh_resource": "", "mesh_use_embedded_materials": False, "uv_coordinates": []}
    nothing |= {"texture_resource": "", "texture": empty_image(types, facts)}
    nothing |= {"mesh_file": types["visualization_msgs/msg/MeshFile"](filename="", data=np.zeros(0, np.uint8))}
    return types["visualization_msgs/msg/Marker"](
        header=header(types, facts),
        ns="edgel",
        id=0,
        type=LINE_LIST,
        action=ADD,
        pose=types["geometry_msgs/msg/Pose"](position=point(0.0, 0.0, 0.0), orientation=quaternion(0.0, 0.0, 0.0, 1.0)),
        scale=vector(width, 0.0, 0.0),
        color=color(0.0, 0.0, 0.0, 1.0),
        lifetime=span,
        frame_locked=False,
        points=places,
        colors=colors,
        **nothing,
    )


def empty_image(types: Mapping[str, Any], facts: Mapping[str, Any]) -> Any:
    """Make the texture that a marker of lines has none of."""
    parts = {"header": header(types, facts), "format": "", "data": np.zeros(0, np.uint8)}
    return types["sensor_msgs/msg/CompressedImage"](**parts)


def main() -> None:
    """Find the edges and lines of each cloud of a recording and record them."""
    parser = argparse.ArgumentParser(description="Edges and lines of a ROS recording, as ROS messages.")
    parser.add_argument("recording", type=Path, help="an .mcap, a .bag, a .db3, or the folder of a rosbag 2")
    parser.add_argument("output", type=Path, help="the folder of the rosbag 2 to write; it must not be there")
    parser.add_argument("--topic", help="default: the only one that carries clouds")
    parser.add_argument("--frames", type=int, help="stop after so many")
    parser.add_argument("--width", type=float, default=0.02, help="of the lines, in metres (default: %(default)s)")
    asked = parser.parse_args()
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(asked.output, version=9) as writer:
        names = {"/edges": "sensor_msgs/msg/PointCloud2", "/edge_lines": "visualization_msgs/msg/Marker"}
        topics = {topic: writer.add_connection(topic, name, typestore=store) for topic, name in names.items()}
        for cloud in itertools.islice(edgel.io.ros.frames(asked.recording, topic=asked.topic), asked.frames):
            facts = cloud.metadata["ros"]
            edges = edgel.detect(cloud)
            curves = edgel.curves.trace(cloud, edges)
            made = {"/edges": edge_points(store.types, edges, facts)}
            made["/edge_lines"] = lines(store.types, curves, facts, asked.width)
            for topic, message in made.items():
                writer.write(topics[topic], facts["stamp"], store.serialize_cdr(message, names[topic]))
            print(f"{facts['stamp'] / 1e9:.3f} s: {len(edges)} edge points, {len(curves)} lines")


if __name__ == "__main__":
    main()
