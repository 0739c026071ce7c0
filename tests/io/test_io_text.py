import time
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_io_support import assert_same, clouds, rich_cloud

from edgel import Cloud
from edgel.io import FormatError, read, write

SUFFIXES = [".xyz", ".txt", ".csv", ".asc", ".pts"]
POINTS = [[1.5, -2, 3], [4, 5.25, 1e-3]]


def read_text(tmp_path, text, suffix=".txt"):
    file = tmp_path / f"a{suffix}"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(file)


@settings(max_examples=60)
@given(clouds(), st.sampled_from([suffix for suffix in SUFFIXES if suffix != ".pts"]))
def test_round_trip(tmp_path_factory, cloud, suffix):
    file = tmp_path_factory.mktemp("text") / f"a{suffix}"
    write(file, cloud)
    assert_same(read(file), cloud, dtypes=False)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_of_a_rich_cloud(tmp_path, suffix):
    if suffix == ".pts":
        pytest.skip("PTS holds intensity and colors only")
    cloud = rich_cloud(holes=True)
    write(tmp_path / f"a{suffix}", cloud)
    found = read(tmp_path / f"a{suffix}")
    assert_same(found, cloud, dtypes=False)
    assert found.attributes["red"].dtype == np.uint8
    assert found.attributes["a_i4"].dtype == np.int64


@pytest.mark.parametrize(
    "text",
    [
        "1.5 -2 3\n4 5.25 1e-3\n",
        "1.5,-2,3\n4,5.25,1e-3",
        "1.5, -2, 3\r\n4, 5.25, 1e-3\r\n",
        "1.5;-2;3\n4;5.25;1e-3\n",
        "1.5\t-2\t3\n4\t5.25\t1e-3\n",
        "  1.5   -2  3  \n\n 4  5.25   1e-3\n\n",
        "1,5;-2;3\n4;5,25;1e-3\n",
        "1,5 -2,0 3,0\n4,0 5,25 1e-3\n",
        "x;y;z\n1,5;-2;3\n4;5,25;0,001\n",
        "# a remark of many words\n// another\n1.5 -2 3 # first\n4 5.25 1e-3\n",
        "//X Y Z\n1.5 -2 3\n4 5.25 1e-3\n",
        "X,Y,Z\n1.5,-2,3\n4,5.25,1e-3\n",
        '"x","y","z"\n1.5,-2,3\n4,5.25,1e-3\n',
        "2\n1.5 -2 3\n4 5.25 1e-3\n",
        "\ufeffx y z\n1.5 -2 3\n4 5.25 1e-3\n",
        "1.5 -2 3\n4 5.25 1e-3\n".encode("utf-16"),
        "z,x,y\n3,1.5,-2\n1e-3,4,5.25\n",
    ],
)
def test_separators_headers_and_comments(tmp_path, text):
    found = read_text(tmp_path, text)
    assert found.xyz.tolist() == POINTS
    assert found.attributes == {}


@pytest.mark.parametrize(
    ("row", "names"),
    [
        ("1 2 3 0.5", ["intensity"]),
        ("1 2 3 255 0 7", ["red", "green", "blue"]),
        ("1 2 3 -900 255 0 7", ["intensity", "red", "green", "blue"]),
        ("1 2 3 0.1 0.2 0.3", ["column_3", "column_4", "column_5"]),
        ("1 2 3 256 0 7", ["column_3", "column_4", "column_5"]),
        ("1 2 3 4 5", ["column_3", "column_4"]),
    ],
)
def test_names_without_header(tmp_path, row, names):
    found = read_text(tmp_path, f"{row}\n{row}\n")
    assert list(found.attributes) == names
    assert [values[0] for values in found.attributes.values()] == [float(word) for word in row.split()[3:]]


def test_header_names(tmp_path):
    found = read_text(tmp_path, "//X Y Z R G B label\n1 2 3 4 5 6 7\n")
    assert {name: (values.dtype.str, int(values[0])) for name, values in found.attributes.items()} == {
        "red": ("|u1", 4),
        "green": ("|u1", 5),
        "blue": ("|u1", 6),
        "label": ("<i8", 7),
    }


