"""Normals that look out of what the whole cloud encloses, joined across tiles, and the edges' faces turned by them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from edgel._faces import Faces
from edgel._kinds import LIKELY
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import knn, visit_neighbors
from edgel._neighbors.normals import OUTWARD
from edgel._neighbors.orientation import COUNTS, NEIGHBORS, Agreement, agreement
from edgel._neighbors.pieces import BINS, SURELY, Outermost, Pairs, bins_of, cell_size, join, least_bin, within_cells
from edgel._neighbors.queries import at_places, every_place
from edgel._neighbors.scan_lines import stretch_reach
from edgel._sides import ALONG, AROUND, turn_faces
from edgel._surface.reach import and_farthest
from edgel.tiled.box import Box
from edgel.tiled.classify import HALO, Window, open_window
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan


def agree_in_tile(plan: Plan, whole: Whole, tile: int) -> None:
    """Join the points of each cell that reaches into a tile to pieces, and say how those of its core agree."""
    plan.keep("agree", tile, lambda: _agree(plan, whole, tile))


def _agree(plan: Plan, whole: Whole, tile: int) -> dict[str, np.ndarray]:
    size, halo, core = cell_size(whole.cloud_spacing), HALO * whole.cloud_spacing, plan.tiles[tile]
    while (window := open_window(plan, whole, core, halo)) is not None:
        found = agreement(window.index, window.stretch, whole.cloud_spacing)
        asked = _cells_of_pairs(found, window.owned, size)
        if window.endless or (_reach(window)[asked] < window.depth[asked]).all():
            return _joined(window, found, size)
        halo *= 2
    none, vectors = np.zeros(0, np.int64), np.zeros((0, 3))
    own = {"key": none, "xyz": vectors, "normals": vectors, "sign": none, "root": none, "bin": none}
    roots = {"root_key": none, "root_xyz": vectors, "counts": np.zeros((0, BINS), np.int64)}
    return {**own, **roots, "a": none, "b": none, "weight": none, "count": none}


def _cells_of_pairs(found: Agreement, core: np.ndarray, size: float) -> np.ndarray:
    """Return the places in cells with a point of the core, or with one that a point of the core is compared with."""
    pairs = found.pairs.take(core[found.pairs.a])
    cell = np.floor(found.xyz / size).astype(np.int64)
    cell -= cell.min(axis=0)
    sides = cell.max(axis=0) + 1
    number = (cell[:, 0] * sides[1] + cell[:, 1]) * sides[2] + cell[:, 2]
    return np.flatnonzero(np.isin(number, np.unique(number[np.concatenate([pairs.a, pairs.b])])))


def _reach(window: Window) -> np.ndarray:
    """Bound how far away anything lies that matters for what a place says of its neighbours, (N,) float64."""
    index, stretch = window.index, window.stretch
    if len(index) < NEIGHBORS:
        return np.full(len(index), np.inf)
    queries, reach = every_place(index, stretch), np.empty(len(index))
    of_planes = knn(index, queries, COUNTS[-1]).distances[:, -1].copy()
    if stretch is not None:
        of_planes = np.maximum(of_planes, stretch_reach(index))
    visit_neighbors(and_farthest, queries, index, NEIGHBORS, of_planes, np.zeros(len(index)), reach)
    return reach


def _joined(window: Window, found: Agreement, size: float) -> dict[str, np.ndarray]:
    index = window.index
    order = np.lexsort(found.xyz.T[::-1])
    found, key, own = found.ordered(order), window.keys[index.order[order]], window.owned[order]
    sign, root = join(within_cells(found.pairs, found.xyz, size), len(order), SURELY)
    pairs = found.pairs.take(own[found.pairs.a]).renamed(root, sign)
    roots = np.unique(np.concatenate([root[own], pairs.a, pairs.b]))
    number = np.full(len(order), -1)
    number[roots] = np.arange(len(roots))
    pairs = replace(pairs, a=number[pairs.a], b=number[pairs.b]).merged(len(roots))
    bins = bins_of(found.sure[own])
    counts = np.bincount(number[root[own]] * BINS + bins, minlength=len(roots) * BINS).reshape(-1, BINS)
    of_core = {"key": key[own], "xyz": found.xyz[own], "normals": found.normals[own], "sign": sign[own].astype(np.int8)}
    return {
        **of_core,
        "root": number[root[own]],
        "bin": bins.astype(np.uint8),
        "root_key": key[roots],
        "root_xyz": found.xyz[roots],
        "counts": counts,
        **vars(pairs),
    }


def join_pieces(plan: Plan) -> None:
    """Join the pieces of all cells, and say from which bin on a point is sure enough to be an outermost one."""
    found = []
    for tile in range(len(plan.tiles)):
        with plan.load("agree", tile) as kept:
            found.append({name: kept[name] for name in ("root_key", "root_xyz", "counts", "a", "b", "weight", "count")})
    keys, first = np.unique(np.concatenate([part["root_key"] for part in found]), return_index=True)
    xyz = np.concatenate([part["root_xyz"] for part in found])[first]
    order = np.lexsort((keys, *xyz.T[::-1]))  # by coordinates, as the whole numbers them
    number = np.empty(len(keys), np.int64)
    number[order] = np.arange(len(keys))
    counts, parts = np.zeros((len(keys), BINS), np.int64), [Pairs(*np.zeros((4, 0), np.int64))]
    for part in found:
        mine = number[np.searchsorted(keys, part["root_key"])]
        counts[mine] += part["counts"]
        parts.append(Pairs(mine[part["a"]], mine[part["b"]], part["weight"], part["count"]))
    names = Pairs.__dataclass_fields__
    turn, body = join(Pairs(*(np.concatenate([getattr(p, name) for p in parts]) for name in names)), len(keys))
    body = np.unique(body, return_inverse=True)[1]
    of_body = np.zeros((body.max(initial=-1) + 1, BINS), np.int64)
    np.add.at(of_body, body, counts)
    joined = {"key": keys, "turn": turn[number], "body": body[number], "least": least_bin(of_body)}
    plan.keep("pieces", 0, lambda: joined)


def _pieces(plan: Plan, found: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the sign (N,), the body (N,), and the least bin of each body, of the points that a tile keeps."""
    with plan.load("pieces", 0) as joined:
        at = np.searchsorted(joined["key"], found["root_key"])
        turn, body, least = joined["turn"][at], joined["body"][at], joined["least"]
    return found["sign"] * turn[found["root"]], body[found["root"]], least


