"""Which points of a tile could be edge points, and what their neighbours tell: exact, with the halo they ask for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import Queries, at_places, at_points
from edgel._neighbors.scan_lines import stretch_along_lines
from edgel._range_image import pixel_size, raster, sides_in
from edgel._surface import classify, screen
from edgel._surface.classify import Classification
from edgel._surface.curved_faces import EDGE
from edgel._surface.faces import fit_locally
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
_GROUP = 256.0  # spacings: points not yet sure that lie within such a square get a window of their own


@dataclass(frozen=True, eq=False)
class Window:
    """The points in a box around a core, and how deep in both they lie.

    Attributes
    ----------
    index, measured : NeighborIndex
        Where the points are looked at, and where they were measured: the same unless noise has them smoothed.
    keys : (N,) int64
        Of the points.
    box, core : Box
    depth : (N,) float64
        How deep in the box each place of `index` lies; negative outside.
    owned : (N,) bool
        Whether the core holds the point at each place of `index`, as measured.
    stretch : (3, N) float64 or None
        Of the places of `index`, where the cloud has scan lines.
    """

    index: NeighborIndex
    measured: NeighborIndex
    keys: np.ndarray
    box: Box
    core: Box
    depth: np.ndarray
    owned: np.ndarray
    stretch: np.ndarray | None

    @property
    def endless(self) -> bool:
        """Whether the box holds everything."""
        return self.box.endless

    @property
    def smoothed(self) -> bool:
        """Whether points are looked at elsewhere than where they were measured."""
        return self.index is not self.measured

    def within(self, index: NeighborIndex, queries: Queries, count: int) -> np.ndarray:
        """Whether so many nearest in an index of some places, asked for in their order, lie in the box."""
        if self.endless or len(index) < count:
            return np.full(len(queries), self.endless)
        xyz = np.empty((len(queries), 3))
        xyz[queries.targets] = queries.xyz[:3].T
        return knn(index, queries, count).distances[:, -1] < self.box.depth(xyz)


def open_window(plan: Plan, whole: Whole, core: Box, halo: float) -> Window | None:
    """Read the points around a core, as they were measured; None if there are none in it."""
    return _open(plan, whole, core, halo, smoothed=False, on_lines=whole.measured_on_lines)


def _open(plan: Plan, whole: Whole, core: Box, halo: float, *, smoothed: bool, on_lines: bool) -> Window | None:
    box = core.grown(halo, whole.statistics.cell).without_end(*plan.seen_bounds(smoothed=smoothed))
    points = plan.seen(box, smoothed=smoothed)
    owned = core.holds(points.xyz)
    if not owned.any():
        return None
    measured = build_index(points.xyz)
    index = build_index(points.seen) if smoothed else measured
    stretch = stretch_along_lines(index) if on_lines else None
    depth = box.depth(np.ascontiguousarray(index.xyz.T))
    return Window(index, measured, points.keys, box, core, depth, owned[index.order], stretch)


def classify_tile(plan: Plan, whole: Whole, tile: int) -> None:
    """Classify the points in the core of a tile, and keep what may be edge points wherever the line will be drawn."""
    plan.keep("classify", tile, lambda: _classify(plan, whole, tile))


def _classify(plan: Plan, whole: Whole, tile: int) -> dict[str, np.ndarray]:
    spacing = whole.statistics.spacing
    counts, shown, read, points, done = np.zeros((2, 1), np.int64), np.zeros(2, np.int64), 0, 0, []
    todo: list[tuple[Box, float, np.ndarray | None]] = [(plan.tiles[tile], HALO * spacing, None)]
    while todo:
        core, halo, wanted = todo.pop()
        window = _open(plan, whole, core, halo, smoothed=whole.smoothed, on_lines=whole.on_lines)
        if window is None:
            continue
        read += len(window.keys)
        own = window.owned if wanted is None else window.owned & np.isin(window.keys[window.index.order], wanted)
        found, left = _look(plan, whole, window, own, all_of_core=wanted is None)
        counts = counts + np.stack([histogram(found.crease), histogram(found.outline)])
        kept = found.take(np.maximum(found.crease, found.outline) >= least_probability(plan.options.min_strength))
        sides, seen = _sides(whole, window, kept.points)
        if wanted is None:
            shown, points = seen, int(np.count_nonzero(own))
        done.append(_fitted(plan, window, kept) | {"side": sides})
        points_left = window.index.order[left]
        xyz = window.measured.at(window.measured.places_of(points_left))
        todo += _groups(xyz, window.keys[points_left], halo, spacing)
    none = _empty(smoothed=whole.smoothed)
    parts = {name: np.concatenate([part[name] for part in done]) for name in none} if done else none
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
    # Points looked at elsewhere than where they were measured may be beside others that are not asked for.
    is_region = all_of_core and not window.smoothed
    inner = window.core.depth(np.ascontiguousarray(index.xyz.T)) if is_region else np.zeros(len(index))
    found = classify(index, screening, with_context_of(index, bounds, own, inner, window.stretch))
    sure = own
    if not window.endless:
        sure = settled(index, screening.leaves, bounds, window.depth, own, window.stretch)
        count = max(plan.options.num_neighbors, FITS[-1][0])
        if count > FITS[-1][0] or window.smoothed:  # farther than evidence asks, or of other points
            kept = np.maximum(found.crease, found.outline) >= least_probability(plan.options.min_strength)
            places = np.sort(index.places_of(found.points[kept]))
            places = places[sure[places]]
            sure = sure.copy()
            sure[places] = _fits_within(window, places, count)
    mine = np.zeros(len(index), bool)
    mine[index.order[sure]] = True
    return found.take(mine[found.points]), np.flatnonzero(own & ~sure)


def _fits_within(window: Window, places: np.ndarray, count: int) -> np.ndarray:
    """Whether the window holds so many nearest of the points at some places (M,), ascending, (M,) bool.

    Of all points as they were measured those nearest to where each is looked at, and to where it was measured.
    """
    index, measured = window.index, window.measured
    within = window.within(measured, at_places(index, places, stretch=window.stretch), count)
    if window.smoothed:
        points = index.order[places]
        stretch = None if window.stretch is None else window.stretch[:, index.places_of(measured.order)]
        within &= window.within(measured, at_points(measured, points, stretch), count)
    return within


def _fitted(plan: Plan, window: Window, kept: Classification) -> dict[str, np.ndarray]:
    """Fit what is local of some points, and name their nearest."""
    index, options, least = window.index, plan.options, least_probability(plan.options.min_strength)
    k = options.num_neighbors if plan.cell else min(options.num_neighbors, plan.num_points)
    viewpoint = None if options.viewpoint is None else np.array(options.viewpoint)
    creases, ends = kept.crease >= least, kept.outline >= least
    fits = fit_locally(window.measured, index, window.stretch, kept, kept.points, creases, ends, k, viewpoint)
    nearest = np.full((len(kept.points), NEAREST), -1)
    count, farthest = min(NEAREST, len(index)), np.zeros(len(kept.points))
    if len(kept.points):
        near = knn(index, at_points(index, kept.points), count).points
        nearest[:, :count], xyz = window.keys[near], window.measured.by_point()
        farthest = np.linalg.norm(xyz[near] - xyz[kept.points, None], axis=2).max(axis=1)
    own = {"key": window.keys[kept.points], "crease": kept.crease, "outline": kept.outline}
    return {**own, "nearest": nearest, "farthest": farthest, **vars(fits)}


def _empty(*, smoothed: bool) -> dict[str, np.ndarray]:
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
    shapes |= {"seen": (3,)} if smoothed else {}
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
        groups.append((Box.around(xyz[some]), 2 * halo, keys[some]))
    return groups


def _sides(whole: Whole, window: Window, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tell what the view from above shows beside some points (M,), and how many of the core's it shows, of all (2,)."""
    if not whole.from_above:
        return np.full(len(points), EdgeKind.BOUNDARY, np.uint8), np.zeros(2, np.int64)
    x, y, z = window.measured.xyz
    picture = raster(np.column_stack([x, -y]), -z, pixel_size(whole.statistics.spacing))
    core = window.core.holds(window.measured.xyz.T)
    shown = np.array([np.count_nonzero(picture.shown & core), np.count_nonzero(core)])
    return sides_in(picture, window.measured.places_of(points)), shown


def sides_from_above(plan: Plan, whole: Whole, core: Box, keys: np.ndarray) -> np.ndarray:
    """Tell what the view from above shows beside the points of a tile that have some keys (M,), ascending."""
    window = open_window(plan, whole, core, HALO * whole.statistics.spacing) if len(keys) else None
    if window is None:
        return np.zeros(0, np.uint8)
    order = np.argsort(window.keys)
    return _sides(whole, window, order[np.searchsorted(window.keys[order], keys)])[0]
