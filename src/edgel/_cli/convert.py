"""``edgel convert``: from any format to any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import typer

from edgel._cli import files, jobs, options
from edgel._cli.batch import Talk, run_jobs
from edgel._cli.compare import differences, read_back, told_once
from edgel._cli.errors import exit_codes
from edgel._cli.jobs import Job
from edgel._cli.outcome import Told, cautions, notices, sentences
from edgel._cli.output import count
from edgel._cli.where import Where, take

HELP = """Convert clouds from any format to any other, with all they carry.

What the other format has no place for is said: the file is read back and compared. The input itself is replaced only by
a file that keeps all of it.

\b
Examples:
  edgel convert scan.e57 scan.ply
  edgel convert scan.las scan.pcd
  edgel convert scan.las roofs.laz --where "classification == 6"
  edgel convert *.las converted/ --format ply
  edgel convert depth.png cloud.ply --intrinsics camera.json
  edgel convert scan.pcd - | edgel detect - -o edges.ply
"""

_PART = "the points of --where alone would replace it: name another file"


def convert(
    sources: options.Inputs,
    output: Annotated[
        str,
        typer.Argument(
            metavar="OUT", help="The cloud to write, or a folder for one of each input; - writes PLY to stdout."
        ),
    ],
    where: options.Where = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    topic: options.Topic = None,
    output_format: options.Format = None,
    check: Annotated[
        bool,
        options.own(
            "--check/--no-check", text="Read the file back and compare.", group=options.OUTPUT, default="check"
        ),
    ] = True,
    clobber: options.Clobber = None,
    as_json: options.AsJson = False,
    workers: options.Workers = 1,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Convert clouds from any format to any other."""
    with exit_codes(as_json=as_json, debug=debug):
        files.check_stdout(output, as_json=as_json)
        reading = files.Reading(intrinsics, columns, sample_mesh, topic)
        wanted = _Wanted(reading, None if where is None else Where(where), check)
        extension = options.extension(output_format)
        todo = jobs.plan(sources, reading, output=output, extension=extension, clobber=clobber)
        run_jobs(todo, partial(_convert, wanted), Talk("convert", as_json, quiet, debug), workers=workers)


@dataclass(frozen=True)
class _Wanted:
    reading: files.Reading
    where: Where | None
    check: bool


def _convert(wanted: _Wanted, job: Job, progress: Callable[[str], None]) -> Told:
    in_place = jobs.check_job(job, wanted.reading, None if wanted.where is None else _PART)
    progress("reading")
    original = files.read_cloud(job.source, wanted.reading)
    cloud = take(original, wanted.where)
    progress("writing")
    lost = jobs.write(job, cloud, original if in_place else None)
    if wanted.check and job.output is not None:
        progress("comparing")
        lost = told_once(cloud, lost, differences(cloud, read_back(job.output, cloud)))
    if original.is_organized and not cloud.is_organized:
        lost["organized rows and columns"] = "left out, since --where leaves gaps"
    facts = {
        "input": job.source,
        "output": job.output,
        "points": len(original),
        "points_written": len(cloud),
        "columns": ("x", "y", "z", *cloud.attributes),
        "compared": wanted.check,
        "lost": sentences(lost),
        "notices": notices(original),
    }
    size = f"{count(len(cloud))} points ({', '.join(('x y z', *cloud.attributes))})"
    return Told(
        facts,
        headline=f"{job.name}: {count(len(cloud))} points -> {job.target}",
        remarks=cautions(job, original, lost),
        written=[f"{job.target}: {size}"],
    )
