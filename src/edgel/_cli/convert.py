"""``edgel convert``: from any format to any other."""

from __future__ import annotations

from typing import Annotated

import typer

from edgel._cli import files, options
from edgel._cli.compare import check_kept, differences, read_back
from edgel._cli.errors import exit_codes
from edgel._cli.output import count, print_line
from edgel._cli.progress import Watch

HELP = """Convert a cloud from any format to any other, with all it carries.

What the other format has no place for is said: the file is read back and compared. The input itself is replaced only by
a file that keeps all of it.

\b
Examples:
  edgel convert scan.e57 scan.ply
  edgel convert scan.las scan.pcd
  edgel convert depth.png cloud.ply --intrinsics camera.json
  edgel convert scan.pcd - | edgel detect - -o edges.ply
"""


def convert(
    source: options.Input,
    output: Annotated[str, typer.Argument(metavar="OUT", help="The cloud to write; - writes PLY to stdout.")],
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    check: Annotated[bool, typer.Option("--check/--no-check", help="Read the file back and compare.")] = True,
    no_clobber: options.NoClobber = False,
    debug: options.Debug = False,
) -> None:
    """Convert a cloud from any format to any other."""
    with exit_codes(debug=debug):
        files.check_output(output, no_clobber=no_clobber)
        reading = files.Reading(intrinsics, columns, sample_mesh)
        in_place = files.check_in_place(output, source, reading)
        files.check_input(source, reading)
        with Watch() as watch:
            watch("reading")
            cloud = files.read_cloud(source, reading)
            watch("writing")
            if in_place:
                check_kept(output, cloud, cloud)
            files.write_cloud(output, cloud, no_clobber=no_clobber)
            lost: list[str] = []
            if check:
                watch("comparing")
                lost = differences(cloud, read_back(output, cloud))
        files.tell_notices(source, cloud)
        if lost:
            print_line(f"{output}: the format could not keep all", style="yellow")
        for line in lost:
            print_line(f"  {line}")
        names = ", ".join(("x y z", *cloud.attributes))
        print_line(f"{'stdout' if output == files.PIPE else output}: {count(len(cloud))} points ({names})")
