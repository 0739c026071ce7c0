"""``edgel detect``: find the edge points of a cloud and write them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import edgel
from edgel._cli import as_one as tiles
from edgel._cli import files, jobs, options
from edgel._cli.batch import Talk, run_jobs
from edgel._cli.errors import ExitCode, Failure, exit_codes
from edgel._cli.jobs import Job
from edgel._cli.methods import check_options, find_edges
from edgel._cli.outcome import Told, cautions, notices, sentences
from edgel._cli.output import renamed
from edgel._cli.reports import check_report, report_on
from edgel._cli.summary import collect, headline, summary
from edgel._cli.units import unit_of
from edgel._cli.where import Where
from edgel._columns import set_aside
from edgel._stages import Stages
from edgel.edges import ALL_COLUMNS, FIRST_COLUMNS, Edges

HELP = """Find the edge points of clouds, their kind, and their normals.

The edge points are written with all attributes of the input and [bold]edge_kind[/bold] (flags: 1 boundary, 2 occluding,
4 occluded, 8 crease, 16 color, 32 image), [bold]edge_strength[/bold] (0 to 1), [bold]edge_angle[/bold] between the two
faces (radians), [bold]edge_convex[/bold] (1 convex, -1 concave, 0 unknown), the faces' normals [bold]nx ny nz nx2 ny2
nz2[/bold], the edge's tangent [bold]tx ty tz[/bold], refined place [bold]edge_x edge_y edge_z[/bold] and its standard
deviation [bold]edge_std[/bold]; what is not known is NaN. The input's own columns of these names are kept as input_nx
and so on. --all leaves out the second normal, the tangent and the place. Lengths are in the cloud's unit, which
the summary names where the file tells it. Without -o only the summary is shown.

Of several inputs, or a folder, -o names a folder: each cloud's edges get the name of its file there, and what fails is
said at the end and stops no other.

\b
Examples:
  edgel detect scan.ply -o edges.ply
  edgel detect scan.las -o labelled.laz --all
  edgel detect *.laz -o edges/ --workers 2
  edgel detect *.laz -o city/ --as-one
  edgel detect scan.las -o roofs.laz --where "classification == 6"
  edgel detect scan.txt --columns _,x,y,z,intensity -o edges.ply
  edgel detect part.stl --sample-mesh 200000 -o edges.ply
  edgel detect depth.png --intrinsics camera.json -o edges.ply
  edgel detect scan.ply --kinds crease,boundary --method surface -o edges.ply
  edgel detect scan.ply --scale 4 --min-angle 30 -o large.ply
  edgel detect scan.ply --method paper --sigma 2 --report report
  cat scan.ply | edgel detect - -o - > edges.ply
