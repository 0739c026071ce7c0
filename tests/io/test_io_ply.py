import os
from contextlib import suppress
from io import BytesIO

import numpy as np
import plyfile
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_io_support import assert_same, clouds, rich_cloud

from edgel import Cloud
from edgel.io import FormatError, FormatWarning, ply, read, write

HEADER = "ply\nformat {} 1.0\n{}end_header\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"


def ply_bytes(body, lines, kind="ascii"):
    return HEADER.format(kind, lines).encode() + body


def read_bytes(raw):
    return read(BytesIO(raw))


@settings(max_examples=60)
@given(clouds(dtypes=("bool", "i1", "u1", "i2", "u2", "i4", "u4", "f2", "f4", "f8")))
def test_round_trip(cloud):
    file = BytesIO()
    write(file, cloud)
    assert_same(read_bytes(file.getvalue()), cloud, dtypes=False)


def test_round_trip_keeps_types_shape_viewpoint_crs(tmp_path):
    cloud = rich_cloud(shape=(6, 7), holes=True)
    cloud = Cloud(
        cloud.xyz, cloud.attributes, (6, 7), np.array([0.1, 2, 3]), 'PROJCS["a",\n "b"]', {"ply_comments": ("hello",)}
    )
    write(tmp_path / "a.ply", cloud)
    found = read(tmp_path / "a.ply")
    assert_same(found, cloud, dtypes=False)
    # The four types that Open3D reads.
    for codes, stored in [
        (("bool", "u1"), "u1"),
        (("i1", "i2", "u2", "i4", "u4", "i8", "u8"), "i4"),
        (("f2", "f4"), "f4"),
    ]:
        assert {found.attributes[f"a_{code}"].dtype.str[1:] for code in codes} == {stored}
    assert found.attributes["a_f8"].dtype == np.float64
    assert found.shape == (6, 7)
    assert found.viewpoint is not None
    assert found.viewpoint.tolist() == [0.1, 2, 3]
    assert found.crs == 'PROJCS["a", "b"]'
    assert found.metadata["ply_comments"] == ("hello",)


@pytest.mark.parametrize(("value", "code"), [(2**31 - 1, "i4"), (2**31, "f8"), (2**53, "f8"), (-(2**53), "f8")])
def test_64_bit_integers_find_an_exact_type(value, code):
    file = BytesIO()
    write(file, Cloud(np.zeros((1, 3)), {"id": np.array([value], np.int64)}))
    found = read_bytes(file.getvalue()).attributes["id"]
    assert found.dtype == np.dtype(code)
    assert int(found[0]) == value


@pytest.mark.parametrize("id", [np.array([2**53 + 1]), np.array([2**63 + 1], np.uint64), np.array([-(2**53) - 1])])
def test_integers_beyond_2_to_53_are_left_out_not_rounded(id):
    file = BytesIO()
    with pytest.warns(FormatWarning, match=r"id: left out.*\.npz holds it"):
        write(file, Cloud(np.zeros((1, 3)), {"id": id, "label": np.array([7])}))
    assert {name: v.tolist() for name, v in read_bytes(file.getvalue()).attributes.items()} == {"label": [7]}


@pytest.mark.parametrize(("xyz", "kind"), [([[0.5, 1, 2]], b"property float x"), ([[0.1, 1, 2]], b"property double x")])
def test_coordinates_are_float_only_when_exact(xyz, kind):
    file = BytesIO()
    write(file, Cloud(np.array(xyz)))
    assert kind in file.getvalue()


def test_plyfile_reads_ours(tmp_path):
    cloud = rich_cloud()
    write(tmp_path / "a.ply", cloud)
    vertex = plyfile.PlyData.read(tmp_path / "a.ply")["vertex"]
    np.testing.assert_array_equal(np.column_stack([vertex[axis] for axis in "xyz"]), cloud.xyz)
    for name, values in cloud.attributes.items():
        if values.ndim == 1:
            known = name in ("red", "green", "blue")
            np.testing.assert_array_equal(vertex[name if known else f"scalar_{name}"], values)


