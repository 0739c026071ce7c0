"""``edgel detect``: find the edge points of a cloud and write them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer

import edgel
from edgel._cli import files, options
from edgel._cli.compare import check_kept
from edgel._cli.errors import ExitCode, Failure, exit_codes, failing_as
from edgel._cli.methods import check_options, find_edges
from edgel._cli.output import print_json, print_line, print_table, renamed
from edgel._cli.progress import Watch
from edgel._cli.summary import collect, summary
from edgel._columns import set_aside
from edgel._stages import Stages
from edgel.edges import ALL_COLUMNS, FIRST_COLUMNS, Edges

HELP = """Find the edge points of a cloud, their kind, and their normals.

The edge points are written with all attributes of the input and [bold]edge_kind[/bold] (flags: 1 boundary, 2 occluding,
4 occluded, 8 crease, 16 color, 32 image), [bold]edge_strength[/bold] (0 to 1), [bold]edge_angle[/bold] between the two
faces (radians), [bold]edge_convex[/bold] (1 convex, -1 concave, 0 unknown), the faces' normals [bold]nx ny nz nx2 ny2
nz2[/bold], the edge's tangent [bold]tx ty tz[/bold] and refined place [bold]edge_x edge_y edge_z[/bold]; what is not
known is NaN. The input's own columns of these names are kept as input_nx and so on. --all leaves out the second normal,
the tangent and the place. Lengths are in the cloud's unit. Without -o only the summary is shown.

\b
Examples:
  edgel detect scan.ply -o edges.ply
  edgel detect scan.las -o labelled.laz --all
  edgel detect depth.png --intrinsics camera.json -o edges.ply
  edgel detect scan.txt --columns _,x,y,z,intensity -o edges.ply
  edgel detect part.stl --sample-mesh 200000 -o edges.ply
  edgel detect scan.ply --kinds crease,boundary --method surface -o edges.ply
  edgel detect scan.ply --scale 4 --min-angle 30 -o large.ply
  edgel detect scan.ply --method paper --sigma 2 --report report
  cat scan.ply | edgel detect - -o - > edges.ply
