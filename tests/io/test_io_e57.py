import subprocess
import sys

import numpy as np
import pytest
from test_io_support import assert_same, rich_cloud

from edgel import Cloud
from edgel.io import FormatError, FormatWarning, read, write

pye57 = pytest.importorskip("pye57")

BROKEN = {"corrupt_crc"}
POINTS = {
    "bunnyDouble": 30571,
    "bunnyFloat": 30571,
    "cartesian_invalid_state_single": 1,
    "empty": 0,
    "empty_pc": 0,
    "float_intensity_without_min_max": 1,
    "integer_intensity": 2,
    "las2e57_no_images_tag": 153,
    "no_ext_namespace": 1,
    "original_guids": 1,
    "read_error": 2651,
    "scaled_integer_intensity": 2,
    "tinyCartesianFloatRgb": 2090,
    "tiny_pc_and_images": 2,
    "tiny_pc_with_extension": 1,
    "tiny_spherical": 180,
}


@pytest.fixture
def folder(shared_data):
    return shared_data / "malformed" / "e57_cry-inc"


def test_every_file_reads_or_says_why(folder):
    files = {file.stem: file for file in folder.glob("*.e57")}
    assert set(files) == {*BROKEN, *POINTS}
    for name in BROKEN:
        with pytest.raises(FormatError, match="checksum"):
            read(files[name])
    for name, count in POINTS.items():
        assert len(read(files[name])) == count


def test_values_of_files(folder):
    assert read(folder / "cartesian_invalid_state_single.e57").xyz.tolist() == [[-1, -2, -3]]
    assert read(folder / "cartesian_invalid_state_single.e57").metadata["e57_num_invalid"] == 2
    assert read(folder / "integer_intensity.e57").attributes["intensity"].tolist() == [-66, 66]
    np.testing.assert_allclose(read(folder / "scaled_integer_intensity.e57").attributes["intensity"], [-66.6, 66.6])
    assert read(folder / "no_ext_namespace.e57").attributes["classification"].tolist() == [42]
    assert read(folder / "tiny_pc_with_extension.e57").attributes["nor:normalX"].tolist() == [1]
    assert read(folder / "las2e57_no_images_tag.e57").attributes["blue"].max() > 255
    spherical = read(folder / "tiny_spherical.e57")
    np.testing.assert_allclose(np.linalg.norm(spherical.xyz, axis=1), 1)
    assert spherical.viewpoint is not None


@pytest.mark.parametrize("name", ["bunnyFloat", "tinyCartesianFloatRgb"])
def test_as_pye57_reads_them(folder, name):
    cloud = read(folder / f"{name}.e57")
    with pye57.E57(str(folder / f"{name}.e57")) as file:
        theirs = file.read_scan_raw(0)
    for i, axis in enumerate("XYZ"):
        np.testing.assert_array_equal(cloud.xyz[:, i], theirs[f"cartesian{axis}"])
    if "colorRed" in theirs:
        np.testing.assert_array_equal(cloud.attributes["red"], theirs["colorRed"])


def test_several_scans_with_poses(tmp_path):
    file = str(tmp_path / "a.e57")
    points = np.random.default_rng(0).normal(size=(5, 3))
    with pye57.E57(file, mode="w") as e57:
        for number in (1, 2):
            data: dict[str, np.ndarray] = {f"cartesian{axis}": points[:, i].copy() for i, axis in enumerate("XYZ")}
            if number == 2:
                data["intensity"] = np.linspace(0, 1, 5).astype(np.float32)
            # A quarter turn about z, then a shift.
            half = np.sqrt(0.5)
            e57.write_scan_raw(data, rotation=np.array([half, 0, 0, half]), translation=np.array([number, 0, 0]))
    cloud = read(file)
    turned = np.column_stack([-points[:, 1], points[:, 0], points[:, 2]])
    np.testing.assert_allclose(cloud.xyz, np.concatenate([turned + [1, 0, 0], turned + [2, 0, 0]]), atol=1e-6)
    assert cloud.attributes["scan_index"].tolist() == [0] * 5 + [1] * 5
    assert np.isnan(cloud.attributes["intensity"][:5]).all()
    assert cloud.viewpoint is None