"""

_SUSPICIOUS_SHARE = 0.5  # of edge points; CAD models sampled with known edges have 2 to 13 %
_PART = "the edge points alone would replace it: name another file, or add --all, which keeps every point"


def detect(
    sources: options.Inputs,
    output: Annotated[
        str | None,
        options.output("The cloud to write, or a folder for one of each input; - writes PLY to stdout."),
    ] = None,
    method: options.Method = options.METHOD,
    kinds: options.Kinds = None,
    where: options.Where = None,
    viewpoint: options.Viewpoint = None,
    orient: options.Orient = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    topic: options.Topic = None,
    label_all: Annotated[
        bool,
        options.own(
            "--all",
            text="Write the whole cloud, labelled; edge_kind is 0 where there is no edge.",
            group=options.OUTPUT,
        ),
    ] = False,
    report: Annotated[
        str | None,
        options.own(
            "--report",
            text="Write a report with figures into this folder, of several inputs each into a folder in it.",
            group=options.OUTPUT,
            metavar="DIR",
        ),
    ] = None,
    min_strength: Annotated[
        float | None,
        options.option(
            edgel.detect,
            "min_strength",
            "Least strength of an edge point, 0 to 1: at 0.5 it is as likely an edge as not; lower finds fainter ones.",
            metavar="SHARE",
        ),
    ] = None,
    num_neighbors: Annotated[
        int | None,
        options.option(
            edgel.detect, "num_neighbors", "Neighbours of each plane fit, the point among them.", metavar="COUNT"
        ),
    ] = None,
    scale: Annotated[
        float | None,
        options.option(
            edgel.detect,
            "scale",
            "Find only what is larger than this many median spacings: on the cloud thinned to one point a voxel.",
            metavar="SPACINGS",
        ),
    ] = None,
    max_scale: Annotated[
        float | None,
        options.option(
            edgel.detect,
            "max_scale",
            "Look for soft edges too, as of fillets or worn parts, at twice the scale, four times, up to this.",
            metavar="SPACINGS",
        ),
    ] = None,
    min_angle: Annotated[
        float | None,
        options.own(
            "--min-angle",
            text="Leave out creases whose faces turn less than this, 0 to 180.",
            group=options.EDGES,
            metavar="DEGREES",
            default="none",
        ),
    ] = None,
    crop: Annotated[
        tuple[float, float, float, float, float, float] | None,
        options.own(
            "--crop",
            text="Leave out edge points outside this box, its lower corner first; -inf and inf are no limit.",
            group=options.EDGES,
            metavar="X Y Z X Y Z",
            default="no box",
        ),
    ] = None,
    width: Annotated[int | None, options.paper_option("width", "Pixels of the image along x.", "PIXELS")] = None,
    height: Annotated[int | None, options.paper_option("height", "Pixels of the image along y.", "PIXELS")] = None,
    kernel_size: Annotated[
        int | None, options.paper_option("kernel_size", "Width of the Gaussian, odd.", "PIXELS")
    ] = None,
    sigma: Annotated[
        float | None, options.paper_option("sigma", "Standard deviation of the Gaussian.", "PIXELS")
    ] = None,
    low: Annotated[
        float | None, options.paper_option("low", "Lower threshold of the gradient, Sobel units.", "GRADIENT")
    ] = None,
    high: Annotated[
        float | None, options.paper_option("high", "Upper threshold of the gradient, Sobel units.", "GRADIENT")
    ] = None,
    tolerance: Annotated[
        float | None,
        options.paper_option("tolerance", "Half the window around an edge pixel, the cloud's unit.", "LENGTH"),
    ] = None,
    gray_min: Annotated[
        float | None, options.paper_option("gray_min", "Grey of the lowest point, 0 to 255.", "GREY")
    ] = None,
    as_one: tiles.AsOne = False,
    tile_points: tiles.TilePoints = None,
    scheduler: tiles.Scheduler = None,
    overwrite: tiles.Overwrite = False,
    output_format: options.Format = None,
    clobber: options.Clobber = None,
    as_json: options.AsJson = False,
    workers: options.Workers = 1,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Find the edge points of clouds."""
    given = options.given(
        kinds=kinds,
        min_strength=min_strength,
        num_neighbors=num_neighbors,
        viewpoint=viewpoint,
        orient=orient,
        scale=scale,
        max_scale=max_scale,
        width=width,
        height=height,
        kernel_size=kernel_size,
        sigma=sigma,
        low=low,
        high=high,
        tolerance=tolerance,
        gray_min=gray_min,
    )
    with exit_codes(as_json=as_json, debug=debug):
        given = check_options(method, given)
        _check_choice(method, min_angle, crop)
        if label_all and output is None:
            raise Failure(ExitCode.USAGE, "--all: says what -o writes; add -o OUT")
        files.check_stdout(output, as_json=as_json)
        talk, tiling = Talk("detect", as_json, quiet, debug), tiles.Tiling(as_one, tile_points, scheduler, overwrite)
        reading = files.Reading(intrinsics, columns, sample_mesh, topic)
        if as_one:
            refused = {"where": where, "all": label_all, "report": report, "min_angle": min_angle, "crop": crop}
            refused |= {**vars(reading), "clobber": clobber}
            tiles.detect_as_one(sources, output, output_format, method, given, refused, tiling, talk, workers)
            return
        tiling.check_unused()
        wanted = _Wanted(reading, None if where is None else Where(where), method, given, min_angle, crop, label_all)
        extension = options.extension(output_format)
        todo = jobs.plan(sources, reading, output=output, extension=extension, report=report, clobber=clobber)
        run_jobs(todo, partial(_detect, wanted), talk, workers=workers)