def find_outermost(plan: Plan, tile: int) -> None:
    """Find the outermost points of each body in a tile."""
    plan.keep("outermost", tile, lambda: _outermost(plan, tile))


def _outermost(plan: Plan, tile: int) -> dict[str, np.ndarray]:
    with plan.load("agree", tile) as found:
        sign, body, least = _pieces(plan, found)
        kept = found["bin"] >= least[body]
        here, which = np.unique(body[kept], return_inverse=True)
        normals = np.nan_to_num(found["normals"][kept] * sign[kept, None])
        return {"body": here, **vars(Outermost.of(found["xyz"][kept], normals, which, len(here)))}


def face_outwards(plan: Plan) -> None:
    """Say of each body whether it has to be turned round."""
    with plan.load("pieces", 0) as joined:
        most = Outermost.of(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64), len(joined["least"]))
    for tile in range(len(plan.tiles)):
        with plan.load("outermost", tile) as found:
            most.merge(Outermost(found["far"], found["xyz"], found["says"]), found["body"])
    plan.keep("facing", 0, lambda: {"sign": most.signs})


def turn_tile(plan: Plan, whole: Whole, tile: int) -> None:
    """Turn the faces of a tile's edges by the normals around them, and say which are convex."""
    plan.keep("turn", tile, lambda: _turn(plan, whole, tile))


def _turn(plan: Plan, whole: Whole, tile: int) -> dict[str, np.ndarray]:
    halo, core = HALO * whole.statistics.spacing / 4, plan.tiles[tile]
    with plan.load("label", tile) as found:
        keys, unturned = found["key"], {"normals": found["normals"], "convex": found["convex"]}
    while len(keys) and (window := open_window(plan, whole, core, halo)) is not None:
        box = core.grown(halo, whole.statistics.cell)
        point, faces, sure = _edges_around(plan, window, box)
        own = np.isin(window.keys[point], keys)
        if window.endless or _is_deep(window, point[own]):
            turned = turn_faces(faces, window.index, point, sure, _normals(plan, window, box))
            order = np.argsort(window.keys[point[own]])  # as labels are kept
            return {"normals": turned.normals[own][order], "convex": turned.convex[own][order]}
        halo *= 2
    return unturned


def _edges_around(plan: Plan, window: Window, box: Box) -> tuple[np.ndarray, Faces, np.ndarray]:
    """Return the edge points (E,) of a window, ascending, their faces, and which are likelier than not."""
    order = np.argsort(window.keys)
    points, columns = [], {name: [] for name in (*Faces.__dataclass_fields__, "strength")}
    for tile in plan.around(box):
        with plan.load("label", tile) as found:
            at, here = _rows_of(window.keys[order], found["key"])
            points.append(order[at])
            for name, parts in columns.items():
                parts.append(found[name][here])
    point = np.concatenate(points)
    ascending = np.argsort(point)
    joined = {name: np.concatenate(parts)[ascending] for name, parts in columns.items()}
    sure = joined.pop("strength") >= LIKELY
    return point[ascending], Faces(**joined), sure


def _rows_of(ascending: np.ndarray, keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where in ascending keys (N,) those of (M,) are that are among them, and which of the latter these are."""
    at = np.searchsorted(ascending, keys).clip(max=len(ascending) - 1)
    here = np.flatnonzero(ascending[at] == keys)
    return at[here], here


def _is_deep(window: Window, points: np.ndarray) -> bool:
    """Whether all that counts for the faces at some points lies in the window."""
    index: NeighborIndex = window.index
    if len(index) < ALONG:
        return False
    around = knn(index, every_place(index), AROUND).distances[:, -1].copy()
    places = np.sort(index.places_of(points))
    reach = np.empty(len(index))
    arguments = (around, np.zeros(len(index)), reach)
    visit_neighbors(and_farthest, at_places(index, places, places), index, ALONG, *arguments)
    return bool((reach[places] < window.depth[places]).all())


def _normals(plan: Plan, window: Window, box: Box) -> np.ndarray:
    """Return the normals (N, 3) that tell the outside, by place; NaN where there are none."""
    normals, order = np.full((len(window.keys), 3), np.nan), np.argsort(window.keys)
    if plan.orientation == OUTWARD:
        with plan.load("facing", 0) as facing:
            signs = facing["sign"]
        for tile in plan.around(box):
            with plan.load("agree", tile) as found:
                at, here = _rows_of(window.keys[order], found["key"])
                sign, body, _ = _pieces(plan, found)
                normals[order[at]] = (found["normals"] * (sign * signs[body])[:, None])[here]
    else:
        keys, own = plan.spool.load_normals(box)
        at, here = _rows_of(window.keys[order], keys)
        normals[order[at]] = own[here]
    return normals[window.index.order]