def test_integers_are_exact_and_may_become_floats_late(tmp_path):
    rows = "".join(f"0 0 0 {2**53 + 1} {2**64 - 1} 1\n" for _ in range(300)) + "0 0 0 1 1 1\n"
    found = read_text(tmp_path, f"x y z a b c\n{rows}")
    assert int(found.attributes["b"][0]) == 2**64 - 1
    assert int(found.attributes["a"][0]) == 2**53 + 1
    assert read_text(tmp_path, f"x y z a b c\n{rows}0 0 0 1 1 1.5\n").attributes["c"][-1] == 1.5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Dear Sir or Madam\nhere are the points\n", "line 1: expected numbers or a header.*'Dear Sir or Madam'"),
        ("hello\n", "line 1: .*'hello'"),
        ("1 2 3\n4 five 6\n", "line 2: expected 3 numbers, found '4 five 6'"),
        ("# x y z\n1 2 3\n\n4 5\n", "line 4: expected 3 numbers, found '4 5'"),
        ("x y z\n1 2 3\n4 5 6 7\n", "line 3: expected 3 numbers"),
        ("1 2\n3 4\n", "x, y and z are needed"),
        ("1\n2\n3\n", "expected|needed|declared"),
        ("A,B,C\n1,2,3\n", "the columns are A, B, C"),
        ("x y z\n1 2 3 4\n", "the header .* names 3 columns, line 2 has 4"),
        ("3\n1 2 3\n4 5 6\n", "declared 3 points in its first line, found 2"),
        ("# only\n# remarks\n", "no line of numbers"),
        (" \n", "no line of numbers"),
        ("ply\nformat ascii 1.0\n", r"name it \.ply"),
        (b"\x00\x01\x02\x03", "not a text of points"),
        (b"PK\x03\x04 123", "zip"),
        ("solid cube\nfacet normal 0 0 1\n", "line 1"),
    ],
)
def test_texts_of_something_else(tmp_path, text, message):
    with pytest.raises(FormatError, match=message) as caught:
        read_text(tmp_path, text)
    assert "a.txt" in str(caught.value)


def test_empty_clouds(tmp_path):
    for suffix in SUFFIXES[:-1]:
        write(tmp_path / f"a{suffix}", Cloud(np.empty((0, 3)), {"label": np.empty(0)}))
        found = read(tmp_path / f"a{suffix}")
        assert len(found) == 0
        assert list(found.attributes) == ["label"]


def test_numpy_reads_ours(tmp_path):
    cloud = Cloud(np.random.default_rng(0).normal(size=(50, 3)), {"f": np.linspace(0, 1, 50, dtype=np.float32)})
    write(tmp_path / "a.xyz", cloud)
    table = np.loadtxt(tmp_path / "a.xyz", skiprows=1)
    np.testing.assert_array_equal(table[:, :3], cloud.xyz)
    np.testing.assert_array_equal(table[:, 3], cloud.attributes["f"])
    np.savetxt(tmp_path / "b.csv", cloud.xyz, delimiter=",", header="x,y,z")
    np.testing.assert_array_equal(read(tmp_path / "b.csv").xyz, np.loadtxt(tmp_path / "b.csv", delimiter=","))


def test_roofs_as_numpy_reads_them(shared_data):
    files = list(shared_data.glob("roofs/*/points.xyz"))
    assert len(files) == 8
    for file in files:
        np.testing.assert_array_equal(read(file).xyz, np.loadtxt(file))


def test_speed(tmp_path):
    cloud = Cloud(np.random.default_rng(0).normal(size=(100_000, 3)))
    start = time.perf_counter()
    write(tmp_path / "a.xyz", cloud)
    found = read(tmp_path / "a.xyz")
    assert time.perf_counter() - start < 5  # about 0.5 s; a million lines take a few seconds each way
    np.testing.assert_array_equal(found.xyz, cloud.xyz)


@settings(max_examples=200)
@given(st.data())
def test_any_text(tmp_path_factory, data):
    words = st.sampled_from(
        ["1", "2.5", "-3e2", "nan", ",", ";", "\t", " ", " ", "\n", "\n", "#", "//", "x", "y z", "a", "é", "\0", "1,5"]
    )
    text = "".join(data.draw(st.lists(words, max_size=40)))
    file = tmp_path_factory.mktemp("text") / "a.txt"
    file.write_text(text)
    with suppress(FormatError):
        read(file)
