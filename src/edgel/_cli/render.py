"""``edgel render``: a picture of a cloud and its edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from edgel._cli import files, jobs, options
from edgel._cli.batch import Talk, run_jobs
from edgel._cli.errors import ExitCode, Failure, as_option, exit_codes, failing_as
from edgel._cli.jobs import Job
from edgel._cli.methods import arguments, check_options, find_edges
from edgel._cli.outcome import Told, cautions, notices
from edgel._cli.output import count, time_rows
from edgel._cli.summary import collect, headline
from edgel._cli.where import Where
from edgel._stages import Stages
from edgel.plot import picture, save
from edgel.plot.camera import DIRECTIONS
from edgel.plot.drawing import EDGE_COLORS
from edgel.plot.palette import THEMES
from edgel.plot.shading import COLOR_BY

HELP = """Draw clouds and their edges, without browser or graphics card.

The surface is shaded by its slope, the edge points lie on top in the color of their kind, unless the cloud hides them.
Below stand the colors' meaning and a scale bar in the cloud's unit; in perspective it holds at the distance named.

\b
Examples:
  edgel render scan.ply -o picture.png
  edgel render scan.laz -o picture.png --direction top --kinds crease
  edgel render scan.laz -o picture.png --color-by rgb --background dark
  edgel render scan.ply -o picture.png --direction 1,0,-0.5 --size 1920x1080
  edgel render depth.png --intrinsics camera.json -o picture.png
  edgel render *.laz -o pictures/
"""

_SIZE = options.default_of(picture, "size")


def _look(name: str, text: str, metavar: str, default: str | None = None) -> Any:
    """Make an option that says how the picture looks."""
    shown = default or str(options.default_of(picture, name))
    return options.own(as_option(name), text=text, group="Picture", metavar=metavar, default=shown)


def render(
    sources: options.Inputs,
    output: Annotated[str, options.output("The picture to write, or a folder for one of each input.", "PNG")],
    method: options.Method = options.METHOD,
    kinds: options.Kinds = None,
    min_strength: Annotated[
        float | None,
        options.own(
            "--min-strength",
            text="Leave out edge points weaker than this, 0 to 1.",
            group=options.EDGES,
            metavar="SHARE",
            default="0.5, none with --method paper",
        ),
    ] = None,
    where: options.Where = None,
    viewpoint: options.Viewpoint = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    topic: options.Topic = None,
    direction: Annotated[
        str,
        _look(
            "direction",
            f"Where to look from: {', '.join(DIRECTIONS)}, or a vector X,Y,Z that points away from the viewer. auto: "
            "from the sensor where it is known, else oblique.",
            "NAME",
        ),
    ] = options.default_of(picture, "direction"),
    size: Annotated[
        str, _look("size", "Pixels of the picture, as in {}x{}.".format(*_SIZE), "WxH", "{}x{}".format(*_SIZE))
    ] = "{}x{}".format(*_SIZE),
    color_by: Annotated[
        str, _look("color_by", f"Color of the surface: {', '.join(COLOR_BY)}.", "NAME")
    ] = options.default_of(picture, "color_by"),
    edge_color: Annotated[
        str, _look("edge_color", f"What the color of an edge point tells: {', '.join(EDGE_COLORS)}.", "NAME")
    ] = options.default_of(picture, "edge_color"),
    background: Annotated[
        str, _look("background", f"What to draw on: {', '.join(THEMES)}.", "NAME")
    ] = options.default_of(picture, "background"),
    clobber: options.Clobber = None,
    as_json: options.AsJson = False,
    workers: options.Workers = 1,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Draw clouds and their edges."""
    with exit_codes(as_json=as_json, debug=debug):
        given = check_options(method, options.given(kinds=kinds, viewpoint=viewpoint))
        look: dict[str, Any] = {"direction": _direction(direction), "size": _pixels(size)}
        look |= {"color_by": color_by, "edge_color": edge_color, "background": background}
        if min_strength is not None and not 0 <= min_strength <= 1:
            raise Failure(ExitCode.USAGE, f"--min-strength: expected 0 to 1, got {min_strength:g}")
        if min_strength is not None and "min_strength" in arguments(method):
            given["min_strength"] = min_strength
        condition = None if where is None else Where(where)
        reading = files.Reading(intrinsics, columns, sample_mesh, topic)
        wanted = _Wanted(reading, condition, method, given, min_strength, look)
        todo = jobs.plan(sources, reading, output=output, known=[".png"], clobber=clobber)
        run_jobs(todo, partial(_draw, wanted), Talk("render", as_json, quiet, debug), workers=workers)


@dataclass(frozen=True)
class _Wanted:
    """What is asked for of each picture."""

    reading: files.Reading
    where: Where | None
    method: str
    given: dict[str, Any]
    min_strength: float | None
    look: dict[str, Any]


def _draw(wanted: _Wanted, job: Job, progress: Callable[[str], None]) -> Told:
    output = str(job.output)
    files.check_extension(output, [".png"])
    files.check_file(output, no_clobber=job.no_clobber, among=job.among)
    files.check_not_input(output, [job.source, wanted.reading.intrinsics])
    files.check_input(job.source, wanted.reading)
    stages = Stages(progress)
    found = find_edges(job.source, wanted.reading, wanted.where, wanted.method, wanted.given, stages)
    edges = found.edges
    if wanted.min_strength is not None:  # the published method does not leave any out itself
        edges = edges.take(edges.strength >= wanted.min_strength)
    with stages("drawing"), failing_as(ExitCode.DATA, job.source, wanted.look):
        drawn = picture(found.seen, edges, **wanted.look)
    with stages("writing"), failing_as(ExitCode.OUTPUT, output):
        jobs.make_folder(job)
        files.check_clobber(output, no_clobber=job.no_clobber)
        save(output, drawn)
    rows: list[tuple[str, ...]] = [("points", count(edges.num_points))]
    if found.not_selected:
        rows.append(("left out", count(found.not_selected), "by --where"))
    rows.append(("edge points", count(len(edges)), f"{edges.share:.1%}"))
    rows += [(f"  {name}", count(number)) for name, number in edges.count_kinds().items()]
    facts = {"input": job.source, "output": output, "width": drawn.shape[1], "height": drawn.shape[0]}
    facts |= {"notices": notices(found.cloud)}
    return Told(
        facts | collect(edges, found.not_selected, stages.seconds),
        title=f"Picture of {job.name}",
        rows=[*rows, *time_rows(stages.seconds)],
        remarks=cautions(job, found.cloud, {}),
        headline=f"{job.name}: {headline(edges)} -> {output}",
        written=[f"{output}: the picture, {drawn.shape[1]} x {drawn.shape[0]} pixels"],
    )


def _direction(text: str) -> str | tuple[float, ...]:
    """Read the name of a direction, or a vector."""
    if "," not in text:
        return text
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise Failure(ExitCode.USAGE, f"--direction: expected a name, or X,Y,Z as in 1,0,-0.5, got {text!r}") from None


def _pixels(text: str) -> tuple[int, int]:
    """Read a width and a height."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise Failure(ExitCode.USAGE, f"--size: expected WIDTHxHEIGHT as in 1200x900, got {text!r}")
    return int(width), int(height)
