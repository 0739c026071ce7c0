import shutil
import struct
import subprocess
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_io_support import assert_same, clouds, rich_cloud

from edgel import Cloud
from edgel.io import FormatError, FormatWarning, read, write
from edgel.io.lzf import lzf_decompress

HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH 2
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 2
DATA ascii
"""


def read_text(tmp_path, text):
    (tmp_path / "a.pcd").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(tmp_path / "a.pcd")


def lzf_literals(raw):
    """The simplest valid LZF: nothing but literal runs."""
    return b"".join(bytes([len(raw[i : i + 32]) - 1]) + raw[i : i + 32] for i in range(0, len(raw), 32))


@settings(max_examples=60)
@given(clouds())
def test_round_trip(tmp_path_factory, cloud):
    file = tmp_path_factory.mktemp("pcd") / "a.pcd"
    with np.errstate(over="ignore"):
        cloud = Cloud(cloud.xyz.astype(np.float32), cloud.attributes)
    write(file, cloud)
    assert_same(read(file), cloud, dtypes=False)


def fields_of(file):
    return {line.split()[0]: line.split()[1:] for line in file.read_bytes().split(b"DATA")[0].decode().splitlines()}


def test_coordinates_are_float32_which_pcl_reads(tmp_path):
    cloud = Cloud(np.array([[0.1, -20.3, 1e4], [np.nan, 1, 2]]))
    write(tmp_path / "a.pcd", cloud)  # nothing to say: single precision is finer than any sensor here
    assert fields_of(tmp_path / "a.pcd")["SIZE"] == ["4"] * 3
    np.testing.assert_array_equal(read(tmp_path / "a.pcd").xyz, cloud.xyz.astype(np.float32))


def test_large_coordinates_are_shifted_and_come_back(tmp_path):
    xyz = np.random.default_rng(0).uniform([5e5, 5.6e6, 90], [5.01e5, 5.601e6, 300], (50, 3)).round(3)
    xyz[7, 1] = np.nan
    cloud = Cloud(xyz, viewpoint=np.array([500500.0, 5600500, 1000]))
    with pytest.warns(FormatWarning, match=r"coordinates: counted from 500500 5600500 0.*rounded.*2e-05 at most"):
        write(tmp_path / "a.pcd", cloud)
    fields = fields_of(tmp_path / "a.pcd")
    assert (fields["SIZE"], fields["VIEWPOINT"][:3]) == (["4"] * 3, ["0", "0", "1000"])
    found = read(tmp_path / "a.pcd")
    np.testing.assert_allclose(found.xyz, xyz, rtol=0, atol=1.6e-5)
    assert found.viewpoint is not None
    assert found.viewpoint.tolist() == [500500, 5600500, 1000]
    # Written once more, part of it too, it is the same.
    with pytest.warns(FormatWarning, match="counted from 500500 5600500 0"):
        write(tmp_path / "b.pcd", found.take(np.arange(9)))
    np.testing.assert_array_equal(read(tmp_path / "b.pcd").xyz, found.xyz[:9])
    broken = (tmp_path / "a.pcd").read_bytes().replace(b"edgel shift 500500", b"edgel shift 5005k0")
    with pytest.raises(FormatError, match="three finite numbers"):
        read_text(tmp_path, broken)


@pytest.mark.parametrize(
    ("xyz", "said"), [([[-3e4, 0.1, 0], [3e4, 0, 0]], "rounded"), ([[1e300, 0.1, 0]], "double precision")]
)
def test_what_no_shift_mends_is_said(tmp_path, xyz, said):
    with pytest.warns(FormatWarning, match=f"coordinates: .*{said}"):
        write(tmp_path / "a.pcd", Cloud(np.array(xyz)))
    np.testing.assert_allclose(read(tmp_path / "a.pcd").xyz, xyz, rtol=1e-7)


def test_names_and_types_of_pcl(tmp_path):
    attributes = {name: np.array([0.5, 1, 2], np.float32) for name in ("nx", "ny", "nz")}
    attributes |= {"intensity": np.arange(3, dtype=np.uint16), "label": np.arange(3), "far": np.array([0, 1, 2**40])}
    cloud = Cloud(
        np.eye(3), {**attributes, **{name: np.arange(3, dtype=np.uint16) for name in ("red", "green", "blue")}}
    )
    write(tmp_path / "a.pcd", cloud)
    fields = fields_of(tmp_path / "a.pcd")
    assert fields["FIELDS"] == ["x", "y", "z", "normal_x", "normal_y", "normal_z", "intensity", "label", "far", "rgb"]
    assert list(map("".join, zip(fields["TYPE"], fields["SIZE"], strict=True))) == ["F4"] * 7 + ["U4", "I8", "F4"]
    assert_same(read(tmp_path / "a.pcd"), cloud, dtypes=False)
    both = Cloud(np.eye(3), {**attributes, "normal_x": np.arange(3)})
    write(tmp_path / "b.pcd", both)
    assert_same(read(tmp_path / "b.pcd"), both, dtypes=False)


@pytest.mark.parametrize("name", ["rgb", "rgba", "_", "X"])
def test_names_that_pcd_reads_otherwise_are_renamed_and_said(tmp_path, name):
    with pytest.warns(FormatWarning, match=f"{name}: renamed {name}_2"):
        write(tmp_path / "a.pcd", Cloud(np.eye(3), {name: np.arange(3)}))
    assert read(tmp_path / "a.pcd").attributes[f"{name}_2"].tolist() == [0, 1, 2]


def test_one_column_is_no_grid(tmp_path):
    write(tmp_path / "a.pcd", Cloud(np.eye(3), shape=(3, 1)))
    assert (fields_of(tmp_path / "a.pcd")["WIDTH"], fields_of(tmp_path / "a.pcd")["HEIGHT"]) == (["3"], ["1"])


def test_round_trip_keeps_types_shape_viewpoint(tmp_path):
    cloud = rich_cloud(shape=(6, 7), holes=True)
    view = (1.0, 2.5, 3.0, 0.5, 0.5, 0.5, 0.5)
    xyz = cloud.xyz.astype(np.float32)
    cloud = Cloud(xyz, cloud.attributes, (6, 7), np.array(view[:3]), None, {"pcd_viewpoint": view})
    write(tmp_path / "a.pcd", cloud)
    found = read(tmp_path / "a.pcd")
    assert_same(found, cloud, dtypes=False)
    for code in ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"):
        assert found.attributes[f"a_{code}"].dtype == np.dtype(code)
    assert found.attributes["normal"].shape == (42, 3)
    assert found.shape == (6, 7)
    assert found.metadata["pcd_viewpoint"] == view
    assert found.viewpoint is not None
    assert found.viewpoint.tolist() == list(view[:3])
    write(tmp_path / "b.pcd", Cloud(np.eye(3)))
    assert read(tmp_path / "b.pcd").viewpoint is None


@pytest.mark.parametrize(
    ("alpha", "field"),
    [(None, "rgb"), (np.array([0, 7, 255], np.uint8), "rgba"), (np.full(3, 255, np.uint8), "alpha rgb")],
)
def test_packed_colors(tmp_path, alpha, field):
    values = np.arange(9, dtype=np.uint8).reshape(3, 3) * 28
    colors = {name: values[i] for i, name in enumerate(("red", "green", "blue"))}
    cloud = Cloud(np.eye(3), colors if alpha is None else {**colors, "alpha": alpha})
    write(tmp_path / "a.pcd", cloud)
    assert f"FIELDS x y z {field}\n".encode() in (tmp_path / "a.pcd").read_bytes()
    assert_same(read(tmp_path / "a.pcd"), cloud)


@pytest.mark.parametrize("kind", ["F", "U"])
@pytest.mark.parametrize("data", ["binary", "binary_compressed", "ascii"])
def test_packed_colors_whose_float_is_nan(tmp_path, kind, data):
    # PCL sets alpha to 255, which makes a float of the four bytes a NaN.
    bits = 0xFF123456 if data != "ascii" else 0x00123456
    header = HEADER.replace("z\n", "z rgb\n").replace("4 4 4", "4 4 4 4").replace("F F F", f"F F F {kind}")
    header = header.replace("1 1 1\n", "1 1 1 1\n").replace("DATA ascii", f"DATA {data}")
    if data == "ascii":
        word = repr(struct.unpack("<f", struct.pack("<I", bits))[0]) if kind == "F" else str(bits)
        body = f"1 2 3 {word}\n4 5 6 {word}\n".encode()
    elif data == "binary":
        body = struct.pack("<fffIfffI", 1, 2, 3, bits, 4, 5, 6, bits)
    else:
        raw = struct.pack("<ffffffII", 1, 4, 2, 5, 3, 6, bits, bits)
        packed = lzf_literals(raw)
        body = struct.pack("<II", len(packed), len(raw)) + packed
    found = read_text(tmp_path, header.encode() + body)
    assert found.xyz.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert {name: values.tolist() for name, values in found.attributes.items()} == {
        "red": [0x12] * 2,
        "green": [0x34] * 2,
        "blue": [0x56] * 2,
    }


def test_counts_and_padding(tmp_path):
    header = HEADER.replace("x y z", "x _ y z f _").replace("SIZE 4 4 4", "SIZE 4 1 4 4 2 4")
    header = header.replace("F F F", "F U F F I F").replace("COUNT 1 1 1", "COUNT 1 3 1 1 2 1")
    dtype = np.dtype([("x", "<f4"), ("p", "u1", 3), ("y", "<f4"), ("z", "<f4"), ("f", "<i2", 2), ("q", "<f4")])
    table = np.zeros(2, dtype)
    table["x"], table["y"], table["z"], table["f"] = [1, 4], [2, 5], [3, 6], [[7, 8], [9, 10]]
    with_padding = b"".join(np.ascontiguousarray(table[name]).tobytes() for name in dtype.names or ())
    without = b"".join(np.ascontiguousarray(table[name]).tobytes() for name in "xyzf")
    text = b"1 0 0 0 2 3 7 8 0\n4 0 0 0 5 6 9 10 0\n"
    bodies = [("binary", table.tobytes()), ("ascii", text)]
    for raw in (with_padding, without):
        packed = lzf_literals(raw)
        bodies.append(("binary_compressed", struct.pack("<II", len(packed), len(raw)) + packed))
    for data, body in bodies:
        found = read_text(tmp_path, header.replace("ascii", data).encode() + body)
        assert found.xyz.tolist() == [[1, 2, 3], [4, 5, 6]]
        assert list(found.attributes) == ["f"]
        assert found.attributes["f"].tolist() == [[7, 8], [9, 10]]


@pytest.mark.parametrize("separator", [" ", ",", "\t", ", "])
def test_text_coordinates_keep_their_millimetres(tmp_path, separator):
    rows = "".join(
        separator.join(row) + "\n" for row in (("289814.151", "4320978.612", "170.763"), ("1", "nan", "inf"))
    )
    found = read_text(tmp_path, HEADER + rows)
    assert found.xyz[0].tolist() == [289814.151, 4320978.612, 170.763]
    assert np.isnan(found.xyz[1, 1])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("WIDTH 2", "WIDTH 3", "is not POINTS"),
        ("POINTS 2", "POINTS x", "POINTS is 'x'"),
        ("SIZE 4 4 4", "SIZE 4 4", "does not fit together"),
        ("SIZE 4 4 4", "SIZE 4 4 3", "SIZE 3"),
        ("TYPE F F F", "TYPE F F Q", "TYPE Q"),
        ("x y z", "x y y", "x, y and z are needed"),
        ("COUNT 1 1 1", "COUNT 1 1 2", "several values"),
        ("DATA ascii", "DATA zip", "DATA is 'zip'"),
        ("VIEWPOINT 0", "VIEWPOINT a", "seven finite numbers"),
        ("DATA ascii\n", "", "breaks off"),
        ("4 5 6\n", "", "declared 2 points, found 1"),
        ("4 5 6\n", "4 5 6\n7 8 9\n", "declared 2 points, found 3"),
        ("4 5 6\n", "4 five 6\n", r"line 13: expected 3 numbers.*'4 five 6'"),
        ("4 5 6\n", "4 5\n", "line 13: expected 3 numbers"),
        ("WIDTH 2\nHEIGHT 1\n", "WIDTH 1000000000000\nHEIGHT 1\n", "is not POINTS"),
    ],
)
def test_broken_files(tmp_path, old, new, message):
    text = HEADER + "1 2 3\n4 5 6\n"
    assert old in text
    with pytest.raises(FormatError, match=message):
        read_text(tmp_path, text.replace(old, new))


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_promise_of_a_trillion_points_is_not_believed(tmp_path, data):
    text = HEADER.replace("WIDTH 2", "WIDTH 1000000000000").replace("POINTS 2", "POINTS 1000000000000")
    with pytest.raises(FormatError, match="declared 1000000000000 points"):
        read_text(tmp_path, text.replace("DATA ascii", f"DATA {data}").encode() + b"\1\0\0\0" * 20)


def test_lzf_copies_and_damage():
    out = np.zeros(9, np.uint8)
    # "abc", then six bytes from three back: a copy that overlaps itself.
    packed = np.frombuffer(b"\x02abc\x80\x02", np.uint8)
    assert lzf_decompress(packed, out) == 9
    assert out.tobytes() == b"abcabcabc"
    for broken in (b"\x05ab", b"\x80", b"\x80\x02", b"\xe0\x01", b"\x02abc\xe0\xff\x00"):
        assert lzf_decompress(np.frombuffer(broken, np.uint8), out) == -1


@settings(max_examples=150)
@given(st.data())
def test_cut_or_damaged_anywhere(tmp_path_factory, shared_data, data):
    packed = shared_data / "malformed" / "pypcd4_pcd" / "binary_compressed_organized.pcd"
    file = tmp_path_factory.mktemp("pcd") / "a.pcd"
    if data.draw(st.booleans()):
        write(file, rich_cloud(4))
        raw = bytearray(file.read_bytes())
    else:
        raw = bytearray(packed.read_bytes())
    if data.draw(st.booleans()):
        raw = raw[: data.draw(st.integers(0, len(raw)))]
    else:
        raw[data.draw(st.integers(0, min(len(raw), 400) - 1))] = data.draw(st.integers(0, 255))
    file.write_bytes(bytes(raw))
    with suppress(FormatError):
        read(file)


def test_malformed_files(shared_data):
    folder = shared_data / "malformed" / "pypcd4_pcd"
    with pytest.raises(FormatError, match="empty"):
        read(folder / "ascii_empty.pcd")
    with pytest.raises(FormatError, match="breaks off at line 3"):
        read(folder / "ascii_invalid_header.pcd")
    assert len(read(folder / "ascii_with_empty_points.pcd")) == 0
    assert read(folder / "ascii_with_underscore.pcd").attributes == {}
    assert read(folder / "ascii_multi_count.pcd").attributes["intensity"].shape == (8, 4)
    assert read(folder / "ascii_organized.pcd").shape == (2, 4)
    packed, plain, text = (read(folder / f"{name}.pcd") for name in ("binary_compressed", "binary", "ascii"))
    np.testing.assert_array_equal(packed.xyz, plain.xyz)
    np.testing.assert_allclose(text.xyz, plain.xyz, rtol=1e-6)


def test_airborne_files(shared_data):
    folder = shared_data / "airborne" / "pdal_pcd"
    with pytest.raises(FormatError, match=r"seems to be a text of x y z columns: name it \.xyz"):
        read(folder / "missingheader.pcd")
    for name in ("comma", "space", "tab"):
        assert read(folder / f"utm17_{name}.pcd").xyz[0].tolist() == [289814.15, 4320978.61, 170.76]
    found = read(folder / "autzen-utm.pcd")
    assert found.attributes["Intensity"].dtype == np.uint16
    assert len(found.attributes) == 13


def test_kinect_files_round_trip(shared_data, tmp_path):
    for file in [*shared_data.glob("kinect_*/*.pcd")]:
        cloud = read(file)
        assert cloud.shape == (480, 640)
        write(tmp_path / "a.pcd", cloud)
        found = read(tmp_path / "a.pcd")
        assert_same(found, cloud)
        assert found.metadata == cloud.metadata


def test_pypcd4_reads_ours_and_we_read_its(tmp_path, shared_data):
    pypcd4 = pytest.importorskip("pypcd4")
    cloud = rich_cloud()
    write(tmp_path / "a.pcd", cloud)
    theirs = pypcd4.PointCloud.from_path(tmp_path / "a.pcd")
    np.testing.assert_array_equal(theirs.numpy(("x", "y", "z")), cloud.xyz)
    for code in ("u1", "i8", "f4", "f8"):
        np.testing.assert_array_equal(theirs.numpy((f"a_{code}",))[:, 0], cloud.attributes[f"a_{code}"])
    for encoding in (pypcd4.Encoding.ASCII, pypcd4.Encoding.BINARY, pypcd4.Encoding.BINARY_COMPRESSED):
        theirs.save(tmp_path / "b.pcd", encoding=encoding)
        found = read(tmp_path / "b.pcd")
        # Its text has ten digits, which makes packed colours 0.
        digits = 1e-9 if encoding == pypcd4.Encoding.ASCII else 0
        np.testing.assert_allclose(found.xyz, cloud.xyz, rtol=digits)
        colors = () if encoding == pypcd4.Encoding.ASCII else ("red", "green", "blue")
        for name in (*colors, "a_i2", "a_f8"):
            np.testing.assert_allclose(found.attributes[name], cloud.attributes[name], rtol=digits)
    for file in shared_data.glob("kinect_*/*.pcd"):
        table = pypcd4.PointCloud.from_path(file)
        np.testing.assert_array_equal(table.numpy(("x", "y", "z")), read(file).xyz.astype(np.float32))


@pytest.mark.parametrize(("mode", "data"), [("0", "ascii"), ("1", "binary"), ("2", "binary_compressed")])
def test_pcl_reads_ours_and_we_read_its(tmp_path, mode, data):
    tool = shutil.which("pcl_convert_pcd_ascii_binary")
    if tool is None:
        pytest.skip("PCL's tools are not installed (pcl-tools)")
    rng = np.random.default_rng(0)
    xyz = rng.integers(-1000, 1000, (12, 3)) / 8
    xyz[5] = np.nan
    attributes: dict[str, np.ndarray] = {}
    for name in ("red", "green", "blue"):
        attributes[name] = rng.integers(0, 256, 12).astype(np.uint8)
    attributes["label"] = rng.integers(0, 2**32, 12, dtype=np.uint32)
    cloud = Cloud(xyz, attributes, (3, 4), np.array([1.0, 2, 3]))
    write(tmp_path / "a.pcd", cloud)
    command = [tool, str(tmp_path / "a.pcd"), str(tmp_path / "b.pcd"), mode]
    subprocess.run(command, check=True, capture_output=True, timeout=60)
    assert f"DATA {data}\n".encode() in (tmp_path / "b.pcd").read_bytes()
    found = read(tmp_path / "b.pcd")
    assert_same(found, cloud)
    assert found.shape == (3, 4)
    assert found.viewpoint is not None
    assert found.viewpoint.tolist() == [1, 2, 3]


def test_the_filler_viewpoint_is_none_unless_organized(tmp_path):
    header = (
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {}\nHEIGHT {}\nVIEWPOINT {} 1 0 0 0\n"
    )
    body = "POINTS 4\nDATA ascii\n" + "1 2 3\n" * 4
    for size, viewpoint, expected in (
        ((4, 1), "0 0 0", None),
        ((2, 2), "0 0 0", [0, 0, 0]),
        ((4, 1), "0 1 0", [0, 1, 0]),
    ):
        path = tmp_path / "a.pcd"
        path.write_text(header.format(*size, viewpoint) + body)
        found = read(path).viewpoint
        assert (None if found is None else found.tolist()) == expected
