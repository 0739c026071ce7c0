"""The command line: ``edgel detect``, ``view``, ``render``, ``lines``, ``match``, ``normals`` and the others."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.exceptions import TyperException

import edgel
from edgel._cli import convert, demo, detect, info, lines, match, normals, render, view, warmup
from edgel._cli.help import Command, help_text, without_type
from edgel._cli.methods import MethodCommand
from edgel.io.errors import printable

_HELP = """Find the edges of 3D point clouds, and their normals, without tuning.

\b
Examples:
  edgel info scan.ply
  edgel detect scan.ply -o edges.ply
  edgel detect *.laz -o edges/
  edgel render scan.ply -o edges.png
  edgel lines scan.ply -o drawing.dxf
  edgel match scan.ply part.stl
  edgel view scan.ply
  edgel demo

Reads PLY, PCD, LAS/LAZ, E57, XYZ/TXT/CSV/ASC/PTS, PTX, NPY/NPZ, BIN (KITTI, nuScenes), OBJ of points, depth images
(PNG, TIFF, NPY), ROS recordings (MCAP, BAG, DB3), and samples meshes (PLY, OBJ, STL, OFF); writes PLY, PCD, LAS/LAZ,
E57, texts and NPY/NPZ.
"""
_EPILOG = (
    "Exit codes of every command: 0 done, 1 an error inside edgel, 2 wrong usage, 3 the input cannot be read, 4 its "
    "data cannot be processed, 5 the output cannot be written, 130 interrupted, 143 terminated; of several inputs that "
    "of the first that failed."
)


class Commands(TyperGroup):
    """The commands; wrong words, as of a shell that put a file's name in their place, are shown and not obeyed."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options before the command's name."""
        params = super().get_params(ctx)
        for param in params:
            without_type(param)
        return params

    def make_context(self, *args: Any, **extra: Any) -> Any:
        """Read the words before the command's name."""
        with _printable_errors():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: Any) -> Any:
        """Read the others, and run the command."""
        with _printable_errors():
            return super().invoke(ctx)


@contextmanager
def _printable_errors() -> Iterator[None]:
    try:
        yield
    except TyperException as error:
        error.message = printable(error.message)
        raise


app = typer.Typer(
    name="edgel",
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"edgel {edgel.__version__}")
        raise typer.Exit


@app.callback(help=help_text(_HELP), epilog=_EPILOG)
def main(
    _version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Find the edges of 3D point clouds."""


app.command(cls=MethodCommand, help=help_text(detect.HELP))(detect.detect)
app.command(cls=Command, help=help_text(view.HELP))(view.view)
app.command(cls=Command, help=help_text(normals.HELP))(normals.normals)
app.command(cls=Command, help=help_text(info.HELP))(info.info)
app.command(cls=Command, help=help_text(convert.HELP))(convert.convert)
app.command(cls=MethodCommand, help=help_text(render.HELP))(render.render)
app.command(cls=Command, help=help_text(lines.HELP))(lines.lines)
app.command(cls=Command, help=help_text(match.HELP))(match.match)
app.command(cls=Command, help=help_text(demo.HELP))(demo.demo)
app.command(cls=Command, help=help_text(warmup.HELP))(warmup.warmup)
