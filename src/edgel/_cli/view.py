"""``edgel view``: look at clouds and their edges in the browser."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from edgel._cli import options
from edgel._cli.errors import ExitCode, Failure, exit_codes
from edgel._cli.output import print_line

HELP = """Look at clouds and their edges in the browser, and try what decides about them.

The page is on this machine alone. It shows each cloud with its edges on top, with sliders for the least strength, the
least angle and the scale, switches for the kinds, the published method beside, the numbers of any edge point, and what
to type to find the same edges again. Ctrl-C ends it.

\b
Examples:
  edgel view scan.ply
  edgel view before.laz after.laz
  edgel view depth.png --intrinsics camera.json
  edgel view scan.ply --no-browser --port 9000
"""

_LOCAL = ("127.0.0.1", "localhost", "::1")


def view(
    sources: Annotated[list[str], typer.Argument(metavar="FILE...", help="The clouds to show, side by side.")],
    intrinsics: options.Intrinsics = None,
    host: Annotated[
        str,
        typer.Option(metavar="ADDRESS", help="Address to listen at; any other than this one opens the page to others."),
    ] = _LOCAL[0],
    port: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65535,
            help="Port to listen at. [dim]\\[default: the first free one from 8080][/dim]",
            show_default=False,
        ),
    ] = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    debug: options.Debug = False,
) -> None:
    """Look at clouds and their edges in the browser."""
    with exit_codes(debug=debug):
        try:
            from edgel._viewer.server import serve  # not at the top: viser takes time to import
        except ImportError as error:
            remedy = "install it with: pip install edgel[view]"
            raise Failure(ExitCode.USAGE, f"the viewer needs viser, which is not there ({error}); {remedy}") from error
        if host not in _LOCAL:
            print_line(
                f"--host {host}: whoever learns the page's address can see the clouds and press every button",
                style="yellow",
            )
        try:
            serve(sources, host=host, port=port, intrinsics=intrinsics, open_browser=browser, ready=_tell)
        except OSError as error:
            where = f"{host}:{port}" if port else host
            remedy = "choose another --port, or leave it out" if port else "choose another --host, or leave it out"
            what = os.strerror(error.errno).lower() if error.errno else str(error)
            raise Failure(ExitCode.USAGE, f"cannot listen at {where} ({what}); {remedy}") from error


def _tell(url: str) -> None:
    print_line(f"{url}: the page; Ctrl-C ends it")
