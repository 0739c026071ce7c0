"""The plan: which tiles a cloud is cut into, and what every task has to know. It is a file that all workers read."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from edgel._neighbors.normals import OUTWARD, OWN, SENSOR, UNKNOWN
from edgel.tiled.aside import made_aside
from edgel.tiled.box import Box
from edgel.tiled.spool import Part, Spool, load_part
from edgel.tiled.store import Store, Stored

_NO_RETURN = (1e-3, 10)  # share of the points, and number, that lie at 0 0 0 where that stands for no return


@dataclass(frozen=True)
class Options:
    """What was asked for: see `edgel.tiled.detect`."""

    kinds: int
    min_strength: float
    num_neighbors: int
    viewpoint: tuple[float, float, float] | None
    orient: str
    tile_points: int


@dataclass(frozen=True)
class Plan:
    """What every task has to know.

    Attributes
    ----------
    folder : Path
        Where the spool and the results of all tasks lie.
    options : Options
    tiles : sequence of Box
        The cores: each point lies in one of them.
    num_parts : int
        Files in the spool.
    cell : float
        Of a plan for the coarser look: side of the cells whose means are its points; 0 where they are those of files.
    """

    folder: Path
    options: Options
    tiles: Sequence[Box]
    num_parts: int
    cell: float = 0.0

    @cached_property
    def spool(self) -> Spool:
        """The points of the files."""
        parts = [load_part(self.folder / "spool" / f"{number:06d}") for number in range(self.num_parts)]
        return Spool(self.folder / "spool", parts, origin_left_out(parts))

    @cached_property
    def means(self) -> Store:
        """The means of cells, which are the points of a plan for the coarser look, and lie beside it."""
        return Store((self.folder.parent if self.cell else self.folder) / "means", len(self.tiles), moved=False)

    @cached_property
    def smoothed(self) -> Store:
        """The points where noise has them looked at."""
        return Store(self.folder / "smoothed", len(self.tiles), moved=True)

    @cached_property
    def points(self) -> Spool | Store:
        """The points."""
        return self.means if self.cell else self.spool

    def seen(self, box: Box, *, smoothed: bool) -> Stored:
        """Return the points that lie in a box or are looked at there; the latter is where they lie unless smoothed."""
        if smoothed:
            return self.smoothed.stored(box)
        xyz, keys = self.points.load(box)
        return Stored(keys, xyz, xyz)

    def seen_bounds(self, *, smoothed: bool) -> tuple[np.ndarray, np.ndarray]:
        """Corners (2,) in plan of all points, and of where they are looked at."""
        if not smoothed:
            return self.bounds
        low, high = self.smoothed.corners
        return low[:2], high[:2]

    @cached_property
    def num_points(self) -> int:
        """Finite points, without those that stand for no return."""
        if self.cell:
            return int(self.means.counts.sum())
        spool = self.spool
        return sum(part.num_points - (part.at_origin if spool.without_origin else 0) for part in spool.parts)

    @cached_property
    def orientation(self) -> str:
        """Who knows the outside: see `edgel.Edges.orientation`."""
        if self.options.orient == OUTWARD or self.options.viewpoint is not None:
            return OUTWARD if self.options.orient == OUTWARD else SENSOR
        return OWN if any(part.normals for part in self.spool.parts) else UNKNOWN

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners (2,) in plan of all points."""
        if self.cell:
            low, high = self.means.corners
            return low[:2], high[:2]
        return bounds_of(self.spool.parts)

    @cached_property
    def apart(self) -> float:
        """How far apart points would lie in plan if they lay evenly: where a halo begins to be tried."""
        low, high = self.bounds
        return float(np.sqrt(max(np.prod(high - low), 1e-300) / self.num_points)) or 1.0

    def result(self, step: str, tile: int) -> Path:
        """Return where the result of a step at a tile lies."""
        return self.folder / step / f"{tile:06d}.npz"

    def keep(self, step: str, tile: int, make: Callable[[], dict[str, Any]]) -> None:
        """Make the result of a step at a tile, unless it is there."""
        path = self.result(step, tile)
        if path.exists():
            return
        found = make()
        with made_aside(path) as beside, open(beside, "wb") as file:
            np.savez(file, **found)

    def load(self, step: str, tile: int) -> Any:
        """Open the result of a step at a tile."""
        return np.load(self.result(step, tile))

    def around(self, box: Box) -> list[int]:
        """Return the tiles that a box touches."""
        return np.flatnonzero(box.touches(*self._corners)).tolist()

    @cached_property
    def _corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners (T, 2) of all tiles."""
        return np.array([tile.low for tile in self.tiles]), np.array([tile.high for tile in self.tiles])

    def save(self) -> None:
        """Write the plan for the workers."""
        text = json.dumps(
            {
                "options": asdict(self.options),
                "tiles": [[*tile.low, *tile.high] for tile in self.tiles],
                "num_parts": self.num_parts,
                "cell": self.cell,
            }
        )
        self.folder.mkdir(exist_ok=True)
        with made_aside(self.folder / "plan.json") as beside:
            beside.write_text(text)

    @staticmethod
    def read(folder: Path) -> Plan:
        """Read the plan in a folder."""
        stored = json.loads((folder / "plan.json").read_text())
        viewpoint = stored["options"]["viewpoint"]
        options = Options(**{**stored["options"], "viewpoint": None if viewpoint is None else tuple(viewpoint)})
        tiles = [Box((a, b), (c, d)) for a, b, c, d in stored["tiles"]]
        return Plan(folder, options, tiles, stored["num_parts"], stored["cell"])


def origin_left_out(parts: Sequence[Part]) -> bool:
    """Whether points at 0 0 0 stand for no return, as in `edgel._range_image.no_return` for a list of points."""
    there, total = sum(part.at_origin for part in parts), sum(part.num_points for part in parts)
    return there >= max(_NO_RETURN[0] * total, _NO_RETURN[1]) and total - there >= 3


def bounds_of(parts: Sequence[Part]) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (2,) in plan of all points of some files."""
    some = [part for part in parts if part.num_points]
    return np.min([part.low[:2] for part in some], axis=0), np.max([part.high[:2] for part in some], axis=0)


