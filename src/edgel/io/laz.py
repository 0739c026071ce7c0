"""Packed points of LAZ, chunk by chunk: what the file promises is checked before lazrs allocates or panics over it."""

from __future__ import annotations

import struct
from typing import Any, BinaryIO

import laspy
import lazrs as _lazrs
import numpy as np

from edgel.io.errors import FormatError
from edgel.io.limits import check_unpacked
from edgel.io.quiet import quiet_decoder

lazrs: Any = _lazrs  # it has no types

_CHUNKED, _LAYERED = 2, 3
# Versions of items that go with a compressor.
_VERSIONS = {_CHUNKED: (1, 2), _LAYERED: (3, 4)}
_VARIABLE = 2**32 - 1
# Layers of each type of item in a layered chunk; extra bytes have one a byte.
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
_EXTRA_BYTES = 14
# Each extra byte takes 12 KiB of models in every chunk that is being unpacked.
_MOST_EXTRA_BYTES = 8192
# A flat, regular grid is packed 2000 times smaller than LAS: the bound of other formats would refuse it.
_MOST_RATIO = 1000


class CheckedLaz:
    """A backend for laspy, to read only; `path` is named in errors, `size` is the file's."""

    def __init__(self, path: str, size: int) -> None:
        self._path, self._size = path, size

    def is_available(self) -> bool:
        """Say that the library is there, which laspy asks."""
        return True

    def create_reader(self, source: BinaryIO, header: laspy.LasHeader, **_: Any) -> ChunkReader:
        """Return what laspy takes points from."""
        return ChunkReader(self._path, self._size, source, header)


