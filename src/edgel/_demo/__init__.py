"""The published experiment again: two pipe fittings, the paper's tables beside ours, and a report to look at."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from edgel import paper, plot, synth
from edgel._demo.measure import NUM_NEIGHBORS, Measurement, Times, measure_times
from edgel._demo.tables import (
    PUBLISHED,
    REACH,
    count_table,
    findings,
    normals_table,
    offset_table,
    time_table,
    truth_table,
)
from edgel._demo.truth import found_lengths, offsets
from edgel._detect import detect
from edgel._report import Case, Table, make_directory, write_report
from edgel._report import file_names as report_names
from edgel.io import write

__all__ = ["Demo", "Measurement", "Times", "file_names", "run_demo", "side_by_side"]

_DRAWN = (
    0.5  # mm between the points of a part in the report's first figure: evenly apart, or the far side shows through
)


@dataclass(frozen=True, eq=False)
class Demo:
    """What `run_demo` measured and wrote.

    Attributes
    ----------
    measurements : tuple of Measurement
        Tee and elbow.
    tables : tuple of Table
        The paper's tables beside ours, and what it leaves out.
    findings : tuple of str
        What they say, in sentences.
    page : Path
        The report.
    files : tuple of Path
        Everything written, the page too.
    """

    measurements: tuple[Measurement, ...]
    tables: tuple[Table, ...]
    findings: tuple[str, ...]
    page: Path
    files: tuple[Path, ...]


def run_demo(
    directory: str | os.PathLike[str],
    *,
    repeats: int = 3,
    num_points: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Demo:
    """Simulate the paper's tee and elbow, find their edges as it does, and compare times and truth with what it says.

    Parameters
    ----------
    directory : path
        Made if it does not exist. Clouds and edge points go there as PLY, figures as PNG, and the report.
    repeats : int
        Rounds of time measurement after one that only warms up; the median counts.
    num_points : int, optional
        Points of each scan. Default: as many as in the paper.
    progress : callable, optional
        Called with the name of each step as it begins.

    Raises
    ------
    ValueError
        If `repeats` is below 1 or `num_points` below 100.
    OSError
        If the directory cannot be made or written.
    """
    if repeats < 1:
        raise ValueError(f"repeats: expected 1 or more, got {repeats}")
    if num_points is not None and num_points < 100:
        raise ValueError(f"num_points: expected 100 or more, got {num_points}")
    folder = make_directory(directory)
    tell = progress or (lambda _: None)
    tell("scanning")
    solids = (synth.tee(), synth.elbow())
    scans = [synth.scan(solid, num_points=num_points or PUBLISHED[solid.name].points) for solid in solids]
    clouds = [scan.cloud for scan in scans]
    tell("finding edges")
    paper.detect(clouds[0], num_neighbors=NUM_NEIGHBORS)  # so that the report's times hold no compilation
    found = [paper.detect(cloud, num_neighbors=NUM_NEIGHBORS) for cloud in clouds]
    times = measure_times(clouds, found, repeats, tell)
    tell("comparing with the default method")
    others = [detect(cloud) for cloud in clouds]
    tell("comparing with the truth")
    measurements = tuple(
        Measurement(
            solid,
            scan,
            edges,
            spent,
            found_lengths(solid, scan.cloud, edges, reach=REACH),
            offsets(solid, scan.cloud, edges),
        )
        for solid, scan, edges, spent in zip(solids, scans, found, times, strict=True)
    )
    tables = tuple(make(measurements) for make in (count_table, normals_table, time_table, truth_table, offset_table))
    said = tuple(sentence for one in measurements for sentence in findings(one))
    tell("writing clouds")
    files = [path for one in measurements for path in _write_clouds(folder, one)]
    tell("drawing")
    plot.save(folder / "edges.png", side_by_side(measurements))
    cases = [
        Case(
            one.name,
            one.scan.cloud,
            one.edges,
            synth.sample(one.solid, pattern="blue_noise", spacing=_DRAWN).cloud,
            other=other,
        )
        for one, other in zip(measurements, others, strict=True)
    ]
    page = write_report(cases, folder, title="Edges of a tee and an elbow", findings=said, tables=tables)
    figures = [folder / f"{one.name}-figure-{number}.png" for one in measurements for number in range(1, 7)]
    return Demo(measurements, tables, said, page, (page, folder / "edges.png", *figures, *files))


def file_names() -> re.Pattern[str]:
    """Match the names of the files that the demo writes into its folder."""
    parts = list(PUBLISHED)
    clouds = rf"(?:{'|'.join(parts)})(?:-edges)?\.ply"
    return re.compile(rf"{clouds}|edges\.png|{report_names(parts).pattern}", re.IGNORECASE)


def side_by_side(measurements: Sequence[Measurement], *, width: int = 1600) -> np.ndarray:
    """Draw all parts with their edges in one picture at one scale, (H, width, 3) uint8."""
    gap, rim = width // 40, 4
    extents = [np.ptp(one.solid.vertices[:, :2], axis=0) for one in measurements]
    free = width - gap * (len(extents) - 1) - 2 * rim * len(extents)
    scale = free / sum(extent[0] for extent in extents)
    height = int(np.ceil(max(extent[1] for extent in extents) * scale)) + 2 * rim
    canvas = np.full((height, width, 3), 255, np.uint8)
    left = 0
    for one, extent in zip(measurements, extents, strict=True):
        size = int(extent[0] * scale) + 2 * rim, height
        xyz = one.scan.cloud.xyz
        middle = (np.nanmin(xyz, axis=0) + np.nanmax(xyz, axis=0)) / 2
        look = {"direction": "top", "size": size, "detail": (middle, size[0] / scale), "legend": False}
        canvas[:, left : left + size[0]] = plot.picture(one.scan.cloud, one.edges, **look)
        left += size[0] + gap
    return canvas


def _write_clouds(folder: Path, one: Measurement) -> list[Path]:
    whole, edges = folder / f"{one.name}.ply", folder / f"{one.name}-edges.ply"
    write(whole, one.scan.cloud)
    write(edges, one.edges.to_cloud(one.scan.cloud))
    return [whole, edges]
