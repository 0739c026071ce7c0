"""The store: points that were made of the spool's tile by tile, as it is read from: in any box, at once.

Each tile gives a folder of its own, with the points that it owns sorted by blocks. A point may be looked at elsewhere
than where it was measured; a block's bounds hold both, so that a box is read with all that lie in it either way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from edgel.tiled.aside import made_aside
from edgel.tiled.box import Box

_PER_BLOCK = 512  # points of a block, about
_XYZ, _SEEN, _KEYS = "xyz.f8", "seen.f8", "keys.i8"


@dataclass(frozen=True, eq=False)
class Stored:
    """Points as they are stored.

    Attributes
    ----------
    keys : (N,) int64
    xyz, seen : (N, 3) float64
        As measured, and where they are looked at.
    """

    keys: np.ndarray
    xyz: np.ndarray
    seen: np.ndarray

    def take(self, some: np.ndarray) -> Stored:
        """Return some of the points."""
        return Stored(self.keys[some], self.xyz[some], self.seen[some])


@dataclass(frozen=True)
class Store:
    """The points that all tiles have stored below a folder.

    Attributes
    ----------
    folder : Path
    num_tiles : int
    moved : bool
        Whether any point may be looked at elsewhere than where it was measured.
    """

    folder: Path
    num_tiles: int
    moved: bool

    def keep(self, tile: int, make: Callable[[], Stored]) -> None:
        """Store the points that a tile owns, unless they are there."""
        place = self._place(tile)
        if place.exists():
            return
        points = make()
        with made_aside(place) as beside:
            beside.mkdir()
            self._write(beside, points)

    def _write(self, place: Path, points: Stored) -> None:
        count = len(points.keys)
        extent = np.ptp(points.xyz[:, :2], axis=0) if count else np.zeros(2)
        side = float(np.sqrt(np.prod(extent) * _PER_BLOCK / max(count, 1))) or float(extent.max()) or 1.0
        block = np.floor(points.xyz[:, :2] / side)
        order = np.lexsort((block[:, 1], block[:, 0]))
        points, block = points.take(order), block[order]
        new = (np.diff(block, axis=0) != 0).any(axis=1)
        starts = np.flatnonzero(np.concatenate([[True], new])) if count else np.zeros(0, np.int64)
        both = np.concatenate([points.xyz, points.seen], axis=1)
        low, high = (
            extreme.reduceat(both, starts, axis=0) if count else np.zeros((0, 6))
            for extreme in (np.minimum, np.maximum)
        )
        np.save(place / "starts.npy", np.append(starts, count))
        np.save(place / "low.npy", np.minimum(low[:, :3], low[:, 3:]))
        np.save(place / "high.npy", np.maximum(high[:, :3], high[:, 3:]))
        points.keys.tofile(place / _KEYS)
        points.xyz.tofile(place / _XYZ)
        if self.moved:
            points.seen.tofile(place / _SEEN)

    def _place(self, tile: int) -> Path:
        return self.folder / f"{tile:06d}"

    def _read(self, tile: int, name: str) -> np.ndarray:
        found: np.ndarray = np.load(self._place(tile) / f"{name}.npy")
        return found

    @cached_property
    def counts(self) -> np.ndarray:
        """How many points each tile (T,) owns."""
        return np.array([self._read(tile, "starts")[-1] for tile in range(self.num_tiles)])

    @cached_property
    def _corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners (T, 3) of each tile's points, wherever they lie or are looked at; inside out where it has none."""
        low, high = np.full((self.num_tiles, 3), np.inf), np.full((self.num_tiles, 3), -np.inf)
        for tile in np.flatnonzero(self.counts).tolist():
            low[tile], high[tile] = self._read(tile, "low").min(axis=0), self._read(tile, "high").max(axis=0)
        return low, high

    @cached_property
    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners (3,) of all points, wherever they lie or are looked at."""
        low, high = self._corners
        return low.min(axis=0), high.max(axis=0)

    def touched(self, box: Box) -> list[int]:
        """Return the tiles that may own a point in a box."""
        low, high = self._corners
        return np.flatnonzero(box.touches(low[:, :2], high[:, :2]) & (self.counts > 0)).tolist()

    def stored(self, box: Box) -> Stored:
        """Return the points that lie in a box or are looked at there, by their keys, ascending at one place."""
        parts = [Stored(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))]
        for tile in self.touched(box):
            place, starts, shape = self._place(tile), self._read(tile, "starts"), (int(self.counts[tile]), 3)
            keys = np.memmap(place / _KEYS, np.int64, "r")
            xyz = np.memmap(place / _XYZ, np.float64, "r", shape=shape)
            seen = np.memmap(place / _SEEN, np.float64, "r", shape=shape) if self.moved else xyz
            inside = np.flatnonzero(box.touches(self._read(tile, "low")[:, :2], self._read(tile, "high")[:, :2]))
            # Blocks that follow one another are read at once.
            for run in np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1):
                if len(run):
                    stretch = slice(starts[run[0]], starts[run[-1] + 1])
                    points = Stored(np.array(keys[stretch]), np.array(xyz[stretch]), np.array(seen[stretch]))
                    parts.append(points.take(box.holds(points.xyz) | box.holds(points.seen)))
        columns = (np.concatenate([getattr(part, name) for part in parts]) for name in Stored.__dataclass_fields__)
        joined = Stored(*columns)
        return joined.take(np.argsort(joined.keys))

    def load(self, box: Box) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (N, 3) that lie in a box and their keys (N,) int64, as `edgel.tiled.spool.Spool` does."""
        points = self.stored(box)
        inside = box.holds(points.xyz)
        return points.xyz[inside], points.keys[inside]
