"""``edgel view``: look at clouds and their edges in the browser."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from edgel._cli import files, options
from edgel._cli.errors import ExitCode, Failure, exit_codes
from edgel._cli.jobs import expand
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
    sources: Annotated[
        list[str], typer.Argument(metavar="IN", help="The clouds to show, side by side, and folders of them.")
    ],
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    topic: options.Topic = None,
    host: Annotated[
        str,
        options.own(
            "--host",
            text="Address to listen at; any other than this one opens the page to others.",
            group="Page",
            metavar="ADDRESS",
            default=_LOCAL[0],
        ),
    ] = _LOCAL[0],
    port: Annotated[
        int | None,
        options.own(
            "--port",
            text="Port to listen at, 1 to 65535.",
            group="Page",
            metavar="PORT",
            default="the first free one from 8080",
        ),
    ] = None,
    browser: Annotated[
        bool,
        options.own("--browser/--no-browser", text="Open the page in the browser.", group="Page", default="browser"),
    ] = True,
    debug: options.Debug = False,
) -> None:
    """Look at clouds and their edges in the browser."""
    with exit_codes(debug=debug):
        try:
            from edgel._viewer.server import serve  # not at the top: viser takes time to import
        except ImportError as error:
            remedy = "install it with: pip install 'edgel[view]'"
            raise Failure(ExitCode.USAGE, f"the viewer needs viser, which is not there ({error}); {remedy}") from error
        if port is not None and not 0 < port < 65536:
            raise Failure(ExitCode.USAGE, f"--port: expected 1 to 65535, got {port}")
        reading = files.Reading(intrinsics, columns, sample_mesh, topic)
        clouds = expand(sources, reading)
        if host not in _LOCAL:
            print_line(
                f"--host {host}: whoever learns the page's address can see the clouds and press every button",
                style="yellow",
            )
        try:
            serve(clouds, host=host, port=port, reading=reading.given, open_browser=browser, ready=_tell)
        except OSError as error:
            where = f"{host}:{port}" if port else host
            remedy = "choose another --port, or leave it out" if port else "choose another --host, or leave it out"
            what = os.strerror(error.errno).lower() if error.errno else str(error)
            raise Failure(ExitCode.USAGE, f"cannot listen at {where} ({what}); {remedy}") from error


def _tell(url: str) -> None:
    print_line(f"{url}: the page; Ctrl-C ends it")
