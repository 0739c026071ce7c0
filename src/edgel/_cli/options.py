"""Options of the commands, with the defaults of the functions they stand for."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer

import edgel
from edgel._cli.errors import as_option
from edgel._range_image import METHODS as OWN_METHODS
from edgel.edges import ASKABLE, EdgeKind, kind_names

PAPER = "paper"  # the method that is `edgel.paper.detect`
METHODS = (*OWN_METHODS, PAPER)

Input = Annotated[str, typer.Argument(metavar="IN", help="The cloud to read; - reads PLY from stdin.")]
Intrinsics = Annotated[
    str | None,
    typer.Option(metavar="FILE", help="Camera of a depth image: JSON or YAML with fx, fy, cx, cy.", show_default=False),
]
Columns = Annotated[
    str | None,
    typer.Option(
        metavar="NAMES",
        help="Names of the columns of a text or .bin, as in x,y,z,intensity; _ leaves one out."
        + " [dim]\\[default: what the file says][/dim]",
        show_default=False,
    ),
]
SampleMesh = Annotated[
    int | None,
    typer.Option(
        metavar="POINTS",
        help="Sample so many points from the surface of a mesh (PLY, OBJ, STL, OFF), evenly by area.",
        show_default=False,
    ),
]
Viewpoint = Annotated[
    tuple[float, float, float] | None,
    typer.Option(
        metavar="X Y Z",
        help="Where the sensor stood, in the cloud's unit: normals are turned towards it."
        + " [dim]\\[default: what the file says, else from above][/dim]",
        show_default=False,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object on stdout.")]
NoClobber = Annotated[bool, typer.Option("--no-clobber", help="Replace no file that is there already.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


def default_of(function: Callable[..., Any], name: str) -> Any:
    """Return the default of a function's parameter, so that it is written once, in the function.

    Examples
    --------
    >>> import edgel
    >>> default_of(edgel.paper.detect, "kernel_size")
    5
    """
    return inspect.signature(function).parameters[name].default


def option(
    function: Callable[..., Any], name: str, text: str, *, panel: str | None = None, metavar: str | None = None
) -> Any:
    """Make the option that stands for a function's parameter, its default shown but left to the function."""
    default = default_of(function, name)
    return typer.Option(
        as_option(name),
        metavar=metavar,
        help=text + default_note(_shown(default)),
        show_default=False,
        rich_help_panel=panel,
    )


def _shown(default: Any) -> str:
    if default is None:
        return "chosen from the data"
    if isinstance(default, EdgeKind):
        return ",".join(kind_names(default))
    return default if isinstance(default, str) else f"{default:g}"


def default_note(shown: str) -> str:
    """Return the end of an option's help, for a default that the function has and the option has not."""
    return f" [dim]\\[default: {shown}][/dim]"


def help_text(text: str) -> str:
    """Join the lines of each paragraph, which Typer would break where they end.

    Paragraphs that begin with a backspace stay as they are, which is Typer's own sign.
    """
    paragraphs = text.strip("\n").split("\n\n")
    return "\n\n".join(p if p.startswith("\b") else " ".join(p.split()) for p in paragraphs)


def paper_option(name: str, text: str) -> Any:
    """Make an option of the published method."""
    return option(edgel.paper.detect, name, text, panel=f"The published method (--method {PAPER})")


def given(**options: Any) -> dict[str, Any]:
    """Return the options that are not None; the others are left to the function.

    Examples
    --------
    >>> given(sigma=2.0, low=None)
    {'sigma': 2.0}
    """
    return {name: value for name, value in options.items() if value is not None}


Kinds = Annotated[
    str | None,
    option(
        edgel.detect,
        "kinds",
        f"Kinds of edge to look for, commas between: {', '.join(kind_names(ASKABLE))}.",
        metavar="NAMES",
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