def cut(spool: Spool, tile_points: int) -> list[Box]:
    """Cut the plan of a cloud into boxes with at most so many points each, by halving, along the sides of blocks."""
    side = max(part.side for part in spool.parts if part.num_points)
    blocks, counts = [], []
    for part in spool.parts:
        if part.num_points:
            own, starts = spool.blocks_of(part)
            blocks.append(np.floor(own * (part.side / side)))
            counts.append(np.diff(starts))
    where, which = np.unique(np.concatenate(blocks), axis=0, return_inverse=True)
    number = np.bincount(which, np.concatenate(counts))
    everything = Box((-np.inf, -np.inf), (np.inf, np.inf))
    return [Box(*sides) for sides in _halve(where, number, everything, side, tile_points)]


def _halve(where: np.ndarray, number: np.ndarray, box: Box, side: float, most: int) -> list[tuple[Any, Any]]:
    extent = np.ptp(where, axis=0)
    if number.sum() <= most or not extent.any():
        return [(box.low, box.high)]
    axis = int(extent[1] > extent[0])
    order = np.argsort(where[:, axis], kind="stable")
    line, ends = np.unique(where[order, axis], return_index=True)
    before = np.concatenate([[0], np.cumsum(number[order])])[ends[1:]]
    at = line[1:][np.argmin(np.abs(before - number.sum() / 2))]
    lower, sides = where[:, axis] < at, [list(box.low), list(box.high)]
    parts = []
    for kept, end in ((lower, 1), (~lower, 0)):
        corner = [list(s) for s in sides]
        corner[end][axis] = float(at * side)
        parts += _halve(where[kept], number[kept], Box(tuple(corner[0]), tuple(corner[1])), side, most)
    return parts
