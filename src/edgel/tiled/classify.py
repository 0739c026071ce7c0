"""Which points of a tile could be edge points, and how likely: exact, by as much halo as they ask for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._range_image import pixel_size, raster, viewer_axes
from edgel._surface import classify, screen
from edgel._surface.features import POINT
from edgel._surface.line import histogram
from edgel._surface.reach import settled
from edgel._surface.two_planes import FITS
from edgel.tiled.box import Box
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan

HALO = 64.0
"""Spacings around a tile, at first: most points hear of what lies within 60."""
SHOWN = [POINT.column(f"two_planes_{count}.{name}") for count, _ in FITS for name in ("turn", "foot_away")]
"""Columns of the evidence that say at which scale an edge shows: all that its place asks of it beside the fit."""
_GROUP = 256.0  # spacings: points not yet sure that lie within such a square get a window of their own


@dataclass(frozen=True, eq=False)
class Window:
    """The points in a box, and how deep in it they lie.

    Attributes
    ----------
    index : NeighborIndex
    keys : (N,) int64
        Of the points, ascending.
    depth : (N,) float64
        Of the places.
    core : (N,) bool
        Whether each place lies in the core.
    """

    index: NeighborIndex
    keys: np.ndarray
    depth: np.ndarray
    core: np.ndarray
    endless: bool


def open_window(plan: Plan, core: Box, halo: float, step: float) -> Window | None:
    """Read the points around a core; None if there are none in it."""
    box = core.grown(halo, step).without_end(*plan.bounds)
    xyz, keys = plan.spool.load(box)
    if not core.holds(xyz).any():
        return None
    index = build_index(xyz)
    places = np.ascontiguousarray(index.xyz.T)
    return Window(index, keys, box.depth(places), core.holds(places), box.endless)


def classify_tile(plan: Plan, whole: Whole, tile: int) -> None:
    """Classify the points in the core of a tile."""
    plan.keep("classify", tile, lambda: _classify(plan, whole, tile))


def _classify(plan: Plan, whole: Whole, tile: int) -> dict[str, np.ndarray]:
    halo, statistics = HALO * statistics_spacing(whole), whole.statistics
    todo, done, read, shown = [(plan.tiles[tile], halo, None)], [], 0, np.zeros(2, np.int64)
    while todo:
        core, halo, wanted = todo.pop()
        window = open_window(plan, core, halo, statistics.cell)
        if window is None:
            continue
        index = window.index
        read += len(index)
        screening = screen(index, statistics)
        found = classify(index, screening)
        own = window.core if wanted is None else np.isin(window.keys[index.order], wanted) & window.core
        sure = own if window.endless else settled(index, screening.leaves, window.depth, own)
        if wanted is None and whole.from_above:
            shown = _shown(window, pixel_size(statistics.spacing))
        mine = np.zeros(len(index), bool)
        mine[index.order[own & sure]] = True
        some = found.take(mine[found.points])
        done.append(
            {
                "key": window.keys[some.points],
                "xyz": index.at(index.places_of(some.points)),
                "crease": some.crease,
                "outline": some.outline,
                "fit": some.evidence.fit,
                "placed": some.evidence.placed,
                "shown": some.evidence.features[:, SHOWN],
            }
        )
        left = np.flatnonzero(own & ~sure)
        todo += _groups(index.at(left), window.keys[index.order[left]], halo, statistics_spacing(whole))
    parts = {name: np.concatenate([part[name] for part in done]) for name in done[0]} if done else _nothing()
    order = np.argsort(parts["key"])
    parts = {name: values[order] for name, values in parts.items()}
    counts = np.stack([histogram(parts["crease"]), histogram(parts["outline"])])
    return {**parts, "counts": counts, "from_above": shown, "read": np.array(read)}


def statistics_spacing(whole: Whole) -> float:
    """Return the spacing that halos are counted in."""
    return whole.statistics.spacing


def _nothing() -> dict[str, np.ndarray]:
    return {
        "key": np.zeros(0, np.int64),
        "xyz": np.zeros((0, 3)),
        "crease": np.zeros(0),
        "outline": np.zeros(0),
        "fit": np.zeros((0, 24), np.float32),
        "placed": np.zeros(0, bool),
        "shown": np.zeros((0, len(SHOWN)), np.float32),
    }


def _groups(xyz: np.ndarray, keys: np.ndarray, halo: float, spacing: float) -> list[tuple[Box, float, np.ndarray]]:
    """Put points (M, 3) that are not yet sure into windows of their own, with twice the halo."""
    if not len(xyz):
        return []
    square = np.floor(xyz[:, :2] / (_GROUP * spacing))
    _, which = np.unique(square, axis=0, return_inverse=True)
    groups = []
    for number in range(which.max() + 1):
        some = which == number
        low, high = xyz[some, :2].min(axis=0), np.nextafter(xyz[some, :2].max(axis=0), np.inf)
        groups.append((Box(tuple(low.tolist()), tuple(high.tolist())), 2 * halo, keys[some]))
    return groups


def _shown(window: Window, size: float) -> np.ndarray:
    """Count the points of the core, (2,): those in the layer that shows from above, and all."""
    xyz = window.index.xyz.T
    shows = raster(picture_of(xyz), -xyz[:, 2], size).shown
    return np.array([np.count_nonzero(shows & window.core), np.count_nonzero(window.core)])


def picture_of(xyz: np.ndarray) -> np.ndarray:
    """Return the places (N, 2) of points (N, 3) in the picture from above."""
    right, down, _ = viewer_axes(np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]))
    return xyz @ np.column_stack([right, down])
