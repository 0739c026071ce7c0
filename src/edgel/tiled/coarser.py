"""The coarser look in tiles: means of cells as a cloud of their own, and its edges carried back to the points.

As `edgel._surface.coarser` does where noise has the points smoothed. A cell's mean belongs to the tile that it lies in.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._faces import Faces
from edgel._kinds import LIKELY
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._surface.coarser import (
    APART,
    CELL,
    FAINT,
    PIECES,
    Carried,
    lie_apart,
    means_of_cells,
    pieces_of,
    strongest_at,
)
from edgel._surface.line import Strengths
from edgel._surface.plane_scales import SCALES
from edgel.edges import EdgeKind
from edgel.tiled.box import Box
from edgel.tiled.chains import Line
from edgel.tiled.classify import HALO, sides_from_above
from edgel.tiled.found import fits_of, outermost_around, strengths_of_tile
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan
from edgel.tiled.store import Stored

_CARRIED, _ASKED = "coarser", "coarser as asked"  # whose edges are carried, and describe what was, if others do
_MOST_CELLS = 2**63  # that keys tell apart


def cell_of(whole: Whole) -> float:
    """Return the side of the cells."""
    return CELL * whole.cloud_spacing


def plan_coarser(plan: Plan, whole: Whole) -> list[Plan]:
    """Plan the look at the means of all tiles: once, or once more where places and normals are asked for otherwise."""
    kinds = int(EdgeKind.CREASE | EdgeKind.BOUNDARY)
    options = replace(plan.options, kinds=kinds, min_strength=FAINT, num_neighbors=SCALES[1], viewpoint=None)
    asked = replace(
        options,
        num_neighbors=min(plan.options.num_neighbors, plan.num_points),
        viewpoint=plan.options.viewpoint,
    )
    wanted = [(_CARRIED, options), (_ASKED, asked)] if asked != options else [(_CARRIED, options)]
    plans = [Plan(plan.folder / name, each, plan.tiles, 0, cell_of(whole)) for name, each in wanted]
    for each in plans:
        each.save()
    return plans


def _cells(plan: Plan, size: float) -> tuple[np.ndarray, list[int]]:
    """Return the first cell (3,) that may hold a point, and how many there are along each axis."""
    low, high = (np.floor(corner / size) for corner in plan.smoothed.corners)
    return low, [int(number) for number in high - low + 1]


def check_cells(plan: Plan, size: float) -> None:
    """Raise a `ValueError` where points lie farther apart than cells can be numbered."""
    across, along, up = _cells(plan, size)[1]
    if across * along * up >= _MOST_CELLS:
        raise ValueError(
            f"points: the box around them all is {across} by {along} by {up} of the cells ({size:g}) by which noise "
            "is looked at, more than can be told apart; leave out points that lie far from all others"
        )


def mean_tile(plan: Plan, whole: Whole, tile: int) -> None:
    """Store the means of cells that lie in a tile."""
    plan.means.keep(tile, lambda: _means(plan, cell_of(whole), plan.tiles[tile]))


def _means(plan: Plan, size: float, core: Box) -> Stored:
    box = core.grown(2 * size, size)  # whole cells
    points = plan.seen(box, smoothed=True).seen
    points = points[box.holds(points)]
    if not len(points):
        return Stored(np.zeros(0, np.int64), points, points)
    means, cell = means_of_cells(points, size)
    own = core.holds(means)
    first, (_, along, up) = _cells(plan, size)
    x, y, z = (cell[own] - first).astype(np.int64).T
    return Stored((x * along + y) * up + z, means[own], means[own])  # ascending as the whole numbers them


def find_tile(plan: Plan, whole: Whole, line: Line, tile: int) -> None:
    """Find the edges of the coarser look in a tile."""
    plan.keep("edges", tile, lambda: _edges(plan, whole, line, tile))


def _edges(plan: Plan, whole: Whole, line: Line, tile: int) -> dict[str, np.ndarray]:
    found = strengths_of_tile(plan, line, tile)
    rows = np.flatnonzero(found.strongest >= FAINT)
    found, fits = found.take(rows), fits_of(plan, tile).take(rows)
    viewpoint = None if plan.options.viewpoint is None else np.array(plan.options.viewpoint)
    outermost = outermost_around(plan, whole, tile, fits.xyz)
    faces = fits.faces(found.kinds(FAINT), outermost, viewpoint)
    return {"key": found.points, "crease": found.crease, "outline": found.outline, **vars(faces)}


def mark_tile(plan: Plan, whole: Whole, tile: int) -> None:
    """Say which points are nearest to the edges that the coarser look shows in a tile."""
    plan.keep("mark", tile, lambda: _mark(plan, whole, tile))


def _mark(plan: Plan, whole: Whole, tile: int) -> dict[str, np.ndarray]:
    with Plan.read(plan.folder / _CARRIED).load("edges", tile) as stored:
        found = Strengths(stored["key"], stored["crease"], stored["outline"])
        faces = Faces(**{name: stored[name] for name in Faces.__dataclass_fields__})
    at = pieces_of(faces, cell_of(whole))
    nearest = _nearest(plan, at, HALO * whole.cloud_spacing / 4)
    carried = strongest_at(nearest.keys, found.take(np.repeat(np.arange(len(found.points)), PIECES)))
    _, first = np.unique(nearest.keys, return_index=True)
    nearest = nearest.take(first)
    outside = -plan.tiles[tile].depth(nearest.xyz).min(initial=0.0)
    return {**_columns(carried), "xyz": nearest.xyz, "seen": nearest.seen, "outside": np.array(outside)}


def _nearest(plan: Plan, at: np.ndarray, halo: float) -> Stored:
    """Return the points that are looked at nearest to some places (M, 3)."""
    found = Stored(np.zeros(len(at), np.int64), np.zeros((len(at), 3)), np.zeros((len(at), 3)))
    todo = np.arange(len(at))
    while len(todo):
        box = Box.around(at[todo]).grown(halo, halo).without_end(*plan.seen_bounds(smoothed=True))
        points = plan.seen(box, smoothed=True)
        if len(points.keys):
            near = knn(build_index(points.seen), at[todo], 1)
            sure = box.endless | (near.distances[:, 0] < box.depth(at[todo]))
            some = points.take(near.points[sure, 0])
            for name, values in vars(some).items():
                getattr(found, name)[todo[sure]] = values
            todo = todo[~sure]
        halo *= 2
    return found


def _columns(carried: Carried) -> dict[str, np.ndarray]:
    seen = carried.strengths
    return {"key": seen.points, "crease": seen.crease, "outline": seen.outline, "source": carried.sources}


def farthest_outside(plan: Plan) -> float:
    """Return how far outside the tile of an edge the points lie, at most, that it is carried to."""
    farthest = 0.0
    for tile in range(len(plan.tiles)):
        with plan.load("mark", tile) as found:
            farthest = max(farthest, float(found["outside"]))
    return farthest


def carry_tile(plan: Plan, whole: Whole, line: Line, outside: float, tile: int) -> None:
    """Keep what is carried to the points of a tile, where they and those around show nothing themselves."""
    plan.keep("carry", tile, lambda: _carry(plan, whole, line, outside, tile))


def _carry(plan: Plan, whole: Whole, line: Line, outside: float, tile: int) -> dict[str, np.ndarray]:
    core, columns = plan.tiles[tile], {}
    for other in plan.around(core.grown(outside * (1 + 1e-9), max(outside, 1e-300))):
        with plan.load("mark", other) as found:
            mine = core.holds(found["xyz"])
            for name in ("key", "crease", "outline", "source", "xyz", "seen"):
                columns.setdefault(name, []).append(found[name][mine])
            columns.setdefault("tile", []).append(np.full(np.count_nonzero(mine), other))
    joined = {name: np.concatenate(parts) for name, parts in columns.items()}
    of_sources = Strengths(joined["source"], joined["crease"], joined["outline"])
    carried = strongest_at(joined["key"], of_sources)
    # A point that several tiles mark is the same in all of them; a source lies in one.
    _, at = np.unique(joined["key"], return_index=True)
    sources, of_source = np.unique(joined["source"], return_index=True)
    seen = joined["seen"][at]
    kept = lie_apart(seen, _likely_around(plan, line, seen, APART * cell_of(whole)), cell_of(whole))
    tiles = joined["tile"][of_source[np.searchsorted(sources, carried.sources)]]
    xyz = joined["xyz"][at][kept]
    side = sides_from_above(plan, whole, core, carried.strengths.points[kept])
    return {**_columns(carried.take(kept)), "tile": tiles[kept], "xyz": xyz, "side": side}


def _likely_around(plan: Plan, line: Line, seen: np.ndarray, reach: float) -> np.ndarray:
    """Return where the likely edge points (L, 3) are looked at that lie within reach of some places (M, 3)."""
    found = [np.zeros((0, 3))]
    if len(seen):
        box = Box.around(seen).grown(reach * (1 + 1e-9), reach)
        for tile in plan.smoothed.touched(box):
            likely = strengths_of_tile(plan, line, tile).strongest >= LIKELY
            found.append(fits_of(plan, tile).seen[likely])
    return np.concatenate(found)


def faces_of(plan: Plan, sources: np.ndarray, tiles: np.ndarray) -> tuple[Faces, np.ndarray]:
    """Return the faces of the coarser edges that lie in some tiles (M,), and which row is that of each source (M,)."""
    folder = plan.folder / _ASKED
    asked = Plan.read(folder if folder.exists() else plan.folder / _CARRIED)
    keys, columns = [np.zeros(0, np.int64)], {name: [] for name in Faces.__dataclass_fields__}
    for tile in np.unique(tiles).tolist() or [0]:
        with asked.load("edges", tile) as found:
            keys.append(found["key"])
            for name, parts in columns.items():
                parts.append(found[name])
    key = np.concatenate(keys)
    order = np.argsort(key)
    joined = Faces(**{name: np.concatenate(parts) for name, parts in columns.items()})
    return joined, order[np.searchsorted(key, sources, sorter=order)] if len(key) else sources
