"""Files that promise more than they hold: a quick clear error, in little memory, with nothing on the screen."""

import io
import os
import struct
import subprocess
import sys
import time
import tracemalloc
import warnings
import zipfile
import zlib
from contextlib import suppress
from typing import Any

import laspy
import numpy as np
import pytest
from laspy.vlrs.vlrlist import VLRList
from PIL import Image

from edgel import Cloud
from edgel.io import FormatError, Intrinsics, read, read_intrinsics, write
from edgel.io.limits import whole_number

CAMERA = Intrinsics(fx=20, fy=20, cx=8, cy=6)
MOST_BYTES, MOST_SECONDS = 100 << 20, 5
CASES = ["png_bomb.png", "tiff_bomb.tif", "laz_chunk_table.laz", "laz_layer_sizes.laz", "count_5000_digits.pcd"]


def refused(file, match, content=None):
    """The file is refused with the message, quickly, in little memory, without warnings and prints."""
    if content is not None:
        file.write_bytes(content)
    options: dict[str, Any] = {"intrinsics": CAMERA} if file.suffix in (".png", ".tif") else {}
    tracemalloc.start()
    started = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(FormatError, match=match):
                read(file, **options)
        assert tracemalloc.get_traced_memory()[1] < MOST_BYTES
        assert time.process_time() - started < MOST_SECONDS
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", CASES)
def test_cases_are_refused_in_little_memory(shared_data, name):
    """In a process of its own, where memory is bounded and all that is printed is seen."""
    file = shared_data.parent / "cases" / name
    if not file.exists():
        pytest.skip(f"{file} is not there")
    code = (
        "import resource, sys, edgel.io, edgel.io.las\n"
        "from edgel.io import FormatError, Intrinsics, read\n"
        "from PIL import Image\n"
        "used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "camera = Intrinsics(fx=20, fy=20, cx=8, cy=6) if sys.argv[1].endswith(('png', 'tif')) else None\n"
        "try:\n    read(sys.argv[1], intrinsics=camera)\n"
        "except FormatError:\n    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(file)], capture_output=True, text=True, timeout=120)
    assert done.stderr == ""
    assert int(done.stdout) < 100 * 1024  # KiB


def png(width, height, rows, *, interlaced=0):
    """A PNG of 16 bits whose data holds `rows`."""
    data = zlib.compress(rows)
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, interlaced)),
        (b"IDAT", data),
        (b"IEND", b""),
    ]
    packed = [struct.pack(">I", len(c)) + k + c + struct.pack(">I", zlib.crc32(k + c)) for k, c in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


def test_png(tmp_path):
    row = b"\0" + b"\3\xe8" * 12
    (tmp_path / "a.png").write_bytes(png(12, 9, row * 9))
    assert (read(tmp_path / "a.png", intrinsics=CAMERA).xyz[:, 2] == 1.0).all()
    refused(tmp_path / "a.png", "12 x 1000 pixels need 25000 bytes, found 225", png(12, 1000, row * 9))
    refused(tmp_path / "a.png", "over 67108864 pixels", png(2**16, 2**16, row * 9))
    refused(tmp_path / "a.png", "8192 x 8193 pixels; 67108864", png(8192, 8193, row * 9))
    refused(tmp_path / "a.png", "8192 x 8192 pixels need 134225920 bytes, found 225", png(8192, 8192, row * 9))
    # Passes of 2 x 2, 1 x 2, 3 x 1, 3 x 3, 6 x 2, 6 x 5 and 12 x 4 pixels for 12 x 9.
    whole = b"".join((b"\0" + b"\3\xe8" * cols) * rows for cols, rows in
                     ((2, 2), (1, 2), (3, 1), (3, 3), (6, 2), (6, 5), (12, 4)))  # fmt: skip
    (tmp_path / "a.png").write_bytes(png(12, 9, whole, interlaced=1))
    assert (read(tmp_path / "a.png", intrinsics=CAMERA).xyz[:, 2] == 1.0).all()
    refused(tmp_path / "a.png", "12 x 9 pixels need", png(12, 9, whole[:-1], interlaced=1))


def test_a_large_depth_image_is_read(tmp_path):
    """2048 x 4096, blank but for a pixel: 1000 times smaller in the file."""
    depth = np.zeros((2048, 4096), np.uint16)
    depth[5, 8] = 1500
    for name in ("a.png", "a.tif"):
        Image.fromarray(depth).save(tmp_path / name, **({"compression": "tiff_deflate"} if name[-1] == "f" else {}))
        cloud = read(tmp_path / name, intrinsics=CAMERA)
        assert cloud.shape == (2048, 4096)
        np.testing.assert_allclose(cloud.xyz[5 * 4096 + 8], [0, -0.075, 1.5], rtol=1e-12)
        assert np.isfinite(cloud.xyz[:, 2]).sum() == 1


def tiff(tags, data=b""):
    """A little-endian TIFF of fields of 32 bits, the data behind them."""
    entries = b"".join(struct.pack("<HHII", tag, kind, count, value) for tag, kind, count, value in tags)
    return b"II*\0\x08\0\0\0" + struct.pack("<H", len(tags)) + entries + b"\0\0\0\0" + data


def test_tiff(tmp_path):
    basic = {256: 12, 257: 9, 258: 16, 259: 1, 262: 1, 273: 122, 278: 9, 279: 216}

    def with_tags(data=b"\xe8\x03" * 108, **changed):
        tags = basic | {int(tag[1:]): value for tag, value in changed.items()}
        return tiff([(tag, 4, 1, value) for tag, value in tags.items()], bytes(122 - 8 - 2 - 12 * len(tags) - 4) + data)

    (tmp_path / "a.tif").write_bytes(with_tags())
    assert (read(tmp_path / "a.tif", intrinsics=CAMERA).xyz[:, 2] == 1.0).all()
    refused(tmp_path / "a.tif", "need 132120792 bytes, found 216", with_tags(t257=5505033))
    refused(tmp_path / "a.tif", "pixels", with_tags(t257=2**31))
    refused(tmp_path / "a.tif", "need 24000000 bytes, found 216", with_tags(t257=1000000, t278=1000000, t259=8))
    # Many fields that share their bytes: gigabytes when all are read.
    fields = [(tag, 7, 200_000, 8) for tag in range(1000, 31000)]
    refused(tmp_path / "a.tif", "bytes of TIFF fields", tiff(fields))


def laz(tmp_path, *, version="1.4", point_format=6, num=40):
    header = laspy.LasHeader(version=version, point_format=point_format)
    las = laspy.LasData(header)
    las.xyz = np.random.default_rng(0).normal(size=(num, 3))
    las.write(str(tmp_path / "a.laz"))
    with laspy.open(tmp_path / "a.laz") as reader:
        return bytearray((tmp_path / "a.laz").read_bytes()), reader.header.offset_to_point_data


def test_laz(tmp_path):
    raw, start = laz(tmp_path)
    record = raw.find(b"laszip encoded") - 2 + 54
    table = int.from_bytes(raw[start : start + 8], "little")

    def changed(*edits):
        copy = bytearray(raw)
        for place, code, value in edits:
            struct.pack_into(code, copy, place, value)
        return bytes(copy)

    file = tmp_path / "b.laz"
    refused(file, "declared 2000000000 chunks", changed((table + 4, "<I", 2_000_000_000)))
    refused(file, "layers of a chunk are larger", changed((start + 8 + 34, "<I", 2_000_000_000)))
    refused(file, "chunk table is missing", changed((start, "<q", 2**62)))
    refused(file, r"declared 4000000000 points", changed((247, "<Q", 4_000_000_000)))
    # With chunks of four billion points, which one chunk cannot hold.
    refused(file, "promise to unpack to", changed((247, "<Q", 4_000_000_000), (record + 12, "<I", 4_000_000_001)))
    # A chunk size alone costs nothing: only the points that are there are unpacked.
    file.write_bytes(changed((record + 12, "<I", 4_000_000_001)))
    assert len(read(file)) == 40
    for place in range(record + 32, record + 40):  # items that are none: lazrs would panic
        refused(file, "compression is of an old or unknown kind", changed((place, "<B", 77)))
    refused(file, "declared records up to byte", changed((96, "<I", 2**32 - 1)))


def test_las_extended_records(tmp_path):
    header = laspy.LasHeader(version="1.4", point_format=6)
    las = laspy.LasData(header)
    las.xyz = np.eye(3)
    las.evlrs = VLRList([laspy.VLR("someone", 7, "a note", b"some bytes")])
    las.write(str(tmp_path / "a.las"))
    raw = bytearray((tmp_path / "a.las").read_bytes())
    place = int.from_bytes(raw[235:243], "little")
    for length in (11, 2**40, 2**64 - 1):
        struct.pack_into("<Q", raw, place + 20, length)
        refused(tmp_path / "b.las", "declared records up to byte", raw)


def test_a_flat_grid_in_laz_is_read(tmp_path):
    """What is packed most: 1900 times."""
    place = np.arange(3_000_000)
    write(tmp_path / "a.laz", Cloud(np.column_stack([place % 2000, place // 2000, place * 0]).astype(float)))
    assert os.path.getsize(tmp_path / "a.laz") < 60_000
    assert len(read(tmp_path / "a.laz")) == 3_000_000


def test_decoders_print_nothing(tmp_path, capfd):
    rng = np.random.default_rng(0)
    for version, point_format in (("1.2", 3), ("1.4", 7)):
        raw, start = laz(tmp_path, version=version, point_format=point_format)
        for _ in range(100):
            damaged = bytearray(raw)
            damaged[rng.integers(start + 8, len(raw))] = rng.integers(256)
            (tmp_path / "b.laz").write_bytes(damaged)
            with suppress(FormatError):
                read(tmp_path / "b.laz")
    file = io.BytesIO()
    Image.fromarray(rng.integers(0, 900, (12, 16)).astype(np.uint16)).save(file, "TIFF", compression="tiff_deflate")
    raw = bytearray(file.getvalue())
    raw[20] ^= 255
    refused(tmp_path / "b.tif", "damaged", raw)
    os.write(2, b"still here")
    assert capfd.readouterr() == ("", "still here")


DIGITS = "9" * 5000
PLY = "ply\nformat {} 1.0\n{}element vertex {}\nproperty float x\nproperty float y\nproperty float z\n{}end_header\n"
PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT {} 1 1\nWIDTH {}\nHEIGHT 1\nPOINTS {}\nDATA {}\n"


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.ply", PLY.format("ascii", "", DIGITS, "") + "1 2 3\n"),
        ("a.ply", PLY.format("ascii", "", "²", "") + "1 2 3\n"),
        ("a.ply", PLY.format("ascii", "element a 999999999999999999\n" * 30, 1, "") + "1 2 3\n"),
        ("a.ply", PLY.format("ascii", "", 1, "property list uchar int a\n") + f"1 2 3 {DIGITS}\n"),
        ("a.ply", PLY.format("ascii", "", 1, "property list uchar int a\n") + "1 2 3 ²\n"),
        ("a.ply", PLY.format("binary_little_endian", "", 10**18, "")),
        ("a.ply", "ply\n" + "comment " + "x" * (1 << 21)),
        ("a.pcd", PCD.format(1, DIGITS, DIGITS, "ascii")),
        ("a.pcd", PCD.format(DIGITS, 1, 1, "ascii")),
        ("a.pcd", PCD.format(1 << 20, 1, 1, "binary")),
        ("a.pcd", PCD.format(1, 10**9, 10**9, "binary")),
        ("a.pcd", "VERSION 0.7\n" * 200_000),
        ("a.pts", f"{DIGITS}\n1 2 3\n"),
        ("a.xyz", "1 2 3 " * 400_000),
        ("a.xyz", "1 " * 5000 + "\n"),
    ],
)
def test_numbers_and_lines_of_any_length(tmp_path, name, content):
    refused(tmp_path / name, "a\\.", content.encode())


def test_whole_numbers():
    assert whole_number("307200") == 307200
    assert [whole_number(word) for word in ("", "-1", "+1", "1.0", "²", "٣", "1_0", DIGITS)] == [None] * 8


def test_packed_pcd(tmp_path):
    head = PCD.format(1, 10**8, 10**8, "binary_compressed").encode()
    refused(tmp_path / "a.pcd", "promise to unpack", head + struct.pack("<II", 100, 12 * 10**8) + bytes(100))


def test_range_grid(tmp_path):
    """One vertex of many values, and a cell of one byte for each of the many places where it is not."""
    properties = "".join(f"property double a{i}\n" for i in range(1000))
    grid = "obj_info num_cols 1000\nobj_info num_rows 1000\n"
    text = PLY.format(
        "binary_little_endian", grid, 1, properties + "element range_grid 1000000\nproperty list uchar int v\n"
    )
    refused(tmp_path / "a.ply", "promise to unpack", text.encode() + bytes(12 + 8000 + 10**6))


def test_npy(tmp_path):
    for shape, code in (((10**9, 3), "<f8"), ((10**12,), "|S0"), ((1,) * 40, "<f8"), ((0, 2**70), "<f8")):
        head = repr({"descr": code, "fortran_order": False, "shape": shape}).ljust(117).encode() + b"\n"
        refused(tmp_path / "a.npy", r"declared|needed|damaged", b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head)


def test_npz(tmp_path):
    zeros = io.BytesIO()
    np.save(zeros, np.zeros((1 << 22, 3)))
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("points.npy", zeros.getvalue())
    refused(tmp_path / "a.npz", "promise to unpack to 100663424")
    small = io.BytesIO()
    np.save(small, np.eye(3))
    for packing in (zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2):
        with zipfile.ZipFile(tmp_path / "b.npz", "w", packing) as archive:
            archive.writestr("points.npy", small.getvalue())
        refused(tmp_path / "b.npz", "packed in a way that NumPy does not")
    np.savez(tmp_path / "c.npz", points=np.eye(3), shape=[np.inf, 3])
    refused(tmp_path / "c.npz", "infinity")


def test_intrinsics(tmp_path):
    for text in (f'{{"fx": {DIGITS}, "fy": 1, "cx": 1, "cy": 1}}', "[" * 100_000, " " * (1 << 21) + "{}"):
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(FormatError, match="intrinsics"):
            read_intrinsics(tmp_path / "a.json")


def e57_with(raw, old, new):
    """An E57 file with a part of its XML replaced, its checksums and lengths right again."""
    from fuzz_mutations import mend_e57

    start, length = (int.from_bytes(raw[at : at + 8], "little") for at in (24, 32))
    payload = b"".join(raw[at : at + 1020] for at in range(0, len(raw), 1024))
    place = start // 1024 * 1020 + start % 1024
    text = payload[place : place + length]
    assert old in text
    text = text.replace(old, new, 1)
    payload = payload[:place] + text
    payload += bytes(-len(payload) % 1020)
    payload = payload[:32] + struct.pack("<Q", len(text)) + payload[40:]
    return mend_e57(b"".join(payload[at : at + 1020] + bytes(4) for at in range(0, len(payload), 1020)))


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        (b"<e57Root", b"<!DOCTYPE a [<!ENTITY b 'c'>]><e57Root", "declares a document type"),
        (b"</e57Root>", b"<a type='Structure'>" * 100 + b"</a>" * 100 + b"</e57Root>", "64 levels"),
        (b"</e57Root>", b"<a/>" * 2001 + b"</e57Root>", "2000 in a structure"),
        (b'recordCount="', b'recordCount="99999999999', "declare"),
        (b'encoding="UTF-8"', b'encoding="IBM037"', "not UTF-8"),
        (b"</e57Root>", b"</e57Root", "XML section of the E57 file is damaged"),
    ],
)
def test_e57(tmp_path, old, new, match):
    pytest.importorskip("pye57")
    write(tmp_path / "a.e57", Cloud(np.random.default_rng(0).normal(size=(30, 3))))
    raw = (tmp_path / "a.e57").read_bytes()
    (tmp_path / "b.e57").write_bytes(e57_with(raw, b"</e57Root>", b"</e57Root>"))
    assert len(read(tmp_path / "b.e57")) == 30
    refused(tmp_path / "b.e57", match, e57_with(raw, old, new))


def test_e57_section_outside_of_the_file(tmp_path):
    pytest.importorskip("pye57")
    write(tmp_path / "a.e57", Cloud(np.eye(3)))
    raw = bytearray((tmp_path / "a.e57").read_bytes())
    for place in (24, 32, 40):
        changed = bytearray(raw)
        struct.pack_into("<Q", changed, place, 2**62)
        refused(tmp_path / "b.e57", "declared an XML section", changed)
