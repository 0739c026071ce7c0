"""Where the line is drawn on the whole cloud, and the chains of faint edge points across the seams of tiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.union_find import join
from edgel._neighbors.kdtree import NeighborIndex
from edgel._range_image import SHOWN, pixel_size, spreads_thin
from edgel._surface.line import NEAREST, STRONG, SURE, Faint, even_probability, faint_points
from edgel.tiled.box import Box
from edgel.tiled.classify import HALO, Window, open_window
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan

KINDS = ("crease", "outline")


@dataclass(frozen=True)
class Line:
    """What is drawn from all tiles' probabilities.

    Attributes
    ----------
    even : (float, float)
        The probability of a crease and of an outline that is as likely as not an edge's.
    sides : bool
        Whether the view from above tells near from far sides.
    """

    even: tuple[float, float]
    sides: bool


def draw_line(plan: Plan, whole: Whole) -> Line:
    """Merge the histograms of all tiles, and what shows from above."""
    counts, shown = np.zeros((2, 1), np.int64), np.zeros(2, np.int64)
    for tile in range(len(plan.tiles)):
        with plan.load("classify", tile) as found:
            counts, shown = counts + found["counts"], shown + found["from_above"]
    low, high = plan.bounds
    thin = spreads_thin(high - low, pixel_size(whole.statistics.spacing), plan.num_points)
    sides = whole.from_above and not thin and float(shown[0] / shown[1]) >= SHOWN
    return Line((even_probability(counts[0]), even_probability(counts[1])), sides)


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of points of a window, from the tiles that own them.

    Attributes
    ----------
    points : (M,) int64
        Ascending, in the window.
    tile, row : (M,) int64
        Which tile owns each, and the row in what that tile keeps.
    columns : dict of str to (M, ...) array
    """

    points: np.ndarray
    tile: np.ndarray
    row: np.ndarray
    columns: dict[str, np.ndarray]


def gather_known(plan: Plan, window: Window, box: Box, names: tuple[str, ...]) -> Known:
    """Gather some columns of the classified points of a window."""
    points, tiles, rows, columns = [], [], [], {name: [] for name in names}
    for tile in plan.around(box):
        with plan.load("classify", tile) as found:
            keys = found["key"]
            at = np.searchsorted(window.keys, keys).clip(max=len(window.keys) - 1)
            row = np.flatnonzero(window.keys[at] == keys)
            points.append(at[row])
            rows.append(row)
            tiles.append(np.full(len(row), tile))
            for name in names:
                columns[name].append(found[name][row])
    joined = np.concatenate(points)
    order = np.argsort(joined)
    return Known(
        joined[order],
        np.concatenate(tiles)[order],
        np.concatenate(rows)[order],
        {name: np.concatenate(parts)[order] for name, parts in columns.items()},
    )


def link_tile(plan: Plan, whole: Whole, line: Line, tile: int) -> None:
    """Link the faint points of a tile with each other and with those of others."""
    plan.keep("link", tile, lambda: _link(plan, whole, line, tile))


def _link(plan: Plan, whole: Whole, line: Line, tile: int) -> dict[str, np.ndarray]:
    halo, core = HALO * whole.statistics.spacing / 4, plan.tiles[tile]
    while True:
        window = open_window(plan, core, halo, whole.statistics.cell)
        if window is None:
            return {name: np.zeros((0, 2), np.int64) for kind in KINDS for name in _names(kind)} | {"read": np.array(0)}
        known = gather_known(plan, window, core.grown(halo, whole.statistics.cell), KINDS)
        index, core_point = window.index, np.empty(len(window.keys), bool)
        core_point[index.order] = window.core
        result, sure = {"read": np.array(len(index))}, True
        for kind, even in zip(KINDS, line.even, strict=True):
            own = np.flatnonzero(core_point[known.points])
            faint = _faint_of(index, known, kind, even, own)
            sure &= window.endless or _is_deep(window, known.points[faint.rows], faint.nearest)
            result |= _joined(known, kind, faint, even, tile)
        if sure:
            return result
        halo *= 2


def _names(kind: str) -> tuple[str, ...]:
    return tuple(f"{kind}_{name}" for name in ("row", "chain", "likeliest", "strong", "across"))


def _faint_of(index: NeighborIndex, known: Known, kind: str, even: float, own: np.ndarray) -> Faint:
    """Look at the faint points that the tile owns, beside all that are known."""
    if even >= SURE:  # plain edges need no others
        none = np.zeros((0, NEAREST), np.int64)
        return Faint(np.zeros(0, np.int64), none, none, np.zeros(0, bool))
    return faint_points(index, known.points, known.columns[kind], even, own)


def _is_deep(window: Window, points: np.ndarray, nearest: np.ndarray) -> bool:
    """Whether the nearest points lie less far away than the side of the window."""
    xyz = window.index.by_point()
    depth = np.empty(len(xyz))
    depth[window.index.order] = window.depth
    away = np.linalg.norm(xyz[nearest[:, -1]] - xyz[points], axis=1)
    return bool(nearest.shape[1] == NEAREST and (away < depth[points]).all())


def _joined(known: Known, kind: str, faint: Faint, even: float, tile: int) -> dict[str, np.ndarray]:
    """Join the faint points of a tile to chains, and list the pairs of a chain and a point of another tile."""
    probability, rows = known.columns[kind], faint.rows
    number = np.full(len(probability), -1)
    number[rows] = np.arange(len(rows))
    here, column = np.nonzero(faint.links >= 0)
    there = faint.links[here, column]
    mine = number[there] >= 0
    chain = join(len(rows), here[mine], number[there[mine]])
    across = np.column_stack([chain[here[~mine]], known.tile[there[~mine]], known.row[there[~mine]]])
    strong = np.zeros(chain.max(initial=-1) + 1, bool)
    np.logical_or.at(strong, chain, probability[rows] >= STRONG)
    values = known.row[rows], chain, faint.likeliest, strong, np.unique(across, axis=0)
    return dict(zip(_names(kind), values, strict=True))


def merge_chains(plan: Plan) -> None:
    """Join the chains of all tiles across their seams, and tell each tile which of its faint points hold on to one."""
    for kind in KINDS:
        found = []
        for tile in range(len(plan.tiles)):
            with plan.load("link", tile) as stored:
                found.append({name: stored[f"{kind}_{name}"] for name in ("row", "chain", "strong", "across")})
        first = np.concatenate([[0], np.cumsum([len(part["strong"]) for part in found])]).astype(np.int64)
        pairs = [np.zeros((2, 0), np.int64)]
        for tile, part in enumerate(found):
            for other in np.unique(part["across"][:, 1]):
                own, _, row = part["across"][part["across"][:, 1] == other].T
                theirs = found[other]["chain"][np.searchsorted(found[other]["row"], row)]
                pairs.append(np.stack([first[tile] + own, first[other] + theirs]))
        root = join(int(first[-1]), *np.concatenate(pairs, axis=1))
        strong = np.zeros(root.max(initial=-1) + 1, bool)
        np.logical_or.at(strong, root, np.concatenate([np.zeros(0, bool), *(part["strong"] for part in found)]))
        for tile, part in enumerate(found):
            kept = strong[root[first[tile] + part["chain"]]]
            plan.keep(f"chained {kind}", tile, lambda kept=kept: {"kept": kept})
