"""COPC: packed points in the chunks of an octree, coarse ones first, so that viewers read what they show.

The records are those of https://copc.io: which chunk holds which cube, and how large the outermost one is.
"""

from __future__ import annotations

import struct
from typing import Any, BinaryIO

import laspy
import lazrs as _lazrs
import numpy as np
from laspy.vlrs.vlrlist import VLRList

from edgel.io.las_crs import crs_of

lazrs: Any = _lazrs  # it has no types

_FORMATS = {0: 6, 1: 6, 2: 7, 3: 7, 4: 6, 5: 7, 9: 6, 10: 8}
"""Point formats of COPC for those that it does not know."""
_RANK = 0.006  # degrees of a step of scan_angle; scan_angle_rank has whole degrees

_GRID = 128  # cells along an edge of a cube, of which each shows one point
_FULL = 20_000  # points that a cube takes as they are
_DEEPEST = 16  # level at which cubes take all that is left: points at one place cannot be parted
_INFO_AT = 375 + 54  # where the record begins that says where the hierarchy is
_EVLR_HEADER = 60


def as_copc(header: laspy.LasHeader, attributes: dict[str, np.ndarray], said: dict[str, str]) -> None:
    """Turn a header into one of version 1.4 with a point format of COPC, before extra dimensions are declared."""
    number = header.point_format.id
    wanted = laspy.PointFormat(_FORMATS.get(number, number))
    wanted.dimensions += list(header.point_format.extra_dimensions)
    header.set_version_and_point_format(laspy.header.Version(1, 4), wanted)
    header.global_encoding.wkt = True  # as these formats ask for, whether there is a CRS or not
    if number in _FORMATS and "scan_angle_rank" in attributes:
        attributes["scan_angle"] = np.rint(attributes.pop("scan_angle_rank") / _RANK).astype(np.int16)
    crs = crs_of(header)
    if crs is not None and "[" not in crs:
        said["crs"] = f"{crs} stays as GeoTIFF keys, where COPC asks for WKT; give Cloud.crs as WKT"


def write_nodes(file: BinaryIO, header: laspy.LasHeader, record: laspy.ScaleAwarePointRecord) -> None:
    """Write points as COPC: a chunk for each cube of an octree.

    Parameters
    ----------
    file : binary file
        Open for writing at its beginning.
    header : laspy.LasHeader
        As `as_copc` leaves it, with its extra dimensions.
    record : laspy.ScaleAwarePointRecord
    """
    xyz = np.column_stack([np.asarray(record[axis]) for axis in "xyz"])
    low, high = (xyz.min(axis=0), xyz.max(axis=0)) if len(xyz) else np.zeros((2, 3))
    # A little wider, so that the highest points lie inside; from the lowest corner on, where some readers expect it.
    half = max(float((high - low).max()) / 2 * (1 + 1e-9), float(np.max(header.scales)))
    center = low + half
    times = np.asarray(record["gps_time"]) if len(xyz) else np.zeros(1)
    info = [*center, half, 2 * half / _GRID, 0, 0, float(times.min()), float(times.max())]
    header.vlrs = VLRList([laspy.VLR("copc", 1, "COPC info", _packed(info)), *header.vlrs])
    backend: Any = _Backend()  # laspy asks for its own type, and needs two methods of it
    with laspy.LasWriter(file, header, do_compress=True, laz_backend=backend, closefd=False) as writer:
        packer: Any = writer.point_writer
        packer.compressor.reserve_offset_to_chunk_table()
        entries = []
        for key, rows in cubes(xyz, center, half):
            begin = file.tell()
            part: Any = record[rows]  # the same kind of record
            writer.write_points(part)
            packer.compressor.finish_current_chunk()
            entries.append(struct.pack("<4iQ2i", *key, begin, file.tell() - begin, len(rows)))
        hierarchy = laspy.VLR("copc", 1000, "EPT hierarchy", b"".join(entries))
        writer.write_evlrs(VLRList([hierarchy, *(header.evlrs or [])]))
        info[5:7] = writer.header.start_of_first_evlr + _EVLR_HEADER, 32 * len(entries)
    file.seek(_INFO_AT)
    file.write(_packed(info))


def _packed(info: list[Any]) -> bytes:
    return struct.pack("<5d2Q2d88x", *info)


class _Backend:
    """Makes laspy write chunks of any number of points."""

    def is_available(self) -> bool:
        return True

    def create_writer(self, dest: BinaryIO, header: laspy.LasHeader) -> Any:
        from laspy._compression.lazrsbackend import LazrsPointWriter

        writer = LazrsPointWriter(dest, header.point_format, parallel=False)
        form = header.point_format
        writer.vlr = lazrs.LazVlr.new_for_compression(form.id, form.num_extra_bytes, True)
        return writer


def cubes(xyz: np.ndarray, center: np.ndarray, half: float) -> list[tuple[tuple[int, int, int, int], np.ndarray]]:
    """Share points (N, 3) among the cubes of an octree: (level, x, y, z) and the rows (M,) of each, level by level.

    A cube with many points shows one of each cell of its grid, by chance, and leaves the others to its eighths.
    """
    left, found = np.random.default_rng(0).permutation(len(xyz)), []
    unit = np.clip((xyz - (center - half)) / (2 * half), 0.0, np.nextafter(1.0, 0.0))
    for level in range(_DEEPEST + 1):
        if not len(left):
            break
        cell = np.floor(unit[left] * (_GRID << level)).astype(np.int64)
        cube = cell // _GRID
        _, which, count = np.unique(_number(cube, 1 << level), return_inverse=True, return_counts=True)
        stays = np.zeros(len(left), bool)
        stays[np.unique(_number(cell, _GRID << level), return_index=True)[1]] = True
        stays |= (count[which] <= _FULL) | (level == _DEEPEST)
        rows, which = left[stays], which[stays]
        order = np.lexsort((rows, which))
        begins = np.flatnonzero(np.diff(which[order], prepend=-1))
        keys = cube[stays][order[begins]].tolist()
        found += [((level, *key), part) for key, part in zip(keys, np.split(rows[order], begins[1:]), strict=True)]
        left = left[~stays]
    return found


def _number(cells: np.ndarray, side: int) -> np.ndarray:
    """Return a number for each of the cells (N, 3) of a grid with so many along an edge."""
    return (cells[:, 0] * side + cells[:, 1]) * side + cells[:, 2]
