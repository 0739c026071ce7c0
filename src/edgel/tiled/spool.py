"""The spool: points of the input files, sorted by the blocks of a grid, so that any box of them can be read at once.

Each file is read once, whatever its format, and gives a folder of its own: coordinates and rows by block, and what its
header said. It appears whole or not at all.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from edgel._neighbors.orientation import has_normals, own_normals
from edgel.cloud import check_points
from edgel.io.chunks import read_chunks
from edgel.io.scans import organized_scans
from edgel.tiled.aside import made_aside
from edgel.tiled.box import Box

ROWS = 40  # bits of a key that tell the row in its file; those above tell the file
_PER_BLOCK = 512  # points of a block, about
BYTES_A_POINT = 32
_XYZ, _ROWS, _NORMALS = "xyz.f8", "rows.i8", "normals.f8"  # plain numbers, written stretch by stretch


@dataclass(frozen=True)
class Part:
    """What is known of a file in the spool.

    Attributes
    ----------
    number : int
        Among the files, in the order given.
    path : str
    sha256 : str
    num_rows, num_points, at_origin : int
        Rows of the file, those that are finite, and how many of these lie at 0 0 0.
    low, high : tuple of float
        Corners (3,) of the bounding box; of an empty file (0, 0, 0).
    crs : str or None
    side : float
        Of the blocks, a power of two.
    normals : bool
        Whether the file has normals of its own, any of which is not 0.
    num_scans : int
        Organized scans: such a file has no points in the spool, since each scan is seen from its own sensor.
    """

    number: int
    path: str
    sha256: str
    num_rows: int
    num_points: int
    at_origin: int
    low: tuple[float, ...]
    high: tuple[float, ...]
    crs: str | None
    side: float
    normals: bool
    num_scans: int


def spool(path: str, number: int, folder: Path) -> Part:
    """Sort the points of a file by blocks into a folder below `folder`; what is there already is taken as it is."""
    place = folder / f"{number:06d}"
    if not (place / "part.json").exists():
        with made_aside(place) as beside:
            beside.mkdir()
            (beside / "part.json").write_text(json.dumps(asdict(_sort(path, number, beside))))
    return load_part(place)


def load_part(place: Path) -> Part:
    """Read what is known of a file."""
    stored = json.loads((place / "part.json").read_text())
    return Part(**{**stored, "low": tuple(stored["low"]), "high": tuple(stored["high"])})


def _sort(path: str, number: int, place: Path) -> Part:
    """Sort each stretch of rows by blocks, one after the other: none but one has to fit into memory."""
    rows = points = at_origin = num_scans = 0
    low, high, side, crs, normals = np.full(3, np.inf), np.full(3, -np.inf), 0.0, None, False
    blocks, starts = [np.zeros((0, 2))], [np.zeros(0, np.int64)]
    with (
        open(place / _XYZ, "wb") as coordinates,
        open(place / _ROWS, "wb") as numbers,
        open(place / _NORMALS, "wb") as directions,
    ):
        for cloud in read_chunks(path):
            if num_scans := len(organized_scans(cloud)):
                rows = len(cloud)
                break
            checked = check_points(cloud, minimum=0)
            xyz = checked.xyz
            crs, own = cloud.crs, own_normals(cloud)
            normals |= own is not None
            if len(xyz):
                low, high = np.minimum(low, xyz.min(axis=0)), np.maximum(high, xyz.max(axis=0))
                side = side or _side_of(xyz)
                block = np.floor(xyz[:, :2] / side)
                order = np.lexsort((block[:, 1], block[:, 0]))
                block = block[order]
                first = np.flatnonzero(np.concatenate([[True], (np.diff(block, axis=0) != 0).any(axis=1)]))
                xyz[order].tofile(coordinates)
                if has_normals(cloud):
                    own = np.zeros(cloud.xyz.shape) if own is None else own
                    own[checked.rows[order]].tofile(directions)
                (rows + checked.rows[order]).tofile(numbers)
                blocks.append(block[first])
                starts.append(points + first)
                at_origin += int((xyz == 0).all(axis=1).sum())
            rows, points = rows + len(cloud), points + len(xyz)
    np.save(place / "blocks.npy", np.concatenate(blocks))
    np.save(place / "starts.npy", np.append(np.concatenate(starts), points))
    return Part(
        number=number,
        path=path,
        sha256=hash_of(path),
        num_rows=rows,
        num_points=points,
        at_origin=at_origin,
        low=tuple(low.tolist() if points else [0.0] * 3),
        high=tuple(high.tolist() if points else [0.0] * 3),
        crs=crs,
        side=side,
        normals=normals,
        num_scans=num_scans,
    )


def _side_of(xyz: np.ndarray) -> float:
    """Return a side of blocks, a power of two, for some points as dense as these (N, 3)."""
    extent = np.ptp(xyz[:, :2], axis=0)
    area = float(np.prod(extent)) or float(extent.max()) ** 2 or 1.0
    return float(2.0 ** np.round(np.log2(np.sqrt(area * _PER_BLOCK / len(xyz)))))


def hash_of(path: str) -> str:
    """Return the SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class Spool:
    """All files in the spool.

    Attributes
    ----------
    folder : Path
    parts : sequence of Part
    without_origin : bool
        Whether the points at 0 0 0 stand for shots without a return, and are left out.
    """

    folder: Path
    parts: Sequence[Part]
    without_origin: bool

    def blocks_of(self, part: Part) -> tuple[np.ndarray, np.ndarray]:
        """Return the blocks (B, 2) of a part, some more than once, and where the points of each begin (B + 1,)."""
        place = self.folder / f"{part.number:06d}"
        return np.load(place / "blocks.npy"), np.load(place / "starts.npy")

    def _touched(self, box: Box) -> list[Part]:
        """Return the parts that may have points in a box."""
        return [self.parts[i] for i in np.flatnonzero(box.touches(*self._corners) & self._filled).tolist()]

    @cached_property
    def _corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners (P, 2) in plan of all parts."""
        return np.array([part.low[:2] for part in self.parts]), np.array([part.high[:2] for part in self.parts])

    @cached_property
    def _filled(self) -> np.ndarray:
        """Whether each part (P,) has any points."""
        return np.array([part.num_points > 0 for part in self.parts])

    def load(self, box: Box) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (N, 3) in a box and their keys (N,) int64, file and row: ascending at one place."""
        xyz, key, _ = self._load(box, with_normals=False)
        return xyz, key

    def load_normals(self, box: Box) -> tuple[np.ndarray, np.ndarray]:
        """Return the keys (N,) of the points in a box and the normals (N, 3) that came with them, 0 where none did."""
        _, key, normals = self._load(box, with_normals=True)
        return key, normals

    def _load(self, box: Box, *, with_normals: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        points, keys, normals = [np.zeros((0, 3))], [np.zeros(0, np.int64)], [np.zeros((0, 3))]
        for part in self._touched(box):
            place = self.folder / f"{part.number:06d}"
            (blocks, starts), shape = self.blocks_of(part), (part.num_points, 3)
            xyz = np.memmap(place / _XYZ, np.float64, "r", shape=shape)
            rows = np.memmap(place / _ROWS, np.int64, "r")
            own = np.memmap(place / _NORMALS, np.float64, "r", shape=shape) if with_normals and part.normals else None
            inside = np.flatnonzero(box.touches(blocks * part.side, (blocks + 1) * part.side))
            # Blocks that follow one another are read at once.
            for run in np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1):
                if len(run):
                    stretch = slice(starts[run[0]], starts[run[-1] + 1])
                    points.append(np.array(xyz[stretch]))
                    keys.append((part.number << ROWS) + rows[stretch])
                    if with_normals:
                        normals.append(np.zeros((len(keys[-1]), 3)) if own is None else np.array(own[stretch]))
        joined, key = np.concatenate(points), np.concatenate(keys)
        del points, keys
        kept = box.holds(joined)
        if self.without_origin:
            kept &= (joined != 0).any(axis=1)
        return joined[kept], key[kept], np.concatenate(normals)[kept] if with_normals else normals[0]
