"""Valid files that the mutations start from: small ones by our own writers and by the libraries of the formats."""

import io
import json
import tempfile
from pathlib import Path

import laspy
import numpy as np
from laspy.vlrs.vlrlist import VLRList
from PIL import Image

from edgel import Cloud
from edgel.io import write

MOST_BYTES = 1 << 16
CAMERA = json.dumps(
    {"fx": 20.0, "fy": 20.0, "cx": 8, "cy": 6, "depth_scale": 0.001, "width": 16, "height": 12}
).encode()

PLY_LISTS = b"""ply
format ascii 1.0
comment made by hand
obj_info num_cols 2
obj_info num_rows 2
element camera 1
property float fov
element vertex 3
property float x
property float y
property float z
property list uchar int seen
element range_grid 4
property list uchar int vertex_indices
end_header
1.5
0 0 1 2 4 5
1 0 1 0
0 1 1 1 7
1 0
1 1
0
1 2
"""
PCD_ASCII = b"""# .PCD v0.7
VERSION 0.7
FIELDS x y z histogram _
SIZE 4 4 4 4 1
TYPE F F F F U
COUNT 1 1 1 3 2
WIDTH 2
HEIGHT 2
VIEWPOINT 0 0 0 1 0 0 0
POINTS 4
DATA ascii
0 0 1 1 2 3 0 0
1 0 1 1 2 3 0 0
0 1 1 1 2 3 0 0
nan 1 1 1 2 3 0 0
"""
TEXTS = {
    ".xyz": [b"0 0 1\n1 0 1\n0 1 1\n", b"# x y z intensity\n0.5 1e3 -2 7\n1 2 3 4\n", b"1 2 3 255 0 10\n2 3 4 1 2 3\n"],
    ".csv": [b"x,y,z,label\n0,0,1,5\n1,0,1,6\n", b"x;y;z\n1,5;2,5;3,5\n4,5;5,5;6,5\n", b'"x","y","z"\n1,2,3\n'],
    ".pts": [b"3\n0 0 1 5\n1 0 1 6\n0 1 1 7\n", b"2\n1 2 3 4 5 6 7\n1 2 3 4 5 6 7\n"],
    ".txt": ["// note\nX Y Z\n1 2 3\n4 5 6\n".encode("utf-16"), b"\xef\xbb\xbf1\t2\t3\n4\t5\t6\n"],
    ".ptx": [b"2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" + b"1 2 3 0.5\n" * 4],
}


def _cloud(num: int, shape: tuple[int, int] | None = None) -> Cloud:
    rng = np.random.default_rng(num)
    colors = {name: rng.integers(0, 256, num).astype(np.uint8) for name in ("red", "green", "blue")}
    attributes = {
        **colors,
        "intensity": rng.integers(0, 900, num).astype(np.uint16),
        "normal": rng.normal(size=(num, 3)),
    }
    return Cloud(rng.normal(size=(num, 3)).round(3), attributes, shape)


def _written(suffix: str, clouds: list[Cloud]) -> list[bytes]:
    contents = []
    with tempfile.TemporaryDirectory() as folder:
        for cloud in clouds:
            write(Path(folder, f"a{suffix}"), cloud)
            contents.append(Path(folder, f"a{suffix}").read_bytes())
    return contents


def _las(version: str, point_format: int, *, packed: bool, extended: bool = False) -> bytes:
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.add_extra_dim(laspy.ExtraBytesParams("height", "i4", "above ground", np.array([5.0]), np.array([0.01])))
    las = laspy.LasData(header)
    las.xyz = np.random.default_rng(point_format).normal(size=(40, 3)) * 10
    if extended:
        las.evlrs = VLRList([laspy.VLR("someone", 7, "a note", b"some bytes")])
    file = io.BytesIO()
    las.write(file, do_compress=packed)
    return file.getvalue()


def _lzf_pcd(num: int) -> bytes:
    """A binary_compressed PCD whose packing is all literal bytes."""
    columns = np.random.default_rng(0).normal(size=(3, num)).astype("<f4").tobytes()
    runs = [columns[at : at + 32] for at in range(0, len(columns), 32)]
    packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
    head = f"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {num}\nHEIGHT 1\nPOINTS {num}\n"
    sizes = np.array([len(packed), len(columns)], "<u4").tobytes()
    return head.encode() + b"DATA binary_compressed\n" + sizes + packed


