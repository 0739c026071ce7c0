"""The passes over all tiles, one after the other: the tasks of each, and what is merged between them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from edgel._neighbors.normals import OUTWARD, OWN
from edgel.tiled.chains import Line, draw_line, link_tile, merge_chains
from edgel.tiled.classify import classify_tile
from edgel.tiled.disk import check_results
from edgel.tiled.engine import Engine
from edgel.tiled.label import label_tile
from edgel.tiled.measure import Whole, lies_on_lines, measure, measure_on_lines, merge_measures
from edgel.tiled.outward import agree_in_tile, face_outwards, find_outermost, join_pieces, turn_tile
from edgel.tiled.plan import Plan


class TileError(OSError):
    """Some files or tiles failed twice: the message names them and why, and the same call goes on with them."""


def find_edges(engine: Engine, plan: Plan) -> None:
    """Find the edges of all tiles.

    Raises
    ------
    TileError
        If some tiles failed twice.
    """
    tiles = range(len(plan.tiles))
    names = [f"x {t.low[0]:g} to {t.high[0]:g}, y {t.low[1]:g} to {t.high[1]:g}" for t in plan.tiles]
    raise_for(engine.run("measuring", _measure, [(plan.folder, tile) for tile in tiles]), "tile", names)
    if lies_on_lines(plan):
        jobs = [(plan.folder, tile) for tile in tiles]
        raise_for(engine.run("measuring on lines", _measure_on_lines, jobs), "tile", names)
    whole = merge_measures(plan)
    jobs = [(plan.folder, whole, tile) for tile in tiles]
    check_after = partial(check_results, plan)  # as soon as some tiles tell what a point takes
    raise_for(engine.run("classifying", _classify, jobs, check_after), "tile", names)
    line = draw_line(plan, whole)
    if not line.is_plain:
        raise_for(engine.run("linking", _link, [(plan.folder, line, tile) for tile in tiles]), "tile", names)
        merge_chains(plan)
    raise_for(engine.run("placing", _label, [(plan.folder, whole, line, tile) for tile in tiles]), "tile", names)
    _turned(engine, plan, whole, names)


def _turned(engine: Engine, plan: Plan, whole: Whole, names: Sequence[str]) -> None:
    """Turn the faces of all edges to the outside, where the cloud's or a whole surface's normals tell it."""
    tiles = range(len(plan.tiles))
    each = [(plan.folder, tile) for tile in tiles]
    with_whole = [(plan.folder, whole, tile) for tile in tiles]
    if plan.orientation == OUTWARD:
        raise_for(engine.run("agreeing", _agree, with_whole), "tile", names)
        join_pieces(plan)
        raise_for(engine.run("facing outwards", _outermost, each), "tile", names)
        face_outwards(plan)
    if plan.orientation in (OUTWARD, OWN):
        raise_for(engine.run("turning", _turn, with_whole), "tile", names)


def _agree(folder: Path, whole: Whole, tile: int) -> None:
    agree_in_tile(Plan.read(folder), whole, tile)


def _outermost(folder: Path, tile: int) -> None:
    find_outermost(Plan.read(folder), tile)


def _turn(folder: Path, whole: Whole, tile: int) -> None:
    turn_tile(Plan.read(folder), whole, tile)


def _measure(folder: Path, tile: int) -> None:
    measure(Plan.read(folder), tile)


def _measure_on_lines(folder: Path, tile: int) -> None:
    measure_on_lines(Plan.read(folder), tile)


def _classify(folder: Path, whole: Whole, tile: int) -> None:
    classify_tile(Plan.read(folder), whole, tile)


def _link(folder: Path, line: Line, tile: int) -> None:
    link_tile(Plan.read(folder), line, tile)


def _label(folder: Path, whole: Whole, line: Line, tile: int) -> None:
    label_tile(Plan.read(folder), whole, line, tile)


def raise_for(failed: dict[int, BaseException], what: str, names: Sequence[str]) -> None:
    """Raise a `TileError` for what failed, named by what it is."""
    if failed:
        error = next(iter(failed.values()))
        where = "; ".join(f"{what} {n} ({names[n]})" for n in failed)
        raise TileError(
            f"{where} failed twice, the first with: {error!r:.300}; all others are done, and the same call does "
            "what is missing"
        ) from error