class ChunkReader:
    """Unpacks whole chunks as points are asked for.

    Raises
    ------
    FormatError
        If the record of the compression, the chunk table or the layers of a chunk promise what the file cannot hold.
    """

    def __init__(self, path: str, size: int, source: BinaryIO, header: laspy.LasHeader) -> None:
        self.source = source
        self._path = path
        self._point_size = header.point_format.size
        self._record = bytes(header.vlrs[header.vlrs.index("LasZipVlr")].record_data)
        self._num_layers = _check_record(path, self._record, header.point_format)
        self._chunks = _read_chunk_table(path, size, source, header, self._record)
        check_unpacked(path, header.point_count * self._point_size, size, ratio=_MOST_RATIO)
        self._next = 0
        self._rest = bytearray()

    def read_n_points(self, num: int) -> bytearray:
        """Return the next `num` points, fewer at the end."""
        parts = [self._rest]
        missing = num - len(self._rest) // self._point_size
        first = self._next
        while missing > 0 and self._next < len(self._chunks):
            missing -= self._chunks[self._next][0]
            self._next += 1
        if self._next > first:
            parts.append(self._unpack(self._chunks[first : self._next]))
        points = parts[1] if len(parts) == 2 and not parts[0] else bytearray().join(parts)
        self._rest = points[num * self._point_size :]
        del points[num * self._point_size :]
        return points

    def close(self) -> None:
        """Close the file, as laspy wants it."""
        self.source.close()

    def _unpack(self, chunks: list[tuple[int, int]]) -> bytearray:
        packed = self.source.read(sum(size for _, size in chunks))
        position = 0
        for _, size in chunks:
            if self._num_layers:
                self._check_layers(packed[position : position + size])
            position += size
        points = bytearray(sum(count for count, _ in chunks) * self._point_size)
        with quiet_decoder():
            lazrs.decompress_points_with_chunk_table(
                packed, self._record, points, chunks, lazrs.DecompressionSelection(lazrs.SELECTIVE_DECOMPRESS_ALL)
            )
        return points

    def _check_layers(self, chunk: bytes) -> None:
        """Compare the promised layers with the chunk: a first point, the number of points, sizes, layers."""
        head = self._point_size + 4
        sizes = np.frombuffer(
            chunk, "<u4", min(self._num_layers, max(len(chunk) - head, 0) // 4), min(head, len(chunk))
        )
        if len(sizes) < self._num_layers or int(sizes.sum(dtype=np.uint64)) > len(chunk) - head - sizes.nbytes:
            raise FormatError(
                f"{self._path}: the layers of a chunk are larger than its {len(chunk)} bytes; the file is damaged: "
                "get it again"
            )


def _check_record(path: str, record: bytes, point_format: laspy.PointFormat) -> int:
    """Compare the record of the compression with the point format; return how many layers a chunk has.

    Raises
    ------
    FormatError
        If it is cut off, describes other points, or is of a kind that lazrs does not know.
    """
    num_items = int.from_bytes(record[32:34], "little")
    items = (
        list(struct.iter_unpack("<3H", record[34 : 34 + 6 * num_items])) if len(record) >= 34 + 6 * num_items else []
    )
    compressor = int.from_bytes(record[:2], "little")
    expected = bytes(lazrs.LazVlr.new_for_compression(point_format.id, point_format.num_extra_bytes).record_data())
    same = [item[:2] for item in items] == [item[:2] for item in struct.iter_unpack("<3H", expected[34:])]
    if not same or any(version not in _VERSIONS.get(compressor, ()) for _, _, version in items):
        raise FormatError(
            f"{path}: reading LAS failed (its compression is of an old or unknown kind, or damaged); get the file "
            "again or convert it with `las2las` or PDAL"
        )
    if point_format.num_extra_bytes > _MOST_EXTRA_BYTES:
        raise FormatError(
            f"{path}: {point_format.num_extra_bytes} extra bytes a point; {_MOST_EXTRA_BYTES} are unpacked at most: "
            "save it as .las"
        )
    if compressor != _LAYERED:
        return 0
    return sum(size if kind == _EXTRA_BYTES else _LAYERS[kind] for kind, size, _ in items)


def _read_chunk_table(
    path: str, size: int, source: BinaryIO, header: laspy.LasHeader, record: bytes
) -> list[tuple[int, int]]:
    """Read points and bytes of each chunk and leave the file at the first of them.

    Raises
    ------
    FormatError
        If the table is missing, or chunks are more, larger or smaller than the file and its header say.
    """
    start = header.offset_to_point_data
    source.seek(start)
    place = int.from_bytes(source.read(8), "little", signed=True)
    if place <= start:  # a writer that could not go back put it at the end of the file
        source.seek(max(size - 8, 0))
        place = int.from_bytes(source.read(8), "little", signed=True)
    room = place - start - 8
    if room < 0 or place + 8 > size:
        raise FormatError(f"{path}: reading LAS failed (its chunk table is missing); the file is cut off: get it again")
    source.seek(place + 4)
    num_chunks = int.from_bytes(source.read(4), "little")
    if num_chunks > room // header.point_format.size + 1:  # each begins with a whole point
        raise FormatError(
            f"{path}: reading LAS failed (declared {num_chunks} chunks in {room} bytes); get the file again"
        )
    source.seek(start)
    with quiet_decoder():
        table = lazrs.read_chunk_table(source, lazrs.LazVlr(record))
    source.seek(start + 8)
    if int.from_bytes(record[12:16], "little") != _VARIABLE and table:
        # Chunks of one size: only the last has fewer points, which the table does not know.
        before = sum(count for count, _ in table[:-1])
        table[-1] = (min(max(header.point_count - before, 0), table[-1][0]), table[-1][1])
    found, length = sum(count for count, _ in table), sum(length for _, length in table)
    if length > room or found < header.point_count:
        raise FormatError(
            f"{path}: reading LAS failed (declared {header.point_count} points, found chunks of {found} points and "
            f"{length} bytes, {room} bytes are there); get the file again"
        )
    for count, length in table:
        check_unpacked(path, count * header.point_format.size, length, ratio=_MOST_RATIO)
    return table