def _images(suffix: str) -> list[bytes]:
    depth = np.random.default_rng(0).integers(0, 4000, (12, 16)).astype(np.uint16)
    contents = []
    kinds = [depth, depth.astype(np.int32), depth.astype(np.float32)] if suffix == ".tif" else [depth, depth // 16]
    for pixels in kinds:
        for packing in (None, "tiff_deflate", "tiff_lzw", "packbits") if suffix == ".tif" else (None,):
            file = io.BytesIO()
            Image.fromarray(pixels).save(file, "TIFF" if suffix == ".tif" else "PNG", compression=packing)
            contents.append(file.getvalue())
    return contents


def _arrays() -> tuple[list[bytes], list[bytes]]:
    cloud = _cloud(20, (4, 5))
    arrays = [np.zeros((4, 5, 3)), np.ones((6, 5), np.float32), np.ones((12, 20), np.uint16)]
    plain = _written(".npy", [_cloud(10), Cloud(np.eye(3))])
    for array in arrays:
        file = io.BytesIO()
        np.save(file, array)
        plain.append(file.getvalue())
    packed = io.BytesIO()
    np.savez_compressed(packed, points=np.zeros((4, 5, 3)), label=np.arange(20), note=np.arange(7), shape=[4, 5])
    return plain, [
        *_written(".npz", [cloud, Cloud(np.eye(3), viewpoint=np.ones(3), crs="EPSG:25832")]),
        packed.getvalue(),
    ]


def make_seeds(malformed: Path | None = None) -> dict[str, list[tuple[str, bytes]]]:
    """Return by reader pairs of suffix and content; `malformed` is a folder of more of them."""
    both = [_cloud(30), _cloud(20, (4, 5)), Cloud(np.empty((0, 3)))]
    plain, archives = _arrays()
    contents = {
        "ply": [(".ply", raw) for raw in [*_written(".ply", both), PLY_LISTS]],
        "pcd": [(".pcd", raw) for raw in [*_written(".pcd", both), PCD_ASCII, _lzf_pcd(50)]],
        "las": [(".las", _las(v, f, packed=False, extended=v == "1.4")) for v, f in (("1.2", 3), ("1.4", 7))],
        "laz": [(".laz", _las(v, f, packed=True, extended=f == 6)) for v, f in (("1.2", 3), ("1.4", 6), ("1.4", 8))],
        "npy": [(".npy", raw) for raw in plain],
        "npz": [(".npz", raw) for raw in archives],
        "text": [(suffix, raw) for suffix, raws in TEXTS.items() for raw in raws],
        "png": [(".png", raw) for raw in _images(".png")],
        "tiff": [(".tif", raw) for raw in _images(".tif")],
        "obj": [(".obj", b"v 0 0 1 1 0 0\nv 1 0 1 0 1 0\nv 0 1 1 0 0 1\nvn 0 0 1\nvn 0 0 1\nvn 0 1 0\nvt 0 0\n")],
        "bin": [(".bin", np.random.default_rng(0).random((20, columns), np.float32).tobytes()) for columns in (4, 20)],
        "yaml": [(".yaml", b"image_width: 640\nK: [20, 0, 8, 0, 20, 6, 0, 0, 1]\nD: [0.0, 0.0]\n")],
        "intrinsics": [(".json", CAMERA), (".json", b'{"camera_matrix": {"data": [20, 0, 8, 0, 20, 6, 0, 0, 1]}}')],
    }
    try:
        import pye57  # noqa: F401  # pyright: ignore[reportMissingImports]
    except ImportError:
        pass
    else:
        contents["e57"] = [(".e57", raw) for raw in _written(".e57", both[:2])]
    for file in sorted(malformed.rglob("*")) if malformed else []:
        if file.suffix[1:] in contents and 0 < file.stat().st_size <= MOST_BYTES:
            contents[file.suffix[1:]].append((file.suffix, file.read_bytes()))
    return contents
