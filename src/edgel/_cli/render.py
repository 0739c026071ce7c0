"""``edgel render``: a picture of a cloud and its edges."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from edgel._cli import files, options
from edgel._cli.errors import ExitCode, Failure, exit_codes, failing_as
from edgel._cli.methods import arguments, check_options, find_edges
from edgel._cli.output import count, print_line, print_table, seconds
from edgel._cli.progress import Watch
from edgel._stages import Stages
from edgel.plot import picture, save
from edgel.plot.camera import DIRECTIONS
from edgel.plot.drawing import EDGE_COLORS
from edgel.plot.palette import THEMES
from edgel.plot.shading import COLOR_BY

HELP = """Draw a cloud and its edges, without browser or graphics card.

The surface is shaded by its slope, the edge points lie on top in the color of their kind, unless the cloud hides them.
Below stand the colors' meaning and a scale bar in the cloud's unit; in perspective it holds at the distance named.

\b
Examples:
  edgel render scan.ply -o picture.png
  edgel render scan.laz -o picture.png --direction top --color-by rgb --kinds crease
  edgel render depth.png --intrinsics camera.json -o picture.png --background dark --edge-color strength
  edgel render scan.ply -o picture.png --method paper --direction 1,0,-0.5 --size 1920x1080
"""


def render(
    source: options.Input,
    output: Annotated[str, typer.Option("-o", "--output", metavar="PNG", help="The picture to write.")],
    method: options.Method = options.METHOD,
    kinds: options.Kinds = None,
    min_strength: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Leave out edge points weaker than this, 0 to 1.")
    ] = None,
    direction: Annotated[
        str,
        typer.Option(
            metavar="|".join(DIRECTIONS) + "|X,Y,Z",
            help="Where to look from; a vector points away from the viewer. auto: from the sensor where it is known, "
            "else oblique.",
        ),
    ] = options.default_of(picture, "direction"),
    size: Annotated[str, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels of the picture.")] = "{}x{}".format(
        *options.default_of(picture, "size")
    ),
    color_by: Annotated[
        str, typer.Option(metavar="|".join(COLOR_BY), help="Color of the surface.")
    ] = options.default_of(picture, "color_by"),
    edge_color: Annotated[
        str, typer.Option(metavar="|".join(EDGE_COLORS), help="What the color of an edge point tells.")
    ] = options.default_of(picture, "edge_color"),
    background: Annotated[str, typer.Option(metavar="|".join(THEMES), help="What to draw on.")] = options.default_of(
        picture, "background"
    ),
    viewpoint: options.Viewpoint = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    no_clobber: options.NoClobber = False,
    debug: options.Debug = False,
) -> None:
    """Draw a cloud and its edges."""
    with exit_codes(debug=debug):
        given = check_options(method, options.given(kinds=kinds, viewpoint=viewpoint))
        look: dict[str, Any] = {"direction": _direction(direction), "size": _size(size)}
        look |= {"color_by": color_by, "edge_color": edge_color, "background": background}
        if min_strength is not None and not 0 <= min_strength <= 1:
            raise Failure(ExitCode.USAGE, f"--min-strength: expected 0 to 1, got {min_strength:g}")
        if min_strength is not None and "min_strength" in arguments(method):
            given["min_strength"] = min_strength
        files.check_extension(output, [".png"])
        files.check_file(output, no_clobber=no_clobber)
        files.check_not_input(output, [source, intrinsics])
        reading = files.Reading(intrinsics, columns, sample_mesh)
        files.check_input(source, reading)
        with Watch() as watch:
            stages = Stages(watch)
            cloud, edges = find_edges(source, reading, method, given, stages)
            if min_strength is not None:  # the published method does not leave any out itself
                edges = edges.take(edges.strength >= min_strength)
            with stages("drawing"), failing_as(ExitCode.DATA, source, look):
                drawn = picture(cloud, edges, **look)
            with stages("writing"), failing_as(ExitCode.OUTPUT, output):
                files.check_clobber(output, no_clobber=no_clobber)
                save(output, drawn)
        files.tell_notices(source, cloud)
        rows = [("points", count(edges.num_points)), ("edge points", count(len(edges)), f"{edges.share:.1%}")]
        rows += [(f"  {name}", count(number)) for name, number in edges.count_kinds().items()]
        rows.append(("time", seconds(sum(stages.seconds.values()))))
        rows += [(f"  {name}", seconds(duration)) for name, duration in stages.seconds.items()]
        print_table(f"Picture of {source}", rows)
        print_line(f"{output}: the picture, {drawn.shape[1]} x {drawn.shape[0]} pixels")


def _direction(text: str) -> str | tuple[float, ...]:
    """Read the name of a direction, or a vector."""
    if "," not in text:
        return text
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise Failure(ExitCode.USAGE, f"--direction: expected a name, or X,Y,Z as in 1,0,-0.5, got {text!r}") from None


def _size(text: str) -> tuple[int, int]:
    """Read a width and a height."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise Failure(ExitCode.USAGE, f"--size: expected WIDTHxHEIGHT as in 1200x900, got {text!r}")
    return int(width), int(height)
