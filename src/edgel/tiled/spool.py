"""The spool: points of the input files, sorted by the blocks of a grid, so that any box of them can be read at once.

Each file is read once, whatever its format, and gives a folder of its own: coordinates and rows by block, and what its
header said. It appears whole or not at all.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from edgel._objects import NORMALS
from edgel.cloud import Cloud, check_points
from edgel.io import read
from edgel.tiled.box import Box

ROWS = 40  # bits of a key that tell the row in its file; those above tell the file
_PER_BLOCK = 512  # points of a block, about
BYTES_A_POINT = 32


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
        Whether the file has normals of its own.
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


def spool(path: str, number: int, folder: Path) -> Part:
    """Sort the points of a file by blocks into a folder below `folder`; what is there already is taken as it is."""
    place = folder / f"{number:06d}"
    if not (place / "part.json").exists():
        cloud = read(path)
        aside = place.with_name(f"{place.name}.{os.getpid()}.part")
        shutil.rmtree(aside, ignore_errors=True)
        aside.mkdir(parents=True)
        try:
            part = _sort(cloud, path, number, aside)
            (aside / "part.json").write_text(json.dumps(asdict(part)))
            shutil.rmtree(place, ignore_errors=True)
            aside.rename(place)
        except BaseException:  # a full disk: what is half written only takes its place
            shutil.rmtree(aside, ignore_errors=True)
            raise
    return load_part(place)


def load_part(place: Path) -> Part:
    """Read what is known of a file."""
    stored = json.loads((place / "part.json").read_text())
    return Part(**{**stored, "low": tuple(stored["low"]), "high": tuple(stored["high"])})


def _sort(cloud: Cloud, path: str, number: int, aside: Path) -> Part:
    if cloud.is_organized or "scan_index" in cloud.attributes:
        raise ValueError(
            f"{path}: an organized cloud or several scans, seen from a sensor, are no part of a larger cloud; run each "
            "by itself, without as-one"
        )
    checked = check_points(cloud, minimum=0)
    xyz, finite = checked.xyz, checked.rows
    low, high = (xyz.min(axis=0), xyz.max(axis=0)) if len(xyz) else (np.zeros(3), np.zeros(3))
    area = float(np.prod(high[:2] - low[:2])) or float((high - low)[:2].max()) ** 2 or 1.0
    side = 2.0 ** np.round(np.log2(np.sqrt(area * _PER_BLOCK / max(len(xyz), 1))))
    block = np.floor(xyz[:, :2] / side)
    order = np.lexsort((block[:, 1], block[:, 0]))
    block = block[order]
    first = np.flatnonzero(np.concatenate([[True], (np.diff(block, axis=0) != 0).any(axis=1)])) if len(xyz) else []
    np.save(aside / "xyz.npy", xyz[order])
    np.save(aside / "rows.npy", finite[order])
    np.save(aside / "blocks.npy", block[first].reshape(-1, 2))
    np.save(aside / "starts.npy", np.append(first, len(xyz)).astype(np.int64))
    names = {"_".join(name.split()).lower() for name in cloud.attributes}
    return Part(
        number=number,
        path=path,
        sha256=hash_of(path),
        num_rows=len(cloud),
        num_points=len(xyz),
        at_origin=int((xyz == 0).all(axis=1).sum()),
        low=tuple(low.tolist()),
        high=tuple(high.tolist()),
        crs=cloud.crs,
        side=float(side),
        normals={*NORMALS} <= names,
    )


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
        """Return the blocks (B, 2) of a part and where the points of each begin (B + 1,)."""
        place = self.folder / f"{part.number:06d}"
        return np.load(place / "blocks.npy"), np.load(place / "starts.npy")

    def load(self, box: Box) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (N, 3) in a box and their keys (N,) int64, file and row: ascending at one place."""
        points, keys = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
        for part in self.parts:
            if not part.num_points or not box.touches(part.low[:2], part.high[:2]):
                continue
            place = self.folder / f"{part.number:06d}"
            (blocks, starts), xyz = self.blocks_of(part), np.load(place / "xyz.npy", mmap_mode="r")
            rows = np.load(place / "rows.npy", mmap_mode="r")
            inside = np.flatnonzero(box.touches(blocks * part.side, (blocks + 1) * part.side))
            # Blocks that follow one another are read at once.
            for run in np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1):
                if len(run):
                    stretch = slice(starts[run[0]], starts[run[-1] + 1])
                    points.append(np.array(xyz[stretch]))
                    keys.append((part.number << ROWS) + rows[stretch])
        joined, key = np.concatenate(points), np.concatenate(keys)
        del points, keys
        kept = box.holds(joined)
        if self.without_origin:
            kept &= (joined != 0).any(axis=1)
        return joined[kept], key[kept]
