"""Which points of a tile could be edge points, and what their neighbours tell: exact, with the halo they ask for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import at_places, at_points
from edgel._neighbors.scan_lines import stretch_along_lines
from edgel._range_image import pixel_size, raster, sides_in
from edgel._surface import classify, screen
from edgel._surface.classify import Classification
from edgel._surface.curved_faces import EDGE
from edgel._surface.faces import LocalFits, fit_locally
from edgel._surface.line import NEAREST, histogram, least_probability
from edgel._surface.reach import Bounds, settled, with_context_of
from edgel._surface.rims import OUTWARD
from edgel._surface.two_planes import FITS
from edgel.edges import EdgeKind
from edgel.tiled.box import Box
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan

HALO = 64.0
"""Spacings around a tile, at first: most points hear of what lies within 60."""
FITS_KEPT = [name for name in LocalFits.__dataclass_fields__ if name != "seen"]  # nothing is smoothed in tiles
_GROUP = 256.0  # spacings: points not yet sure that lie within such a square get a window of their own


@dataclass(frozen=True, eq=False)
class Window:
    """The points in a box around a core, and how deep in both they lie.

    Attributes
    ----------
    index : NeighborIndex
    keys : (N,) int64
        Of the points.
    depth, core_depth : (N,) float64
        How deep in the box, and in the core, each place lies; negative outside.
    stretch : (3, N) float64 or None
        Of the places, where the cloud has scan lines.
    endless : bool
        Whether the box holds everything.
    """

    index: NeighborIndex
    keys: np.ndarray
    depth: np.ndarray
    core_depth: np.ndarray
    core: np.ndarray
    stretch: np.ndarray | None
    endless: bool


def open_window(plan: Plan, whole: Whole, core: Box, halo: float) -> Window | None:
    """Read the points around a core; None if there are none in it."""
    box = core.grown(halo, whole.statistics.cell).without_end(*plan.bounds)
    xyz, keys = plan.spool.load(box)
    if not core.holds(xyz).any():
        return None
    index = build_index(xyz)
    places = np.ascontiguousarray(index.xyz.T)
    stretch = stretch_along_lines(index) if whole.on_lines else None
    return Window(index, keys, box.depth(places), core.depth(places), core.holds(places), stretch, box.endless)


def classify_tile(plan: Plan, whole: Whole, tile: int) -> None:
    """Classify the points in the core of a tile, and keep what may be edge points wherever the line will be drawn."""
    plan.keep("classify", tile, lambda: _classify(plan, whole, tile))


def _classify(plan: Plan, whole: Whole, tile: int) -> dict[str, np.ndarray]:
    spacing = whole.statistics.spacing
    counts, shown, read, points, done = np.zeros((2, 1), np.int64), np.zeros(2, np.int64), 0, 0, []
    todo: list[tuple[Box, float, np.ndarray | None]] = [(plan.tiles[tile], HALO * spacing, None)]
    while todo:
        core, halo, wanted = todo.pop()
        window = open_window(plan, whole, core, halo)
        if window is None:
            continue
        read += len(window.keys)
        own = window.core if wanted is None else window.core & np.isin(window.keys[window.index.order], wanted)
        found, left = _look(plan, whole, window, own, all_of_core=wanted is None)
        counts = counts + np.stack([histogram(found.crease), histogram(found.outline)])
        kept = found.take(np.maximum(found.crease, found.outline) >= least_probability(plan.options.min_strength))
        sides, seen = _sides(whole, window, kept.points)
        if wanted is None:
            shown, points = seen, int(np.count_nonzero(own))
        done.append(_fitted(plan, window, kept) | {"side": sides})
        todo += _groups(window.index.at(left), window.keys[window.index.order[left]], halo, spacing)
    parts = {name: np.concatenate([part[name] for part in done]) for name in done[0]} if done else empty()
    order = np.argsort(parts["key"])
    parts = {name: values[order] for name, values in parts.items()}
    return {**parts, "counts": counts, "from_above": shown, "points": np.array(points), "read": np.array(read)}


def _look(
    plan: Plan, whole: Whole, window: Window, own: np.ndarray, *, all_of_core: bool
) -> tuple[Classification, np.ndarray]:
    """Classify the places of a window that are asked for; returns what is sure, and the places (L,) that are not."""
    index = window.index
    screening = screen(index, whole.statistics, stretch=window.stretch)
    bounds = Bounds.of(index, screening.leaves)
    inner = window.core_depth if all_of_core else np.zeros(len(index))
    found = classify(index, screening, with_context_of(index, bounds, own, inner, window.stretch))
    sure = own
    if not window.endless:
        sure = settled(index, screening.leaves, bounds, window.depth, own, window.stretch)
    if plan.options.num_neighbors > FITS[-1][0] and not window.endless:  # farther than evidence ever asks
        sure = sure.copy()
        sure[sure] = _within(window, np.flatnonzero(sure), plan.options.num_neighbors)
    mine = np.zeros(len(index), bool)
    mine[index.order[sure]] = True
    return found.take(mine[found.points]), np.flatnonzero(own & ~sure)


def _within(window: Window, places: np.ndarray, count: int) -> np.ndarray:
    """Whether so many nearest of some places (M,), ascending, lie within the window."""
    index = window.index
    if len(index) < count:
        return np.zeros(len(places), bool)
    return knn(index, at_places(index, places), count).distances[:, -1] < window.depth[places]


def _fitted(plan: Plan, window: Window, kept: Classification) -> dict[str, np.ndarray]:
    """Fit what is local of some points, and name their nearest."""
    index, options, least = window.index, plan.options, least_probability(plan.options.min_strength)
    k = min(options.num_neighbors, len(index))
    viewpoint = None if options.viewpoint is None else np.array(options.viewpoint)
    creases, ends = kept.crease >= least, kept.outline >= least
    fits = fit_locally(index, index, window.stretch, kept, kept.points, creases, ends, k, viewpoint)
    nearest = np.full((len(kept.points), NEAREST), -1)
    count, farthest = min(NEAREST, len(index)), np.zeros(len(kept.points))
    if len(kept.points):
        found = knn(index, at_points(index, kept.points), count)
        nearest[:, :count], farthest = window.keys[found.points], found.distances[:, -1]
    own = {"key": window.keys[kept.points], "crease": kept.crease, "outline": kept.outline}
    return {**own, "nearest": nearest, "farthest": farthest, **{name: getattr(fits, name) for name in FITS_KEPT}}


def empty() -> dict[str, np.ndarray]:
    """Return what is kept of a tile without points."""
    shapes = {
        "crease": (),
        "outline": (),
        "farthest": (),
        "side": (),
        "offset": (),
        "noise": (),
        "disc": (),
        "reach": (),
    }
    shapes |= {"xyz": (3,), "normals": (3,), "outward": (OUTWARD,), "refined": (EDGE,)}
    none = {name: np.zeros((0, *shape)) for name, shape in shapes.items()}
    return {**none, "key": np.zeros(0, np.int64), "nearest": np.zeros((0, NEAREST), np.int64)}


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


def _sides(whole: Whole, window: Window, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tell what the view from above shows beside some points (M,), and how many of the core's it shows, of all (2,)."""
    if not whole.from_above:
        return np.full(len(points), EdgeKind.BOUNDARY, np.uint8), np.zeros(2, np.int64)
    x, y, z = window.index.xyz
    picture = raster(np.column_stack([x, -y]), -z, pixel_size(whole.statistics.spacing))
    shown = np.array([np.count_nonzero(picture.shown & window.core), np.count_nonzero(window.core)])
    return sides_in(picture, window.index.places_of(points)), shown
