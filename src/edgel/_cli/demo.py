"""``edgel demo``: the published experiment again, on this machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from rich.table import Table as RichTable

from edgel._cli import files, options
from edgel._cli.errors import ExitCode, exit_codes, failing_as
from edgel._cli.output import stdout_console
from edgel._cli.progress import Watch

if TYPE_CHECKING:
    from rich.console import Console

    from edgel._report import Table

HELP = """Repeat the published experiment: simulate a scanned tee and elbow, find their edges, time their normals.

The paper's Tables 1 and 2 are printed beside what this machine finds. Into the folder go a report with figures, to look
at in a browser, and the clouds and their edge points as PLY. It takes half a minute, the first time twice as
long, and needs Matplotlib (pip install 'edgel\\[plot]').

\b
Examples:
  edgel demo
  edgel demo -o fittings
  edgel demo --num-points 50000
"""


_FOLDER = "edgel-demo"


def demo(
    directory: Annotated[
        str,
        options.own(
            "-o",
            "--output",
            text="The folder to write into; made if it is not there.",
            group=options.OUTPUT,
            metavar="DIR",
            default=_FOLDER,
        ),
    ] = _FOLDER,
    num_points: Annotated[
        int | None,
        options.own(
            "--num-points",
            text="Points of each scan.",
            group="Scans",
            metavar="COUNT",
            default="as many as in the paper",
        ),
    ] = None,
    clobber: Annotated[
        bool,
        options.own(
            "--clobber/--no-clobber",
            text="Replace files that are there already, or none.",
            group=options.OUTPUT,
            default="clobber",
        ),
    ] = True,
    debug: options.Debug = False,
) -> None:
    """Repeat the published experiment."""
    with exit_codes(debug=debug):
        with Watch() as watch:
            watch("starting")
            from edgel._demo import file_names, run_demo  # not at the top: it takes time to import
            from edgel._report import check_drawing

            with failing_as(ExitCode.OUTPUT, "demo"):
                check_drawing()
            files.check_new_folder(directory, file_names(), inputs=(), no_clobber=not clobber)

            with failing_as(ExitCode.OUTPUT, directory, ["num_points"]):
                done = run_demo(directory, num_points=num_points, progress=watch)
        console = stdout_console()
        for table in done.tables:
            show(table, console)
        for finding in done.findings:
            console.print(bulleted(finding))
        console.print()
        console.print(f"{done.page}: the report, with {len(done.files) - 1} files beside it", soft_wrap=True)


def show(table: Table, console: Console) -> None:
    """Print a table of the library, with its title and note."""
    console.print(table.title, style="bold")
    grid = RichTable(box=None, pad_edge=False, header_style="dim")
    for name in table.columns:
        words = any(isinstance(row[name], str) for row in table.rows)
        grid.add_column(name, justify="left" if words else "right", vertical="bottom", no_wrap=words)
    for row in table.text():
        grid.add_row(*row.values())
    console.print(grid)
    if table.note:
        console.print(table.note, style="dim")
    console.print()


def bulleted(text: str) -> RichTable:
    """Set a sentence behind a dash, its further lines below its first word."""
    grid = RichTable.grid(padding=(0, 1))
    grid.add_row("-", text)
    return grid