@pytest.mark.parametrize("order", ["<", ">", "="])
@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("coordinate", ["f4", "f8"])
def test_we_read_plyfiles(tmp_path, order, text, coordinate):
    rng = np.random.default_rng(0)
    codes = ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"]
    table = np.empty(50, [*[(axis, coordinate) for axis in "xyz"], *[(f"a_{code}", code) for code in codes]])
    for name in table.dtype.names or ():
        table[name] = rng.integers(0, 100, 50) if table.dtype[name].kind in "iu" else rng.normal(size=50)
    faces = np.empty(3, [("vertex_indices", object), ("n", "u1")])
    for i in range(3):
        faces[i] = (np.arange(i + 2, dtype=np.int32), i)
    before = plyfile.PlyElement.describe(faces, "face", val_types={"vertex_indices": "i4"})
    camera = plyfile.PlyElement.describe(np.zeros(2, [("view", "f4")]), "camera")
    vertex = plyfile.PlyElement.describe(table, "vertex")
    for number, elements in enumerate([[vertex], [vertex, before], [camera, before, vertex]]):
        file = tmp_path / f"{number}.ply"
        plyfile.PlyData(elements, text=text, byte_order=order).write(file)
        found = read(file)
        np.testing.assert_array_equal(found.xyz, np.column_stack([table[axis] for axis in "xyz"]))
        for code in codes:
            np.testing.assert_array_equal(found.attributes[f"a_{code}"], table[f"a_{code}"])
            assert found.attributes[f"a_{code}"].dtype == np.dtype(code)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_list_properties_of_vertices_are_skipped(kind):
    # By hand: plyfile writes rows with lists in the machine's own byte order whatever is asked.
    lines = "element vertex 5\nproperty float x\nproperty list ushort short near\nproperty float y\nproperty double z\n"
    lines += "property ushort label\n"
    body = b""
    for i in range(5):
        values = [(i, "f4"), (i, "u2"), *[(7, "i2")] * i, (i + 1, "f4"), (i + 2, "f8"), (7 * i, "u2")]
        if kind == "ascii":
            body += " ".join(str(value) for value, _ in values).encode() + b"\n"
        else:
            body += b"".join(
                np.array(value, ("<" if "little" in kind else ">") + code).tobytes() for value, code in values
            )
    found = read_bytes(ply_bytes(body, lines, kind))
    assert found.xyz.tolist() == [[i, i + 1, i + 2] for i in range(5)]
    assert found.attributes["label"].tolist() == [0, 7, 14, 21, 28]
    with pytest.raises(FormatError):
        read_bytes(ply_bytes(body[:-4], lines, kind))


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_line_ends(end, kind):
    lines = HEADER.format(kind, f"element vertex 1\n{XYZ}").encode().replace(b"\n", end)
    # A first byte of "\n" is data where the lines end in CR.
    xyz = np.array([np.frombuffer(b"\n\n\n\n", "<f4")[0], 2, 3], "<f4")
    raw = lines + (b"1 2 3" + end if kind == "ascii" else xyz.tobytes())
    expected = [1, 2, 3] if kind == "ascii" else xyz.tolist()
    assert read_bytes(raw).xyz.tolist() == [expected]


def test_text_coordinates_are_parsed_as_double():
    raw = ply_bytes(b"4877455.581 494428.612 131.57\n", f"element vertex 1\n{XYZ}")
    assert read_bytes(raw).xyz.tolist() == [[4877455.581, 494428.612, 131.57]]


