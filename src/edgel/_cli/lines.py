"""``edgel lines``: the edges of clouds as lines, arcs and circles, for CAD and for maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from edgel._cli import files, jobs, options
from edgel._cli.batch import Talk, run_jobs
from edgel._cli.errors import ExitCode, Failure, as_option, exit_codes, failing_as
from edgel._cli.jobs import Job
from edgel._cli.methods import Found, check_options, find_edges
from edgel._cli.outcome import Told, cautions, notices
from edgel._cli.output import count, time_rows
from edgel._cli.units import unit_of
from edgel._cli.where import Where
from edgel._report.lines import write_lines_page
from edgel._stages import Stages
from edgel.curves import FAINT, WRITERS, CurveKind, Curves, measures, right_angles, simplify, trace, write
from edgel.tiled import is_run, surroundings

HELP = """Draw the edges of clouds as lines, arcs and circles, measured on the faces beside them.

The extension of -o says what is written: [bold].dxf[/bold] (LINE, ARC, CIRCLE, 3D POLYLINE; a layer for each kind of
edge), [bold].gpkg .geojson .shp[/bold] (lines with Z and their measures, in the CRS of the cloud), [bold].svg[/bold] (a
drawing to scale), [bold].obj .ply[/bold] (line elements), [bold].csv[/bold] (lengths, diameters, angles and their
standard deviations). Lengths are in the cloud's unit. A folder that
[bold]edgel detect --as-one --min-strength 0.15[/bold] wrote is one input, whatever its tiles. DXF and maps need the
extra lines: pip install 'edgel\\[lines]'.

\b
Examples:
  edgel lines scan.ply -o drawing.dxf
  edgel lines scan.ply -o measures.csv --report report
  edgel lines scan.las -o ridges.gpkg --where "classification == 6"
  edgel lines scan.las -o breaklines.geojson --simplify 0.2
  edgel lines scan.las -o walls.gpkg --kinds boundary --right-angles 8
  edgel lines out/ -o breaklines.gpkg
  edgel lines scan.ply -o top.svg --view top --unit mm
"""
_GROUP = "Drawing"


def lines(
    sources: options.Inputs,
    output: Annotated[str, options.output("The drawing, map or table to write, or a folder for one of each input.")],
    kinds: options.Kinds = None,
    min_strength: Annotated[
        float | None,
        options.own(
            "--min-strength",
            text="Least strength of the edge points to begin with, 0 to 1; what faces do not confirm is left out.",
            group=options.EDGES,
            metavar="SHARE",
            default=f"{FAINT:g}",
        ),
    ] = None,
    where: options.Where = None,
    viewpoint: options.Viewpoint = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    topic: options.Topic = None,
    tolerance: Annotated[
        float | None,
        options.own(
            "--simplify",
            text="Leave out vertices from which a curve stays nearer than this, in the cloud's unit.",
            group=_GROUP,
            metavar="LENGTH",
            default="none is left out",
        ),
    ] = None,
    square: Annotated[
        float | None,
        options.own(
            "--right-angles",
            text="Turn lines in plan by up to so many degrees, so that neighbours meet at right angles, as walls do.",
            group=_GROUP,
            metavar="DEGREES",
            default="none is turned",
        ),
    ] = None,
    report: Annotated[
        str | None,
        options.own(
            "--report",
            text="Write a page with the measures on the picture into this folder, of several into folders in it.",
            group=options.OUTPUT,
            metavar="DIR",
        ),
    ] = None,
    view: Annotated[
        str, options.option(write, "view", "Of an SVG: top, front or right.", metavar="NAME", group=_GROUP)
    ] = options.default_of(write, "view"),
    unit: Annotated[
        str,
        options.option(write, "unit", "Of an SVG: the cloud's unit, mm, cm, m or in.", metavar="UNIT", group=_GROUP),
    ] = options.default_of(write, "unit"),
    scale: Annotated[
        float, options.option(write, "scale", "Of an SVG: 0.01 draws at 1:100.", metavar="RATIO", group=_GROUP)
    ] = options.default_of(write, "scale"),
    clobber: options.Clobber = None,
    as_json: options.AsJson = False,
    workers: options.Workers = 1,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Draw the edges of clouds as lines, arcs and circles."""
    with exit_codes(as_json=as_json, debug=debug):
        given = {"min_strength": FAINT} | options.given(kinds=kinds, viewpoint=viewpoint, min_strength=min_strength)
        if tolerance is not None and not tolerance >= 0:
            raise Failure(ExitCode.USAGE, f"--simplify: expected a length of 0 or more, got {tolerance:g}")
        if square is not None and not 0 < square <= 45:
            raise Failure(ExitCode.USAGE, f"--right-angles: expected degrees above 0 and up to 45, got {square:g}")
        condition = None if where is None else Where(where)
        drawing: dict[str, Any] = {"view": view, "unit": unit, "scale": scale}
        reading = files.Reading(intrinsics, columns, sample_mesh, topic)
        in_tiles = len(sources) == 1 and is_run(sources[0])
        wanted = _Wanted(reading, in_tiles, condition, check_options("auto", given), tolerance, square, drawing)
        if in_tiles:
            finding = options.given(kinds=kinds, min_strength=min_strength, where=where, viewpoint=viewpoint)
            _check_tiled(finding | options.given(**vars(reading)))
            todo = [Job(sources[0], output, report, no_clobber=clobber is False)]
        else:
            todo = jobs.plan(sources, reading, output=output, known=list(WRITERS), report=report, clobber=clobber)
        run_jobs(todo, partial(_draw, wanted), Talk("lines", as_json, quiet, debug), workers=workers)