"""

_SUSPICIOUS_SHARE = 0.5  # of edge points; CAD models sampled with known edges have 2 to 13 %


def detect(
    source: options.Input,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="OUT", help="The cloud to write; - writes PLY to stdout."),
    ] = None,
    method: options.Method = options.METHOD,
    kinds: options.Kinds = None,
    label_all: Annotated[
        bool, typer.Option("--all", help="Write the whole cloud, labelled; edge_kind is 0 where there is no edge.")
    ] = False,
    report: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write a report with figures into this folder.")
    ] = None,
    min_strength: Annotated[
        float | None,
        options.option(
            edgel.detect,
            "min_strength",
            "Least strength of an edge point, 0 to 1: at 0.5 it is as likely an edge as not; lower finds fainter ones.",
        ),
    ] = None,
    num_neighbors: Annotated[
        int | None, options.option(edgel.detect, "num_neighbors", "Neighbours of each plane fit, the point among them.")
    ] = None,
    viewpoint: options.Viewpoint = None,
    scale: Annotated[
        float | None,
        options.option(
            edgel.detect,
            "scale",
            "Find only what is larger than this many median spacings: on the cloud thinned to one point a voxel.",
        ),
    ] = None,
    min_angle: Annotated[
        float | None,
        typer.Option(min=0, max=180, metavar="DEGREES", help="Leave out creases whose faces turn less than this."),
    ] = None,
    crop: Annotated[
        tuple[float, float, float, float, float, float] | None,
        typer.Option(
            metavar="X Y Z X Y Z",
            help="Leave out edge points outside this box, its lower corner first; -inf and inf are no limit.",
        ),
    ] = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    width: Annotated[int | None, options.paper_option("width", "Pixels of the image along x.")] = None,
    height: Annotated[int | None, options.paper_option("height", "Pixels of the image along y.")] = None,
    kernel_size: Annotated[
        int | None, options.paper_option("kernel_size", "Width of the Gaussian, pixels, odd.")
    ] = None,
    sigma: Annotated[float | None, options.paper_option("sigma", "Standard deviation of the Gaussian, pixels.")] = None,
    low: Annotated[float | None, options.paper_option("low", "Lower threshold of the gradient, Sobel units.")] = None,
    high: Annotated[float | None, options.paper_option("high", "Upper threshold of the gradient, Sobel units.")] = None,
    tolerance: Annotated[
        float | None, options.paper_option("tolerance", "Half the window around an edge pixel, the cloud's unit.")
    ] = None,
    gray_min: Annotated[float | None, options.paper_option("gray_min", "Grey of the lowest point, 0 to 255.")] = None,
    as_json: options.AsJson = False,
    no_clobber: options.NoClobber = False,
    debug: options.Debug = False,
) -> None:
    """Find the edge points of a cloud."""
    given = options.given(
        kinds=kinds,
        min_strength=min_strength,
        num_neighbors=num_neighbors,
        viewpoint=viewpoint,
        scale=scale,
        width=width,
        height=height,
        kernel_size=kernel_size,
        sigma=sigma,
        low=low,
        high=high,
        tolerance=tolerance,
        gray_min=gray_min,
    )
    page = None
    with exit_codes(as_json=as_json, debug=debug):
        given = check_options(method, given)
        reading = files.Reading(intrinsics, columns, sample_mesh)
        in_place = check_outputs(
            output, report, source, reading, label_all=label_all, as_json=as_json, no_clobber=no_clobber
        )
        if method == options.PAPER and min_angle is not None:
            raise Failure(ExitCode.USAGE, "--min-angle: the published method tells no creases apart; leave it out")
        if crop is not None and not all(low <= high for low, high in zip(crop[:3], crop[3:], strict=True)):
            raise Failure(ExitCode.USAGE, f"--crop: the first corner must be the lower one, got {crop}")
        files.check_input(source, reading)
        with Watch() as watch:
            stages = Stages(watch)
            cloud, edges = find_edges(source, reading, method, given, stages)
            edges = choose(cloud, edges, min_angle, crop)
            if output is not None:
                with stages("writing"):
                    written = edges.label(cloud) if label_all else edges.to_cloud(cloud)
                    if in_place:
                        check_kept(output, cloud, written)
                    files.write_cloud(output, written, no_clobber=no_clobber)
            if report is not None:
                with stages("report"):
                    page = report_on(source, output, cloud, edges, report)
        aside = {} if output is None else set_aside(cloud.attributes, FIRST_COLUMNS if label_all else ALL_COLUMNS)
        if as_json:
            print_json(collect(source, output, page, edges, stages.seconds, aside))
            return
        files.tell_notices(source, cloud)
        print_table(f"Edges of {source}", summary(edges, stages.seconds))
        if edges.share > _SUSPICIOUS_SHARE:
            print_line(
                "more than half of the points are edges: the cloud may be too sparse for this method", style="yellow"
            )
        tell_written(output, page, aside, label_all=label_all)


def choose(cloud: edgel.Cloud, edges: Edges, min_angle: float | None, crop: Sequence[float] | None) -> Edges:
    """Return the edge points that are sharp enough, the angle in degrees, and inside a box, corner after corner."""
    if min_angle is not None:
        edges = edges.drop_blunt(math.radians(min_angle))
    return edges if crop is None else edges.crop(cloud, [crop[:3], crop[3:]])


def tell_written(output: str | None, page: Path | None, aside: Mapping[str, str], *, label_all: bool) -> None:
    """Say what was written, and which columns of the input have other names there."""
    if aside:
        print_line(renamed(aside))
    if output is not None:
        what = "the whole cloud, labelled" if label_all else "the edge points"
        print_line(f"{'stdout' if output == files.PIPE else output}: {what}")
    if page is not None:
        print_line(f"{page}: the report")
    if output is None and page is None:
        print_line("nothing was written; add -o edges.ply to write the edge points", style="dim")


def check_outputs(
    output: str | None,
    report: str | None,
    source: str,
    reading: files.Reading,
    *,
    label_all: bool,
    as_json: bool,
    no_clobber: bool,
) -> bool:
    """Return whether the input itself is replaced, or raise a `Failure` for outputs that must not or cannot be written.

    They may contradict each other, hold less than the input that they replace, or lie where nothing can be written.
    """
    if label_all and output is None:
        raise Failure(ExitCode.USAGE, "--all: says what -o writes; add -o OUT")
    if as_json and output == files.PIPE:
        raise Failure(ExitCode.USAGE, "--json: stdout carries the cloud already; name a file with -o")
    if report is not None:
        from edgel._report import file_names  # not at the top: Matplotlib takes time to import

        names = file_names([name_of(source)])
        files.check_new_folder(report, names, inputs=[source, reading.intrinsics], no_clobber=no_clobber)
    if output is None:
        return False
    files.check_output(output, no_clobber=no_clobber)
    return files.check_in_place(output, source, reading, whole=label_all)


def name_of(source: str) -> str:
    """Return what a report calls an input."""
    return "stdin" if source == files.PIPE else Path(source).stem


def report_on(source: str, output: str | None, cloud: edgel.Cloud, edges: Edges, directory: str) -> Path:
    """Write the report of one cloud, compared with what the other detector finds in it, and return its page."""
    from edgel._report import Case, write_report  # not at the top: Matplotlib takes time to import

    name = name_of(source)
    find_other = edgel.detect if edges.method == options.PAPER else edgel.paper.detect
    try:
        other = find_other(cloud)
    except ValueError:  # what one detector can look at is too little for the other: nothing to compare
        other = None
    beside = {"the cloud": source, "what was written": output}
    beside = {what: path for what, path in beside.items() if path not in (None, files.PIPE)}
    with failing_as(ExitCode.OUTPUT, directory):
        case = Case(name, cloud, edges, other=other, files=beside)
        return write_report([case], directory, title=f"Edges of {name}")