def test_upper_case_axes_and_empty_cloud():
    assert read_bytes(ply_bytes(b"1 2 3\n", f"element vertex 1\n{XYZ.replace('float x', 'float X')}")).xyz.tolist() == [
        [1, 2, 3]
    ]
    assert len(read_bytes(ply_bytes(b"", f"element vertex 0\n{XYZ}"))) == 0
    assert len(read_bytes(ply_bytes(b"", f"element vertex 0\n{XYZ}", "binary_big_endian"))) == 0
    file = BytesIO()
    write(file, Cloud(np.empty((0, 3)), {"id": np.empty(0, np.int64)}))
    assert len(read_bytes(file.getvalue())) == 0


def test_stanford_range_grid():
    lines = "obj_info num_cols 3\nobj_info num_rows 2\n"
    raw = ply_bytes(b"1 2 3\n" * 6, f"{lines}element vertex 6\n{XYZ}")
    assert read_bytes(raw).shape == (2, 3)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_stanford_range_grid_of_valid_points(kind):
    lines = f"obj_info num_cols 3\nobj_info num_rows 2\nelement vertex 2\n{XYZ}property uchar label\n"
    lines += "element range_grid 6\nproperty list uchar int vertex_indices\n"
    if kind == "ascii":
        body = b"1 2 3 7\n4 5 6 8\n0\n1 0\n0\n0\n0\n1 1\n"
    else:
        order = "<" if "little" in kind else ">"
        points = np.array([(1, 2, 3, 7), (4, 5, 6, 8)], np.dtype(f"{order}f4,{order}f4,{order}f4,u1"))
        cells = [
            b"\0",
            b"\1" + np.array(0, f"{order}i4").tobytes(),
            b"\0",
            b"\0",
            b"\0",
            b"\1" + np.array(1, f"{order}i4").tobytes(),
        ]
        body = points.tobytes() + b"".join(cells)
    found = read_bytes(ply_bytes(body, lines, kind))
    assert found.shape == (2, 3)
    assert np.isfinite(found.xyz[:, 0]).tolist() == [False, True, False, False, False, True]
    assert found.xyz[[1, 5]].tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found.attributes["label"].tolist() == [0, 7, 0, 0, 0, 8]
    with pytest.raises(FormatError):
        read_bytes(ply_bytes(body[:-4], lines, kind))


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_promise_of_a_trillion_points_is_not_believed(kind):
    with pytest.raises(FormatError, match="declared 1000000000000 vertices, found"):
        read_bytes(ply_bytes(b"1 2 3\n" * 10, f"element vertex 1000000000000\n{XYZ}", kind))
    faces = "element face 1000000000000\nproperty list uchar int vertex_indices\n"
    with pytest.raises(FormatError):
        read_bytes(ply_bytes(b"1 2 3\n" * 10, f"{faces}element vertex 1\n{XYZ}", kind))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("", "no vertices"),
        ("element face 3\nproperty list uchar int i\n", "elements: face"),
        ("element vertex 1\nproperty float x\nproperty float y\n", "x, y and z are needed"),
        ("element vertex 1\nproperty float3 x\n", "header line 4"),
        ("element vertex -1\n", "header line 3"),
        (f"element vertex 1\n{XYZ}property float a\nproperty float a\n", "one name"),
        (f"obj_info viewpoint 1 2\nelement vertex 1\n{XYZ}property float a\nproperty float b\n", "viewpoint"),
        ("garbage\n", "header line 3"),
    ],
)
def test_broken_headers(lines, message):
    with pytest.raises(FormatError, match=message):
        read_bytes(ply_bytes(b"1 2 3 4 5\n", lines))


def test_bad_words_name_their_line():
    with pytest.raises(FormatError, match=r"line 9: expected 3 numbers.*'1 two 3'"):
        read_bytes(ply_bytes(b"1 2 3\n1 two 3\n", f"element vertex 2\n{XYZ}"))
    with pytest.raises(FormatError, match="no end_header"):
        read_bytes(b"ply\nformat ascii 1.0\n")
    with pytest.raises(FormatError, match="the header gives"):
        read_bytes(ply_bytes(b"1 2 3 300\n", f"element vertex 1\n{XYZ}property uchar a\n"))


