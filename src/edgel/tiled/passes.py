"""The passes over all tiles, one after the other: the tasks of each, and what is merged between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from edgel._neighbors.normals import OUTWARD, OWN
from edgel._surface.coarser import FEWEST
from edgel.tiled.chains import Line, draw_line, link_tile, merge_chains
from edgel.tiled.classify import classify_tile
from edgel.tiled.coarser import (
    carry_tile,
    cell_of,
    check_cells,
    farthest_outside,
    find_tile,
    mark_tile,
    mean_tile,
    plan_coarser,
)
from edgel.tiled.disk import check_results, check_smoothed
from edgel.tiled.engine import Engine
from edgel.tiled.label import label_tile
from edgel.tiled.measure import (
    Whole,
    lies_on_lines,
    measure,
    measure_on_lines,
    measure_smoothed,
    merge_measures,
    smoothing_of,
)
from edgel.tiled.outward import agree_in_tile, face_outwards, find_outermost, join_pieces, turn_tile
from edgel.tiled.plan import Plan
from edgel.tiled.scans import see_scans
from edgel.tiled.smooth import smooth_tile


class TileError(OSError):
    """Some files or tiles failed twice: the message names them and why, and the same call goes on with them."""


def find_edges(engine: Engine, plan: Plan) -> None:
    """Find the edges of all tiles.

    Raises
    ------
    TileError
        If some tiles failed twice.
    """
    whole, line = _classified(engine, plan)
    if whole.smoothed:
        _look_coarser(engine, plan, whole, line)
    _run(engine, "placing", label_tile, plan, whole, line)
    _turned(engine, plan, whole)


def see_all(engine: Engine, plan: Plan, paths: Sequence[str]) -> None:
    """Find the edges of organized scans among the inputs, each seen from its own sensor."""
    numbers = [part.number for part in plan.spool.parts if part.num_scans]
    failed = engine.run("seeing scans", _do, [(see_scans, plan.folder, number) for number in numbers])
    raise_for(failed, "file", [paths[number] for number in numbers])


def _run(
    engine: Engine,
    what: str,
    task: Callable[..., None],
    plan: Plan,
    *arguments: Any,
    check: Callable[[], None] | None = None,
) -> None:
    """Run ``task(plan, *arguments, tile)`` for all tiles."""
    jobs = [(task, plan.folder, *arguments, tile) for tile in range(len(plan.tiles))]
    names = [f"x {t.low[0]:g} to {t.high[0]:g}, y {t.low[1]:g} to {t.high[1]:g}" for t in plan.tiles]
    raise_for(engine.run(f"{what}, coarser" if plan.cell else what, _do, jobs, check), "tile", names)


def _do(task: Callable[..., None], folder: Path, *arguments: Any) -> None:
    task(Plan.read(folder), *arguments)


def _classified(engine: Engine, plan: Plan) -> tuple[Whole, Line]:
    """Classify all points where they are looked at, and draw the line."""
    _run(engine, "measuring", measure, plan)
    share, spacing = smoothing_of(plan)
    if share > 0:
        check_smoothed(plan)
        _run(engine, "smoothing", smooth_tile, plan, share, spacing)
        _run(engine, "measuring smoothed", measure_smoothed, plan)
    if lies_on_lines(plan, smoothed=share > 0):
        _run(engine, "measuring on lines", measure_on_lines, plan, share > 0)
    whole = merge_measures(plan)
    # As soon as some tiles tell what a point takes, room for the others is compared.
    _run(engine, "classifying", classify_tile, plan, whole, check=partial(check_results, plan))
    line = draw_line(plan, whole)
    if not line.is_plain:
        _run(engine, "linking", link_tile, plan, line)
        merge_chains(plan)
    return whole, line


def _look_coarser(engine: Engine, plan: Plan, whole: Whole, line: Line) -> None:
    """Look at the means of cells, and carry what they alone show back to the points."""
    check_cells(plan, cell_of(whole))
    _run(engine, "averaging", mean_tile, plan, whole)
    if plan.means.counts.sum() < FEWEST:
        return
    for coarser in plan_coarser(plan, whole):
        seen, drawn = _classified(engine, coarser)
        _run(engine, "placing", find_tile, coarser, seen, drawn)
    _run(engine, "marking", mark_tile, plan, whole)
    _run(engine, "carrying", carry_tile, plan, whole, line, farthest_outside(plan))


def _turned(engine: Engine, plan: Plan, whole: Whole) -> None:
    """Turn the faces of all edges to the outside, where the cloud's or a whole surface's normals tell it."""
    if plan.orientation == OUTWARD:
        _run(engine, "agreeing", agree_in_tile, plan, whole)
        join_pieces(plan)
        _run(engine, "facing outwards", find_outermost, plan)
        face_outwards(plan)
    if plan.orientation in (OUTWARD, OWN):
        _run(engine, "turning", turn_tile, plan, whole)


def raise_for(failed: dict[int, BaseException], what: str, names: Sequence[str]) -> None:
    """Raise a `TileError` for what failed, named by what it is."""
    if failed:
        error = next(iter(failed.values()))
        where = "; ".join(f"{what} {n} ({names[n]})" for n in failed)
        raise TileError(
            f"{where} failed twice, the first with: {error!r:.300}; all others are done, and the same call does "
            "what is missing"
        ) from error