@dataclass(frozen=True)
class _Wanted:
    """What is asked for of each cloud."""

    reading: files.Reading
    in_tiles: bool
    where: Where | None
    given: dict[str, Any]
    tolerance: float | None
    square: float | None
    drawing: dict[str, Any]


def _draw(wanted: _Wanted, job: Job, progress: Callable[[str], None]) -> Told:
    output = str(job.output)
    files.check_extension(output, list(WRITERS))
    files.check_file(output, no_clobber=job.no_clobber, among=job.among)
    files.check_not_input(output, [job.source, wanted.reading.intrinsics])
    stages = Stages(progress)
    if wanted.in_tiles:
        with stages("reading"), failing_as(ExitCode.DATA, job.source):
            cloud, edges = surroundings(job.source)
        found = Found(cloud, cloud, edges)
    else:
        files.check_input(job.source, wanted.reading)
        found = find_edges(job.source, wanted.reading, wanted.where, "auto", wanted.given, stages)
    with stages("lines"), failing_as(ExitCode.DATA, job.source, wanted.given):
        curves = replace(trace(found.seen, found.edges), crs=found.cloud.crs)
        curves = curves if wanted.square is None else right_angles(curves, np.radians(wanted.square))
        curves = curves if wanted.tolerance is None else simplify(curves, wanted.tolerance)
    with stages("writing"), failing_as(ExitCode.OUTPUT, output):
        jobs.make_folder(job)
        files.check_clobber(output, no_clobber=job.no_clobber)
        _write(output, curves, wanted.drawing)
    unit, page = unit_of(found.cloud, job.source), None
    if job.report is not None:
        with stages("report"), failing_as(ExitCode.OUTPUT, job.report):
            page = write_lines_page(job.report, job.name, curves, unit)
    facts = {
        "input": job.source,
        "output": output,
        "report": None if page is None else str(page),
        "unit": unit,
        "notices": notices(found.cloud),
    }
    facts |= {"curves": len(curves), "corners": int(curves.is_corner.sum()), "loops": len(curves.is_hole)}
    facts |= {"kinds": curves.count_kinds(), "length": float(curves.length.sum()), "seconds": stages.seconds}
    nothing = [] if len(curves) else [(f"{job.name}: no lines were found; the file is valid and empty", "yellow")]
    return Told(
        facts,
        title=f"Lines of {job.name}",
        rows=[*_rows(curves, unit), *time_rows(stages.seconds)],
        headline=f"{job.name}: {count(len(curves))} curves -> {output}",
        remarks=[*cautions(job, found.cloud, {}), *nothing],
        written=[f"{output}: {count(len(curves))} curves", *([] if page is None else [f"{page}: the report"])],
    )


def _check_tiled(given: dict[str, Any]) -> None:
    """Raise a `Failure` for options that say how clouds are read or edges found, where they have been found already."""
    for name in given:
        raise Failure(ExitCode.USAGE, f"{as_option(name)}: is for edges that are yet to be found; leave it out here")


def _write(output: str, curves: Curves, drawing: dict[str, Any]) -> None:
    try:
        write(output, curves, **drawing)
    except ImportError as error:
        raise Failure(ExitCode.OUTPUT, f"{Path(output).name}: {error}") from error


def _rows(curves: Curves, unit: str | None) -> list[tuple[str, ...]]:
    """Return the table that is shown: how many of each kind, and the largest circles."""
    rows: list[tuple[str, ...]] = [("curves", count(len(curves)), "")]
    for kind in CurveKind:
        of_kind = curves.kind == kind
        if of_kind.any():
            length = f"{curves.length[of_kind].sum():.6g} {unit or 'long'} in all"
            rows.append((f"  {kind.name.lower()}", count(int(of_kind.sum())), length))
    rows.append(("corners", count(int(curves.is_corner.sum())), ""))
    table = measures(curves)
    circles = np.flatnonzero(curves.kind == CurveKind.CIRCLE)
    for k in circles[np.argsort(-curves.radius[circles], kind="stable")][:10]:
        diameter, std = table["diameter"][k], table["diameter_std"][k]
        rows.append((str(table["name"][k]), f"{diameter:.6g}", f"diameter, deviation {std:.2g}"))
    return rows