@pytest.mark.parametrize(
    ("attributes", "said", "names"),
    [
        ({"X": np.zeros(2)}, {"X": "renamed X_2"}, ["X_2"]),
        ({"n_0": np.ones(2), "n": np.zeros((2, 2))}, {"n": "renamed n_2"}, ["n_0", "n_2_0", "n_2_1"]),
        ({"n": np.zeros((2, 2)), "n_0": np.ones(2)}, {"n_0": "renamed n_0_2"}, ["n_0", "n_1", "n_0_2"]),
        ({"name": np.array(["a", "b"]), "k": np.zeros(2)}, {"name": "left out, <U1 is no type of numbers"}, ["k"]),
        ({"t": np.zeros(2, "M8[s]"), "c": np.zeros(2, complex)}, {"t": "left out", "c": "left out"}, []),
        ({"a\0b": np.zeros(2), "\ud800": np.ones(2), "": np.ones(2)}, {"": "renamed __2"}, ["a_b", "_", "__2"]),
    ],
)
def test_what_has_no_place_is_left_out_or_renamed_and_said(attributes, said, names):
    file = BytesIO()
    with pytest.warns(FormatWarning) as caught:
        write(file, Cloud(np.zeros((2, 3)), attributes))
    found = caught[0].message
    assert isinstance(found, FormatWarning)
    assert caught[0].filename == __file__
    assert found.said.keys() == said.keys()
    assert all(found.said[name].startswith(what) for name, what in said.items())
    assert list(read_bytes(file.getvalue()).attributes) == names


def test_the_prefix_is_taken_off_our_own_files_only():
    file = BytesIO()
    cloud = Cloud(np.eye(3), {name: np.arange(3.0) for name in ("label", "scalar_label", "nx", "intensity", "scalar_")})
    write(file, cloud)
    assert_same(read_bytes(file.getvalue()), cloud)
    theirs = file.getvalue().replace(b"obj_info prefix scalar_\n", b"")
    names = ["scalar_label", "scalar_scalar_label", "nx", "intensity", "scalar_scalar_"]
    assert list(read_bytes(theirs).attributes) == names


def test_truncated_scan_says_how_many_are_there(shared_data):
    file = shared_data / "malformed" / "photoneo_truncated_896000_declared.ply"
    with pytest.raises(FormatError, match="declared 896000 vertices, found 289581"):
        read(file)


def test_shared_files_as_plyfile_reads_them(shared_data):
    files = [
        *shared_data.glob("truth/*.ply"),
        *shared_data.glob("lidar_sweeps/*.ply"),
        *shared_data.glob("scan_vs_mesh/*.ply"),
    ]
    assert len(files) > 20
    for file in files:
        vertex, found = plyfile.PlyData.read(file)["vertex"], read(file)
        np.testing.assert_array_equal(found.xyz, np.column_stack([vertex[axis] for axis in "xyz"]))
        assert list(found.attributes) == [p.name for p in vertex.properties if p.name not in "xyz"]


@settings(max_examples=150)
@given(st.data())
def test_cut_or_damaged_anywhere(data):
    file = BytesIO()
    ply.write(file, rich_cloud(5))
    raw = bytearray(file.getvalue())
    if data.draw(st.booleans()):
        raw = raw[: data.draw(st.integers(0, len(raw)))]
    else:
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    with suppress(FormatError):
        read_bytes(bytes(raw))


def test_pipe(tmp_path):
    read_end, write_end = os.pipe()
    cloud = rich_cloud(7)
    with os.fdopen(write_end, "wb") as file:
        write(file, cloud)
    with os.fdopen(read_end, "rb") as file:
        assert_same(read(file), cloud, dtypes=False)
    with pytest.raises(TypeError, match="binary"), open(tmp_path / "a.ply", "w") as text:
        write(text, cloud)  # pyright: ignore[reportArgumentType]
