"""Where the line is drawn on the whole cloud, and the chains of faint edge points across the seams of tiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.union_find import join
from edgel._range_image import SHOWN, pixel_size, spreads_thin
from edgel._surface.line import STRONG, SURE, even_probability, faint_points
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

    @property
    def is_plain(self) -> bool:
        """Whether no point needs another to be an edge point."""
        return min(self.even) >= SURE


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


def link_tile(plan: Plan, line: Line, tile: int) -> None:
    """Link the faint points of a tile with each other and with those of others."""
    plan.keep("link", tile, lambda: _link(plan, line, tile))


def _link(plan: Plan, line: Line, tile: int) -> dict[str, np.ndarray]:
    known = _gather(plan, tile)
    result = {}
    for kind, even in zip(KINDS, line.even, strict=True):
        result |= _joined(known, kind, even)
    return result


@dataclass(frozen=True, eq=False)
class Known:
    """What is kept of the points of a tile, and of those in tiles around it that may be among their nearest.

    Attributes
    ----------
    tile, row : (M,) int64
        Which tile owns each, and the row in what that tile keeps; those of the tile itself come first.
    probability : dict of str to (M,) float64
    nearest : (O, 9) int64
        Which of these are the nearest of each of the tile's own; -1 for points that are none of these.
    """

    tile: np.ndarray
    row: np.ndarray
    probability: dict[str, np.ndarray]
    nearest: np.ndarray


def _gather(plan: Plan, tile: int) -> Known:
    with plan.load("classify", tile) as found:
        nearest, farthest = found["nearest"], float(found["farthest"].max(initial=0.0))
    box = plan.tiles[tile].grown(farthest * (1 + 1e-9), max(farthest, 1e-300))
    tiles = [tile, *(other for other in plan.around(box) if other != tile)]
    keys, parts = [], {kind: [] for kind in KINDS}
    for other in tiles:
        with plan.load("classify", other) as found:
            keys.append(found["key"])
            for kind in KINDS:
                parts[kind].append(found[kind])
    key = np.concatenate(keys)
    order = np.argsort(key)
    at = np.searchsorted(key, nearest, sorter=order).clip(max=max(len(key) - 1, 0))
    at = order[at] if len(order) else at
    nearest = np.where(key[at] == nearest, at, -1) if len(key) else nearest
    rows = [np.arange(len(part)) for part in keys]
    owner = np.repeat(tiles, [len(part) for part in keys])
    probability = {kind: np.concatenate(part) for kind, part in parts.items()}
    return Known(owner, np.concatenate(rows), probability, nearest)


def _names(kind: str) -> tuple[str, ...]:
    return tuple(f"{kind}_{name}" for name in ("row", "chain", "likeliest", "strong", "across"))


def _joined(known: Known, kind: str, even: float) -> dict[str, np.ndarray]:
    """Join the faint points of a tile to chains, and list the pairs of a chain and a point of another tile."""
    probability, own = known.probability[kind], np.arange(len(known.nearest))
    if even >= SURE:  # plain edges need no others
        own = own[:0]
    faint = faint_points(probability, even, own, known.nearest[own])
    rows, number = faint.rows, np.full(len(probability), -1)
    number[rows] = np.arange(len(rows))
    here, column = np.nonzero(faint.links >= 0)
    there = faint.links[here, column]
    mine = number[there] >= 0
    chain = join(len(rows), here[mine], number[there[mine]])
    across = np.column_stack([chain[here[~mine]], known.tile[there[~mine]], known.row[there[~mine]]])
    strong = np.zeros(chain.max(initial=-1) + 1, bool)
    np.logical_or.at(strong, chain, probability[rows] >= STRONG)
    values = rows, chain, faint.likeliest, strong, np.unique(across, axis=0)
    return dict(zip(_names(kind), values, strict=True))


def merge_chains(plan: Plan) -> None:
    """Join the chains of all tiles across their seams, and tell each tile which of its faint points hold on to one."""
    for kind in KINDS:
        found = [_strong_of(plan, kind, tile) for tile in range(len(plan.tiles))]
        first = np.concatenate([[0], np.cumsum([len(strong) for strong in found])]).astype(np.int64)
        pairs = [np.zeros((2, 0), np.int64), *(_pairs(plan, kind, tile, first) for tile in range(len(plan.tiles)))]
        root = join(int(first[-1]), *np.concatenate(pairs, axis=1))
        strong = np.zeros(root.max(initial=-1) + 1, bool)
        np.logical_or.at(strong, root, np.concatenate([np.zeros(0, bool), *found]))
        for tile in range(len(plan.tiles)):
            with plan.load("link", tile) as stored:
                kept = strong[root[first[tile] + stored[f"{kind}_chain"]]]
            plan.keep(f"chained {kind}", tile, lambda kept=kept: {"kept": kept})


def _strong_of(plan: Plan, kind: str, tile: int) -> np.ndarray:
    with plan.load("link", tile) as stored:
        return stored[f"{kind}_strong"]


def _pairs(plan: Plan, kind: str, tile: int, first: np.ndarray) -> np.ndarray:
    """Return the pairs (2, K) of chains that a tile's points link across its seams, by their numbers among all."""
    with plan.load("link", tile) as stored:
        across = stored[f"{kind}_across"]
    pairs = [np.zeros((2, 0), np.int64)]
    for other in np.unique(across[:, 1]):
        own, _, row = across[across[:, 1] == other].T
        with plan.load("link", other) as stored:
            theirs = stored[f"{kind}_chain"][np.searchsorted(stored[f"{kind}_row"], row)]
        pairs.append(np.unique(np.stack([first[tile] + own, first[other] + theirs]), axis=1))
    return np.concatenate(pairs, axis=1)
