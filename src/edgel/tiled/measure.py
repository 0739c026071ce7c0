"""What the whole cloud says: measured at sampled points in each tile, and merged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index, chosen
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import at_places
from edgel._neighbors.scan_lines import AREA, are_lines, on_lines, stretch_along_lines, stretch_reach
from edgel._neighbors.scan_lines import SAMPLE as LINES_SAMPLE
from edgel._neighbors.spacing import disc_radii, rounded_spacing
from edgel._range_image import FEW, direction_that_explains
from edgel._surface.plane_scales import NUM_FEATURES, SCALES
from edgel._surface.smoothing import SAMPLE as NOISE_SAMPLE
from edgel._surface.smoothing import noise_at, noise_of, share_of
from edgel._surface.statistics import SAMPLE, Statistics, describe_places, statistics_of
from edgel.tiled.plan import Plan

_SIDE = 8.0  # spacings, at first, of the cells around a sampled point that are looked at
_NUMBERS = (SAMPLE, NOISE_SAMPLE, LINES_SAMPLE, FEW)


def measure(plan: Plan, tile: int) -> None:
    """Describe the sampled points in the core of a tile, as they were measured."""
    plan.keep("measure", tile, lambda: _measure(plan, tile, smoothed=False))


def measure_smoothed(plan: Plan, tile: int) -> None:
    """Describe them where they are looked at."""
    plan.keep("measure smoothed", tile, lambda: _measure(plan, tile, smoothed=True))


def measure_on_lines(plan: Plan, smoothed: bool, tile: int) -> None:
    """Describe them once more, where they turned out to lie on scan lines."""
    plan.keep("measure on lines", tile, lambda: _measure_on_lines(plan, tile, smoothed=smoothed))


def _measure(plan: Plan, tile: int, *, smoothed: bool) -> dict[str, np.ndarray]:
    side = _SIDE * plan.apart
    while (some := _sampled(plan, tile, side, smoothed=smoothed)) is not None:
        index, total = some.index, plan.num_points
        places = (index.sampled(number, total) for number in _NUMBERS)
        described, noisy, lined, few = (each[some.own[each]] for each in places)
        asked = np.unique(np.concatenate([described, noisy, lined]))
        reach = knn(index, at_places(index, asked), min(AREA, len(index))).distances[:, -1]
        if some.is_all or (len(index) >= AREA and (reach < some.depth[asked]).all()):
            features, spacing = describe_places(index, described)
            return {
                "features": features,
                "spacing": spacing,
                "noise": noise_at(index, noisy),
                "disc": disc_radii(index, noisy),
                "lines": on_lines(index, lined) if len(index) >= AREA else np.zeros(len(lined), bool),
                "few": index.at(few),
            }
        side *= 2
    none = np.zeros(0)
    return {**_nothing(), "noise": none, "disc": none, "lines": none, "few": np.zeros((0, 3))}


def _measure_on_lines(plan: Plan, tile: int, *, smoothed: bool) -> dict[str, np.ndarray]:
    side = _SIDE * plan.apart
    while (some := _sampled(plan, tile, side, smoothed=smoothed)) is not None:
        index = some.index
        described = index.sampled(SAMPLE, plan.num_points)
        described = described[some.own[described]]
        stretch, k = stretch_along_lines(index), min(SCALES[-1], len(index))
        reach = knn(index, at_places(index, described, stretch=stretch), k).distances[:, -1]
        reach = np.maximum(reach, stretch_reach(index)[described])
        if some.is_all or (len(index) >= AREA and (reach < some.depth[described]).all()):
            features, spacing = describe_places(index, described, stretch)
            return {"features": features, "spacing": spacing}
        side *= 2
    return _nothing()


def _nothing() -> dict[str, np.ndarray]:
    return {"features": np.zeros((0, NUM_FEATURES)), "spacing": np.zeros(0)}


@dataclass(frozen=True, eq=False)
class _Sampled:
    """Points around those that may be sampled."""

    index: NeighborIndex
    own: np.ndarray  # (N,) bool, by place: whether the tile owns it
    depth: np.ndarray  # (N,) float64, by place: within which all points are there, of a sampled one
    is_all: bool  # whether there are no others


def _sampled(plan: Plan, tile: int, side: float, *, smoothed: bool) -> _Sampled | None:
    """Read all points within `side` of those that may be sampled in the core of a tile; None if there are none."""
    core = plan.tiles[tile]
    window = core.grown(side, plan.apart).without_end(*plan.seen_bounds(smoothed=smoothed))
    points = plan.seen(window, smoothed=smoothed)
    xyz, own = points.seen, core.holds(points.xyz)
    picked = own & chosen(np.ascontiguousarray(xyz.T), max(_NUMBERS), plan.num_points)
    if not picked.any():
        return None
    near = _cells_around(xyz, picked, side)
    index = build_index(xyz[near])
    depth = np.minimum(window.depth(index.xyz.T), side)
    return _Sampled(index, own[near][index.order], depth, window.endless and bool(near.all()))


def _cells_around(xyz: np.ndarray, picked: np.ndarray, side: float) -> np.ndarray:
    """Say which points (N, 3) lie in a cell with a picked point, seen from above, or in one beside it, (N,) bool."""
    if picked.all():
        return picked
    cell = np.floor(xyz[:, :2] / side)
    column, row = (cell - cell.min(axis=0) + 1).astype(np.int64).T
    filled = np.zeros((column.max() + 2, row.max() + 2), bool)
    filled[column[picked], row[picked]] = True
    for axis in (0, 1):
        filled = filled | np.roll(filled, 1, axis) | np.roll(filled, -1, axis)
    return filled[column, row]


@dataclass(frozen=True, eq=False)
class Whole:
    """What the whole cloud says.

    Attributes
    ----------
    statistics : Statistics
    from_above : bool
        Whether the view from above shows nearly all of a sample of the points, so that it tells near from far sides.
    on_lines, measured_on_lines : bool
        Whether the points lie on scan lines, where they are looked at and as they were measured.
    cloud_spacing : float
        See `edgel._neighbors.spacing.cloud_spacing`.
    smoothing : float
        How far points are moved towards the planes of their nearest before they are looked at, 0 to 1.
    """

    statistics: Statistics
    from_above: bool
    on_lines: bool
    measured_on_lines: bool
    cloud_spacing: float
    smoothing: float

    @property
    def smoothed(self) -> bool:
        """Whether points are looked at elsewhere than where they were measured."""
        return self.smoothing > 0


def smoothing_of(plan: Plan) -> tuple[float, float]:
    """Say how far points have to be moved, 0 to 1, by the noise that was measured in all tiles, and their spacing."""
    noise, disc = _gather(plan, "measure", "noise", "disc")
    return share_of(noise_of(noise)), rounded_spacing(disc)


def lies_on_lines(plan: Plan, *, smoothed: bool) -> bool:
    """Whether the cloud lies on scan lines, by what was measured in all tiles."""
    (lines,) = _gather(plan, "measure smoothed" if smoothed else "measure", "lines")
    return plan.num_points >= AREA and are_lines(lines)


def merge_measures(plan: Plan) -> Whole:
    """Merge what was measured in all tiles.

    Raises
    ------
    ValueError
        If the cloud is one that only a whole can be seen of: shown best from one side.
    """
    smoothing, spacing = smoothing_of(plan)
    lines = lies_on_lines(plan, smoothed=smoothing > 0)
    step = "measure on lines" if lines else "measure smoothed" if smoothing > 0 else "measure"
    features, spacings = _gather(plan, step, "features", "spacing")
    return Whole(
        statistics=statistics_of(features.astype(np.float32), spacings),
        from_above=_is_seen_from_above(plan),
        on_lines=lines,
        measured_on_lines=lies_on_lines(plan, smoothed=False),
        cloud_spacing=spacing,
        smoothing=smoothing,
    )


def _is_seen_from_above(plan: Plan) -> bool:
    """Whether the view from above tells near from far sides, which the coarser look does not ask for."""
    if plan.options.viewpoint is not None or plan.cell:
        return False
    (few,) = _gather(plan, "measure", "few")
    direction = direction_that_explains(few)
    if direction is not None and not (direction == (0.0, 0.0, -1.0)).all():
        raise ValueError(
            f"points: the cloud shows as a whole along {direction.round(2).tolist()}, and tiles are columns along z; "
            "turn it so that it is seen from above, or give a viewpoint"
        )
    return direction is not None


def _gather(plan: Plan, step: str, *names: str) -> list[np.ndarray]:
    found = [plan.load(step, tile) for tile in range(len(plan.tiles))]
    return [np.concatenate([part[name] for part in found]) for name in names]
