"""``edgel info``: what a file holds."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rich.table import Table

from edgel._cli import files, jobs, options
from edgel._cli.batch import Talk, run_jobs
from edgel._cli.errors import ExitCode, exit_codes, failing_as
from edgel._cli.jobs import Job
from edgel._cli.outcome import Told, notices
from edgel._cli.output import count, length, print_table, stdout_console
from edgel._cli.units import unit_of
from edgel._cli.where import Where, take
from edgel._neighbors.kdtree import bounds, build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import at_points, every_point
from edgel.cloud import Cloud, check_points

HELP = """Say what files hold: points, extent, spacing, fields, and what may surprise (NaN, duplicates).

Lengths are in the cloud's unit, which is named where the file tells it. The spacing is the median distance from a point
to the nearest one elsewhere.

\b
Examples:
  edgel info scan.laz
  edgel info scan.ply --json
  edgel info *.laz
  edgel info scan.las --where "classification == 2"
  edgel info depth.png --intrinsics camera.json
"""

_SAMPLE = 200_000  # points whose nearest neighbour is looked for; the median needs no more


def info(
    sources: options.Inputs,
    where: options.Where = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    topic: options.Topic = None,
    as_json: options.AsJson = False,
    debug: options.Debug = False,
) -> None:
    """Say what files hold."""
    with exit_codes(as_json=as_json, debug=debug):
        reading = files.Reading(intrinsics, columns, sample_mesh, topic)
        work = partial(_describe, reading, None if where is None else Where(where))
        run_jobs(jobs.plan(sources, reading), work, Talk("info", as_json, debug=debug, show=_show))


def _describe(reading: files.Reading, where: Where | None, job: Job, progress: Callable[[str], None]) -> Told:
    files.check_input(job.source, reading)
    progress("reading")
    cloud = take(files.read_cloud(job.source, reading), where)
    progress("looking at the points")
    with failing_as(ExitCode.DATA, job.source):
        return Told({"input": job.source, "unit": unit_of(cloud, job.source), **describe(cloud)})


def _show(told: Told, among: bool) -> None:
    show(told.facts)
    if among:
        stdout_console().print()


def describe(cloud: Cloud) -> dict[str, Any]:
    """Return what ``--json`` prints of a cloud."""
    points = check_points(cloud, minimum=0)
    lower, upper = bounds(points.xyz) if len(points.xyz) else np.full((2, 3), np.nan)
    return {
        "points": len(cloud),
        "not_finite": points.num_dropped,
        "organized": cloud.shape,
        "lower": lower,
        "upper": upper,
        "extent": upper - lower,
        **nearest(points.xyz),
        "fields": [describe_field(name, values) for name, values in cloud.attributes.items()],
        "viewpoint": cloud.viewpoint,
        "crs": cloud.crs,
        "left_out": cloud.metadata.get("left_out", ()),
        "notices": notices(cloud),
    }


def nearest(xyz: np.ndarray) -> dict[str, Any]:
    """Return the spacing of finite points, and how many of them share their place with another."""
    if len(xyz) < 2:
        return {"spacing": None, "duplicates": 0, "sampled": None}
    sampled = len(xyz) > _SAMPLE
    index = build_index(xyz)
    if sampled:
        queries = at_points(index, np.random.default_rng(0).choice(len(xyz), _SAMPLE, replace=False))
    else:
        queries = every_point(index)
    distances = knn(index, queries, 2).distances[:, 1]
    apart = distances[distances > 0]
    duplicates = round((len(distances) - len(apart)) / len(distances) * len(xyz))
    return {
        "spacing": float(np.median(apart)) if len(apart) else None,
        "duplicates": duplicates,
        "sampled": _SAMPLE if sampled else None,
    }


def describe_field(name: str, values: np.ndarray) -> dict[str, Any]:
    """Return type, range and number of NaN of an attribute."""
    numbers = values.dtype.kind in "biuf"
    finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    known = numbers and finite.size > 0
    return {
        "name": name,
        "dtype": str(values.dtype),
        "columns": int(np.prod(values.shape[1:], dtype=int)),
        "min": finite.min() if known else None,
        "max": finite.max() if known else None,
        "not_finite": int(values.size - finite.size),
    }


def show(facts: dict[str, Any]) -> None:
    """Print the facts for people, on stdout: they are what the command was asked for."""
    console = stdout_console()
    print_table(str(facts["input"]), overview(facts), console=console)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("field", "type", "min", "max", "extent"):
        table.add_column(heading, justify="left" if heading in ("field", "type") else "right", overflow="fold")
    for axis, lower, upper, extent in zip("xyz", facts["lower"], facts["upper"], facts["extent"], strict=True):
        table.add_row(axis, "coordinate", length(lower), length(upper), length(extent))
    for field in facts["fields"]:
        columns = f" x {field['columns']}" if field["columns"] != 1 else ""
        note = f"{count(field['not_finite'])} not finite" if field["not_finite"] else ""
        table.add_row(field["name"], field["dtype"] + columns, number(field["min"]), number(field["max"]), note)
    console.print()
    console.print(table)


def overview(facts: dict[str, Any]) -> list[tuple[str, ...]]:
    """Return the rows that say something of the whole cloud."""
    rows: list[tuple[str, ...]] = [("points", count(facts["points"]))]
    if facts["organized"]:
        rows.append(("organized", "{} x {}".format(*facts["organized"]), "rows x columns"))
    if facts["not_finite"]:
        rows.append(("not finite", count(facts["not_finite"]), "NaN or infinite coordinates"))
    sample = f", about: from a sample of {count(facts['sampled'])}" if facts["sampled"] else ""
    if facts["duplicates"]:
        rows.append(("duplicates", count(facts["duplicates"]), "points at the place of another" + sample))
    if facts["spacing"] is not None:
        rows.append(("spacing", length(facts["spacing"]), "from a point to the nearest, median" + sample))
    if facts["unit"] is not None:
        rows.append(("unit", "", f"{facts['unit']}, says the file"))
    if facts["viewpoint"] is not None:
        rows.append(("viewpoint", " ".join(length(value) for value in facts["viewpoint"])))
    if facts["crs"] is not None:
        # WKT is long, its first name says which system it is; all of it is in the JSON.
        name = re.search(r'"([^"]+)"', facts["crs"])
        rows.append(("crs", "", name.group(1) if name else facts["crs"]))
    rows += [("left out", "", what) for what in facts["left_out"]]
    return rows + [("notice", "", what) for what in facts["notices"]]


def number(value: Any) -> str:
    """Write a value of a field, a float with the digits it has.

    Examples
    --------
    >>> number(np.float64(245379.398)), number(np.uint8(7)), number(None)
    ('245379.398', '7', '-')
    """
    if value is None:
        return "-"
    if isinstance(value, np.floating):
        return f"{value:.6g}" if value.itemsize < 8 else f"{value:.9g}"
    return str(int(value))
