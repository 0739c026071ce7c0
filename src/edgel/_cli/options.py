"""Options of the commands, with the defaults of the functions they stand for, in the groups that help shows."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer

import edgel
from edgel._cli.errors import ExitCode, Failure, as_option
from edgel._cli.help import MESSAGES, default_note
from edgel._neighbors.orientation import ORIENTS
from edgel._range_image import METHODS as OWN_METHODS
from edgel.edges import ASKABLE, EdgeKind, kind_names

PAPER = "paper"  # the method that is `edgel.paper.detect`
METHODS = (*OWN_METHODS, PAPER)

INPUT, EDGES, OUTPUT = "Input", "Edges", "Output"
"""Groups of options."""


def default_of(function: Callable[..., Any], name: str) -> Any:
    """Return the default of a function's parameter, so that it is written once, in the function.

    Examples
    --------
    >>> import edgel
    >>> default_of(edgel.paper.detect, "kernel_size")
    5
    """
    return inspect.signature(function).parameters[name].default


def own(*names: str, text: str, group: str, metavar: str = "", default: str | None = None, **more: Any) -> Any:
    """Make an option of the command line itself; those without a metavar are flags."""
    return typer.Option(
        *names,
        metavar=metavar,
        help=text + ("" if default is None else default_note(default)),
        show_default=False,
        rich_help_panel=group,
        **more,
    )


def option(function: Callable[..., Any], name: str, text: str, *, metavar: str, group: str = EDGES) -> Any:
    """Make the option that stands for a function's parameter, its default shown but left to the function."""
    default = _shown(default_of(function, name))
    return own(as_option(name), text=text, group=group, metavar=metavar, default=default)


def output(text: str, metavar: str = "OUT") -> Any:
    """Make the option that names what is written."""
    return own("-o", "--output", text=text, group=OUTPUT, metavar=metavar)


def _shown(default: Any) -> str:
    if default is None:
        return "chosen from the data"
    if isinstance(default, EdgeKind):
        return ", ".join(kind_names(default))  # with blanks, where lines may break
    return default if isinstance(default, str) else f"{default:g}"


def paper_option(name: str, text: str, metavar: str) -> Any:
    """Make an option of the published method."""
    group = f"The published method (--method {PAPER})"
    return option(edgel.paper.detect, name, text, metavar=metavar, group=group)


def given(**options: Any) -> dict[str, Any]:
    """Return the options that are not None; the others are left to the function.

    Examples
    --------
    >>> given(sigma=2.0, low=None)
    {'sigma': 2.0}
    """
    return {name: value for name, value in options.items() if value is not None}


def extension(text: str | None) -> str | None:
    """Return the extension that ``--format`` names, with its dot, or raise a `Failure`."""
    from edgel.io import WRITERS
    from edgel.io.files import COPC

    if text is None:
        return None
    wanted, known = "." + text.lower().removeprefix("."), (*WRITERS, COPC)
    if wanted not in known:
        names = " ".join(name.removeprefix(".") for name in known)
        raise Failure(ExitCode.USAGE, f"--format: {text!r} is no format that edgel writes; known: {names}")
    return wanted


Inputs = Annotated[
    list[str],
    typer.Argument(
        metavar="IN", help="Clouds to read, and folders of them, each a cloud of its own; - reads PLY from stdin."
    ),
]
Intrinsics = Annotated[
    str | None,
    own("--intrinsics", text="Camera of depth images: JSON or YAML with fx, fy, cx, cy.", group=INPUT, metavar="FILE"),
]
Columns = Annotated[
    str | None,
    own(
        "--columns",
        text="Names of the columns of texts and .bin, as in x,y,z,intensity; _ leaves one out.",
        group=INPUT,
        metavar="NAMES",
        default="what the file says",
    ),
]
SampleMesh = Annotated[
    int | None,
    own(
        "--sample-mesh",
        text="Sample so many points from the surface of meshes (PLY, OBJ, STL, OFF), evenly by area.",
        group=INPUT,
        metavar="POINTS",
    ),
]
Where = Annotated[
    str | None,
    own(
        "--where",
        text="Look only at the points for which this holds, as in 'classification == 6' or '0 < z < 2 and not "
        "intensity in (0, 255)': columns and x y z, numbers, 'texts'.",
        group=INPUT,
        metavar="TEST",
    ),
]
Viewpoint = Annotated[
    tuple[float, float, float] | None,
    own(
        "--viewpoint",
        text="Where the sensor stood, in the cloud's unit: normals are turned towards it.",
        group=INPUT,
        metavar="X Y Z",
        default="what the file says, else from above",
    ),
]
Kinds = Annotated[
    str | None,
    option(
        edgel.detect,
        "kinds",
        f"Kinds of edge to look for, commas between: {', '.join(kind_names(ASKABLE))}.",
        metavar="NAMES",
    ),
]
Orient = Annotated[
    str | None,
    option(
        edgel.detect,
        "orient",
        f"The outside, to which normals are turned: {', '.join(ORIENTS)}. Auto: the side of the sensor, or of the "
        "file's own nx ny nz, else nobody knows; outward: out of what a closed surface holds.",
        metavar="NAME",
    ),
]
METHOD = default_of(edgel.detect, "method")
Method = Annotated[
    str,
    option(
        edgel.detect,
        "method",
        f"How to look at the cloud: {', '.join(METHODS[:-1])} or {METHODS[-1]}. Surface takes any cloud, from any "
        "side; organized goes along its rows and columns; orthographic, pinhole and spherical look at a projection; "
        "auto chooses among these. Paper is the published method, which looks along Z.",
        metavar="NAME",
    ),
]
Format = Annotated[
    str | None,
    own(
        "--format",
        text="Format of outputs in a folder: ply, laz, xyz ...",
        group=OUTPUT,
        metavar="NAME",
        default="that of the input, else ply",
    ),
]
Clobber = Annotated[
    bool | None,
    own(
        "--clobber/--no-clobber",
        text="Replace files that are there already, or none.",
        group=OUTPUT,
        default="one that you name, none in a folder",
    ),
]
AsJson = Annotated[
    bool, own("--json", text="Print what was found as JSON on stdout, a line for each input.", group=OUTPUT)
]
Workers = Annotated[
    int,
    own(
        "--workers",
        text="Inputs to do at the same time; one by one already uses every core.",
        group=MESSAGES,
        metavar="COUNT",
        default="1",
    ),
]
Quiet = Annotated[bool, own("-q", "--quiet", text="Print errors only.", group=MESSAGES)]
Debug = Annotated[bool, own("--debug", text="Show the traceback of an error.", group=MESSAGES)]
