"""Room on the disk: what a run will take, from what files promise, and then from what its first tiles took."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from edgel.io.chunks import count_rows
from edgel.tiled.plan import Plan
from edgel.tiled.spool import BYTES_A_POINT

_EXPANDS = 8  # bytes of points in the spool for one of a file that does not say how many it has, at most
RESULTS = 76  # bytes a point of results, as measured on a city of which one point in ten is an edge's
SMOOTHED = 115  # bytes a point that noise adds: where it is looked at, 56, means of cells, and results of these
_LABELS = 0.6  # bytes of edge points, labelled and written, over what was kept to find them: measured, 0.5 to 0.6


def check_before(paths: Sequence[str], work: Path) -> None:
    """Compare the spool of the files that are not in it, and the least that results take, with the free space.

    Raises
    ------
    OSError
        If it is too little; the message says how much is missing.
    """
    missing = [path for n, path in enumerate(paths) if not (work / "spool" / f"{n:06d}" / "part.json").exists()]
    rows = {path: count_rows(path) for path in missing}
    _check(
        work,
        sum(
            _EXPANDS * os.path.getsize(path) if count is None else (BYTES_A_POINT + RESULTS) * count
            for path, count in rows.items()
        ),
    )


def check_results(plan: Plan) -> None:
    """Compare what the tiles not yet classified will take, as much a point as those before, with the free space.

    Raises
    ------
    OSError
        If it is too little.
    """
    size = points = 0
    for tile in range(len(plan.tiles)):
        path = plan.result("classify", tile)
        if path.exists():
            size += path.stat().st_size
            with plan.load("classify", tile) as found:
                points += int(found["points"])
    if points:
        _check(plan.folder, int(size / points * ((1 + _LABELS) * plan.num_points - points)))


def check_smoothed(plan: Plan) -> None:
    """Compare what a cloud takes besides that has to be smoothed with the free space, unless that is done.

    Raises
    ------
    OSError
        If it is too little.
    """
    if not plan.smoothed.folder.exists():
        _check(plan.folder, SMOOTHED * plan.num_points)


def _check(work: Path, needed: int) -> None:
    free = shutil.disk_usage(work).free
    if needed > free:
        raise OSError(
            f"{work}: about {needed / 1e9:.1f} GB more are needed beside the inputs, and {free / 1e9:.1f} GB are free; "
            "free some and go on with the same call, or name a folder on a larger disk"
        )
