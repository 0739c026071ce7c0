import os
import stat
from contextlib import suppress

import numpy as np
import pytest
from test_io_support import assert_same, rich_cloud

from edgel import Cloud
from edgel.io import READERS, WRITERS, FormatError, FormatWarning, read, write
from edgel.io.files import describe, replacing

HELD = [suffix for suffix in WRITERS if suffix != ".e57"]


def test_missing_files_and_folders(tmp_path):
    for suffix in READERS:
        with pytest.raises(FileNotFoundError, match="no such file"):
            read(tmp_path / f"a{suffix}")
        folder = tmp_path / f"folder{suffix}"
        folder.mkdir()
        with pytest.raises(IsADirectoryError, match="is a folder"):
            read(folder)
    for suffix in HELD:
        with pytest.raises(IsADirectoryError, match="is a folder"):
            write(tmp_path / f"folder{suffix}", Cloud(np.eye(3)))
        with pytest.raises(OSError, match="the folder does not exist"):
            write(tmp_path / "missing" / f"a{suffix}", Cloud(np.eye(3)))


@pytest.mark.parametrize(
    "content",
    [b"", b"hello world, this is\nno point cloud\n", b"\x00\x01\x02\x03" * 50, b"\x89PNG\r\n\x1a\n" + b"\0" * 40],
)
@pytest.mark.parametrize("suffix", READERS)
def test_content_of_another_kind(tmp_path, suffix, content):
    file = tmp_path / f"a{suffix}"
    file.write_bytes(content)
    with pytest.raises(FormatError) as caught:
        read(file)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("suffix", HELD)
@pytest.mark.parametrize("other", HELD)
def test_renamed_files_say_what_they_are(tmp_path, suffix, other):
    texts = (".xyz", ".txt", ".csv", ".asc", ".pts")
    if other == suffix or {other, suffix} == {".las", ".laz"} or (other in texts and suffix in texts):
        return
    write(tmp_path / f"a{other}", Cloud(np.random.default_rng(0).normal(size=(30, 3))))
    os.rename(tmp_path / f"a{other}", tmp_path / f"a{suffix}")
    with pytest.raises(FormatError, match="seems to be"):
        read(tmp_path / f"a{suffix}")


@pytest.mark.parametrize(
    ("suffix", "message"),
    [
        (".stl", "a mesh"),
        (".off", "--sample-mesh"),
        (".glb", "save it as"),
        (".STEP", "CAD model"),
        (".foo", r"known: \.ply"),
        ("", "unknown"),
    ],
)
def test_unknown_extensions(tmp_path, suffix, message):
    (tmp_path / f"a{suffix}").write_bytes(b"1 2 3\n")
    with pytest.raises(FormatError, match=message):
        read(tmp_path / f"a{suffix}")
    with pytest.raises(FormatError, match=message):
        write(tmp_path / f"a{suffix}", Cloud(np.eye(3)))


@pytest.mark.parametrize("suffix", HELD)
def test_upper_case_extensions_and_output_over_the_input(tmp_path, suffix):
    file = tmp_path / f"a{suffix.upper()}"
    cloud = rich_cloud()
    if suffix == ".pts":  # which has no place for the rest
        cloud = Cloud(cloud.xyz, {name: cloud.attributes[name] for name in ("red", "green", "blue")})
    write(file, cloud)
    first = read(file)
    write(file, first)
    found = read(file)
    assert_same(found, first)
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("suffix", HELD)
def test_a_failed_write_leaves_the_old_file(tmp_path, suffix):
    file = tmp_path / f"a{suffix}"
    file.write_bytes(b"old")
    with pytest.raises(FormatWarning):  # warnings are errors here, and come before anything is written
        write(file, Cloud(np.eye(3), {"x": np.array(["a", "b", "c"], dtype=object)}))
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_replacing(tmp_path):
    file = tmp_path / "a.txt"
    with suppress(KeyboardInterrupt), replacing(file) as out:
        out.write(b"half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []
    old = os.umask(0o027)
    try:
        with replacing(file) as out:
            out.write(b"whole")
    finally:
        os.umask(old)
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    link = tmp_path / "link.txt"
    link.symlink_to(file)
    with replacing(link) as out:
        out.write(b"new")
    assert link.is_symlink()
    assert file.read_bytes() == b"new"
    with replacing("/dev/null") as out:
        out.write(b"gone")
    (tmp_path / "plain").write_bytes(b"")
    with pytest.raises(OSError, match="cannot be written"), replacing(tmp_path / "plain" / "a.txt"):
        pass


def test_wrong_arguments(tmp_path):
    with pytest.raises(TypeError, match="expected a Cloud"):
        write(tmp_path / "a.ply", np.eye(3))  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match="expected a path"):
        read(3)  # pyright: ignore[reportArgumentType]
    with open(__file__) as file, pytest.raises(TypeError, match="text file"):
        read(file)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("head", "what"),
    [
        (b"1.5 2 -3e4\n", "a text of x y z columns"),
        (b"1,2,3", "a text of x y z columns"),
        (b"hello", "a text that begins with 'hello'"),
        (b"\x00\x01", "an unknown binary format"),
        (b"version https://git-lfs.github.com/spec/v1", "a Git LFS pointer"),
        (b"<!DOCTYPE html>", "a web page"),
    ],
)
def test_describe(head, what):
    assert describe(head)[0].startswith(what)


def test_every_shared_cloud_reads(shared_data):
    count = 0
    for file in shared_data.rglob("*"):
        if file.suffix.lower() in READERS and "malformed" not in file.parts and file.name != "missingheader.pcd":
            if file.name == "published.csv" or file.name.startswith(("LICENSE", "README")):
                continue
            if file.suffix == ".obj":
                with pytest.raises(FormatError, match=r"a mesh of .* faces"):
                    read(file)
                continue
            if file.suffix == ".mcap":  # of ROS 1, which rosbags does not read
                continue
            count += len(read(file)) > 0
    assert count > 40


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz", ".pts"])
def test_open3d_reads_ours_and_we_read_its(tmp_path, suffix):
    o3d = pytest.importorskip("open3d")
    rng = np.random.default_rng(0)
    xyz = rng.normal(size=(100, 3)).astype(np.float32).astype(float)
    colors = {name: rng.integers(0, 256, 100).astype(np.uint8) for name in ("red", "green", "blue")}
    cloud = Cloud(xyz, colors if suffix in (".ply", ".pcd") else {})
    file = str(tmp_path / f"a{suffix}")
    write(file, cloud)
    if suffix != ".xyz":  # Open3D takes a header line of .xyz for a damaged point
        theirs = o3d.io.read_point_cloud(file)
        np.testing.assert_array_equal(np.asarray(theirs.points), xyz)
        if colors and suffix in (".ply", ".pcd"):
            np.testing.assert_array_equal(
                np.rint(np.asarray(theirs.colors) * 255), np.column_stack(list(colors.values()))
            )
    theirs = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz))
    theirs.colors = o3d.utility.Vector3dVector(np.column_stack(list(colors.values())) / 255)
    for text in (True, False):
        for packed in (True, False):
            assert o3d.io.write_point_cloud(file, theirs, write_ascii=text, compressed=packed)
            found = read(file)
            np.testing.assert_allclose(found.xyz, xyz, atol=1e-5 if text else 0)
            if suffix in (".ply", ".pcd"):
                for name, values in colors.items():
                    np.testing.assert_array_equal(found.attributes[name], values)