@pytest.mark.parametrize("shape", [None, (6, 7)])
def test_round_trip(tmp_path, shape):
    rich = rich_cloud(holes=shape is not None)
    cloud = Cloud(rich.xyz, {**rich.attributes, "intensity": np.linspace(0, 1, 42)}, shape)
    write(tmp_path / "a.e57", cloud)
    found = read(tmp_path / "a.e57")
    assert_same(found, cloud, dtypes=False)
    assert found.shape == shape
    for code in ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"):
        assert found.attributes[f"a_{code}"].dtype == np.dtype(code)
    placed = Cloud(cloud.xyz, viewpoint=np.array([1.0, 2, 3]))
    write(tmp_path / "b.e57", placed)
    found = read(tmp_path / "b.e57")
    assert found.viewpoint is not None
    assert found.viewpoint.tolist() == [1, 2, 3]
    if shape is None:
        np.testing.assert_allclose(found.xyz, placed.xyz, rtol=1e-14)


def test_what_it_cannot_hold(tmp_path):
    with pytest.warns(FormatWarning, match=r"id: left out, uint64.*\.npz"):
        write(tmp_path / "a.e57", Cloud(np.eye(3), {"id": np.full(3, 2**63, np.uint64), "label": np.arange(3)}))
    assert list(read(tmp_path / "a.e57").attributes) == ["label"]


def test_without_pye57(tmp_path, monkeypatch, folder):
    monkeypatch.setitem(sys.modules, "pye57", None)
    with pytest.raises(FormatError, match=r"pip install 'edgel\[e57\]'"):
        read(folder / "empty.e57")
    with pytest.raises(FormatError, match=r"pip install 'edgel\[e57\]'"):
        write(tmp_path / "a.e57", Cloud(np.eye(3)))


def test_cut_or_damaged_anywhere(tmp_path):
    # In another process: a crash of the C++ library would be a failure here, not the end of the tests.
    write(tmp_path / "a.e57", Cloud(rich_cloud().xyz, {"label": np.arange(42)}))
    code = """
import random, sys
from edgel.io import FormatError, read
path = sys.argv[1]
raw = open(path, "rb").read()
random.seed(0)
for i in range(300):
    broken = bytearray(raw)
    if i % 2:
        broken = broken[: random.randrange(len(raw))]
    else:
        broken[random.randrange(len(raw))] = random.randrange(256)
    open(path, "wb").write(broken)
    try:
        read(path)
    except FormatError:
        pass
"""
    command = [sys.executable, "-W", "error::RuntimeWarning", "-c", code, str(tmp_path / "a.e57")]
    done = subprocess.run(command, capture_output=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr.decode()[-2000:]


def indexed(path, rows, cols, **more):
    """Write a scan of points with these indices."""
    data = {name: np.arange(len(rows)) + 1.0 for name in ("cartesianX", "cartesianY", "cartesianZ")}
    with pye57.E57(str(path), mode="w") as e57:
        e57.write_scan_raw({**data, "rowIndex": np.array(rows), "columnIndex": np.array(cols), **more})


def test_a_grid_with_gaps_stays_a_grid(tmp_path):
    file = tmp_path / "a.e57"
    indexed(file, [7, 5, 6, 5], [3, 4, 4, 3], intensity=np.arange(4.0) + 1)
    cloud = read(file)
    assert cloud.shape == (3, 2)
    np.testing.assert_array_equal(cloud.xyz[:, 0], [4, 2, np.nan, 3, 1, np.nan])
    np.testing.assert_array_equal(cloud.attributes["intensity"], [4, 2, np.nan, 3, 1, np.nan])


@pytest.mark.parametrize(
    ("rows", "cols"),
    [
        ([0, 0, 1, 1, 1], [0, 1, 0, 1, 1]),  # a cell twice
        ([0, 40, 1], [0, 40, 1]),  # nearly empty
        ([0, 0, 0], [0, 1, 2]),  # a line
        ([0, 30_000, 1], [0, 30_000, 1]),
    ],
)
def test_indices_that_form_no_grid_leave_a_list(tmp_path, rows, cols):
    indexed(tmp_path / "a.e57", rows, cols)
    cloud = read(tmp_path / "a.e57")
    assert cloud.shape is None
    assert cloud.attributes["rowIndex"].tolist() == rows


def test_the_case_of_one_missing_cell(shared_data):
    cloud = read(shared_data.parent / "cases" / "grid_with_gap.e57")
    assert cloud.shape == (6, 8)
    assert np.flatnonzero(np.isnan(cloud.xyz).any(axis=1)).tolist() == [19]