def _check_choice(method: str, min_angle: float | None, crop: Sequence[float] | None) -> None:
    """Raise a `Failure` for what cannot be left out of the edge points."""
    if method == options.PAPER and min_angle is not None:
        raise Failure(ExitCode.USAGE, "--min-angle: the published method tells no creases apart; leave it out")
    if min_angle is not None and not 0 <= min_angle <= 180:
        raise Failure(ExitCode.USAGE, f"--min-angle: expected 0 to 180 degrees, got {min_angle:g}")
    if crop is not None and not all(low <= high for low, high in zip(crop[:3], crop[3:], strict=True)):
        raise Failure(ExitCode.USAGE, f"--crop: the first corner must be the lower one, got {crop}")


@dataclass(frozen=True)
class _Wanted:
    """What is asked for of each cloud."""

    reading: files.Reading
    where: Where | None
    method: str
    given: dict[str, Any]
    min_angle: float | None
    crop: Sequence[float] | None
    label_all: bool


def _detect(wanted: _Wanted, job: Job, progress: Callable[[str], None]) -> Told:
    check_report(job, wanted.reading)
    in_place = jobs.check_job(job, wanted.reading, None if wanted.label_all else _PART)
    stages, page, lost = Stages(progress), None, {}
    found = find_edges(job.source, wanted.reading, wanted.where, wanted.method, wanted.given, stages)
    cloud, edges = found.cloud, choose(found.cloud, found.edges, wanted.min_angle, wanted.crop)
    if job.output is not None:
        with stages("writing"):
            written = edges.label(cloud) if wanted.label_all else edges.to_cloud(cloud)
            lost = jobs.write(job, written, cloud if in_place else None)
    if job.report is not None:
        with stages("report"):
            page = report_on(job, found.seen, edges, job.report)
    columns = FIRST_COLUMNS if wanted.label_all else ALL_COLUMNS
    aside = {} if job.output is None else set_aside(cloud.attributes, columns)
    unit = unit_of(cloud, job.source)
    facts = {"input": job.source, "output": job.output, "report": None if page is None else str(page), "unit": unit}
    facts |= {"renamed": aside, "lost": sentences(lost), "notices": notices(cloud)}
    facts |= collect(edges, found.not_selected, stages.seconds)
    return Told(
        facts,
        title=f"Edges of {job.name}",
        rows=summary(edges, found.not_selected, unit, stages.seconds),
        headline=f"{job.name}: {headline(edges)}{_arrow(job, page)}",
        remarks=[*cautions(job, cloud, lost), *_remarks(edges, aside)],
        written=_written(job, page, label_all=wanted.label_all),
    )


def choose(cloud: edgel.Cloud, edges: Edges, min_angle: float | None, crop: Sequence[float] | None) -> Edges:
    """Return the edge points that are sharp enough, the angle in degrees, and inside a box, corner after corner."""
    if min_angle is not None:
        edges = edges.drop_blunt(math.radians(min_angle))
    return edges if crop is None else edges.crop(cloud, [crop[:3], crop[3:]])


def _remarks(edges: Edges, aside: dict[str, str]) -> list[tuple[str, str | None]]:
    remarks: list[tuple[str, str | None]] = []
    if edges.share > _SUSPICIOUS_SHARE:
        text = "more than half of the points are edges: the cloud may be too sparse for this method"
        remarks.append((text, "yellow"))
    return remarks + ([(renamed(aside), None)] if aside else [])


def _arrow(job: Job, page: Path | None) -> str:
    """Say what was written where, in no more words than the names."""
    names = [name for name in (None if job.output is None else job.target, page) if name is not None]
    return f" -> {', '.join(map(str, names))}" if names else ""


def _written(job: Job, page: Path | None, *, label_all: bool) -> list[str]:
    """Say what was written where."""
    lines = []
    if job.output is not None:
        lines.append(f"{job.target}: {'the whole cloud, labelled' if label_all else 'the edge points'}")
    if page is not None:
        lines.append(f"{page}: the report")
    return lines or ["nothing was written; add -o edges.ply to write the edge points"]
