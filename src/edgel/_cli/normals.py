"""``edgel normals``: a normal for every point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np

import edgel
from edgel._cli import files, jobs, options
from edgel._cli.batch import Talk, run_jobs
from edgel._cli.errors import ExitCode, exit_codes, failing_as
from edgel._cli.jobs import Job
from edgel._cli.outcome import Told, cautions, notices, sentences
from edgel._cli.output import count, renamed, time_rows
from edgel._cli.summary import ORIENTATIONS
from edgel._cli.where import Where, select
from edgel._columns import make_room, set_aside
from edgel._stages import Stages

HELP = """Estimate the normal of every point of a cloud.

The whole cloud is written with [bold]nx ny nz[/bold], unit normals, NaN where the neighbours span no plane, and
[bold]variation[/bold], the surface variation (0 on a plane, 1/3 at most: large at edges and in noise). The input's own
columns of these names are kept as input_nx and so on.

\b
Examples:
  edgel normals scan.ply -o normals.ply
  edgel normals scan.las -o normals.laz --num-neighbors 24
  edgel normals scan.las -o normals.laz --viewpoint 637000 849000 2000
  edgel normals *.laz -o normals/
  cat scan.ply | edgel normals - -o - > normals.ply
"""

_COLUMNS = ("nx", "ny", "nz", "variation")


def normals(
    sources: options.Inputs,
    output: Annotated[
        str,
        options.output("The cloud to write, or a folder for one of each input; - writes PLY to stdout."),
    ],
    num_neighbors: Annotated[
        int | None,
        options.option(
            edgel.estimate_normals,
            "num_neighbors",
            "Neighbours of each plane fit, the point among them.",
            metavar="COUNT",
            group="Normals",
        ),
    ] = None,
    where: options.Where = None,
    viewpoint: options.Viewpoint = None,
    orient: options.Orient = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    topic: options.Topic = None,
    output_format: options.Format = None,
    clobber: options.Clobber = None,
    as_json: options.AsJson = False,
    workers: options.Workers = 1,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Estimate the normal of every point of a cloud."""
    with exit_codes(as_json=as_json, debug=debug):
        files.check_stdout(output, as_json=as_json)
        reading = files.Reading(intrinsics, columns, sample_mesh, topic)
        wanted = _Wanted(
            reading,
            None if where is None else Where(where),
            options.given(num_neighbors=num_neighbors, viewpoint=viewpoint, orient=orient),
        )
        todo = jobs.plan(sources, reading, output=output, extension=options.extension(output_format), clobber=clobber)
        run_jobs(todo, partial(_estimate, wanted), Talk("normals", as_json, quiet, debug), workers=workers)


@dataclass(frozen=True)
class _Wanted:
    reading: files.Reading
    where: Where | None
    given: dict[str, Any]


def _estimate(wanted: _Wanted, job: Job, progress: Callable[[str], None]) -> Told:
    in_place = jobs.check_job(job, wanted.reading)
    stages = Stages(progress)
    with stages("reading"):
        cloud = files.read_cloud(job.source, wanted.reading)
        seen = select(cloud, wanted.where)
    with stages("normals"), failing_as(ExitCode.DATA, job.source, wanted.given):
        planes = edgel.estimate_normals(seen, **wanted.given)
    with stages("writing"):
        values = (*planes.normals.astype(np.float32).T, planes.variation.astype(np.float32))
        written = make_room(cloud, _COLUMNS).with_attributes(**dict(zip(_COLUMNS, values, strict=True)))
        lost = jobs.write(job, written, cloud if in_place else None)
    missing, unseen = (int(np.isnan(points.xyz.sum(axis=1) * 0).sum()) for points in (cloud, seen))
    aside = set_aside(cloud.attributes, _COLUMNS)
    facts = {
        "input": job.source,
        "output": job.output,
        "renamed": aside,
        "lost": sentences(lost),
        "notices": notices(cloud),
        "points": len(cloud),
        "not_selected": unseen - missing,
        "not_finite": missing,
        "normals_undefined": planes.num_undefined - unseen,
        "orientation": planes.orientation,
        "parameters": wanted.given,
        "seconds": stages.seconds,
    }
    return Told(
        facts,
        title=f"Normals of {job.name}",
        rows=[*_rows(facts), *time_rows(stages.seconds)],
        headline=f"{job.name}: normals of {count(len(cloud) - planes.num_undefined)} points -> {job.target}",
        remarks=cautions(job, cloud, lost) + ([(renamed(aside), None)] if aside else []),
        written=[f"{job.target}: the whole cloud with nx, ny, nz and variation"],
    )


def _rows(facts: dict[str, Any]) -> list[tuple[str, ...]]:
    rows = [
        ("points", facts["points"], ""),
        ("left out", facts["not_selected"], "by --where, without a normal"),
        ("not finite", facts["not_finite"], "without a normal"),
        ("normals undefined", facts["normals_undefined"], "the neighbours span no plane"),
    ]
    orientation = facts["orientation"]
    told = [(name, count(number), remark) for name, number, remark in rows if number or name == "points"]
    return [*told, ("orientation", orientation, ORIENTATIONS[orientation])]
