"""``edgel normals``: a normal for every point."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer

import edgel
from edgel._cli import files, options
from edgel._cli.compare import check_kept
from edgel._cli.errors import ExitCode, exit_codes, failing_as
from edgel._cli.output import count, print_line, print_table, renamed, seconds
from edgel._cli.progress import Watch
from edgel._columns import make_room, set_aside
from edgel._stages import Stages

HELP = """Estimate the normal of every point of a cloud.

The whole cloud is written with [bold]nx ny nz[/bold], unit normals, NaN where the neighbours span no plane, and
[bold]variation[/bold], the surface variation (0 on a plane, 1/3 at most: large at edges and in noise). The input's own
columns of these names are kept as input_nx and so on.

\b
Examples:
  edgel normals scan.ply -o normals.ply
  edgel normals scan.las -o normals.laz --num-neighbors 24 --viewpoint 637000 849000 2000
  cat scan.ply | edgel normals - -o - > normals.ply
"""

_COLUMNS = ("nx", "ny", "nz", "variation")


def normals(
    source: options.Input,
    output: Annotated[
        str, typer.Option("-o", "--output", metavar="OUT", help="The cloud to write; - writes PLY to stdout.")
    ],
    num_neighbors: Annotated[
        int | None,
        options.option(edgel.estimate_normals, "num_neighbors", "Neighbours of each plane fit, the point among them."),
    ] = None,
    viewpoint: options.Viewpoint = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    sample_mesh: options.SampleMesh = None,
    no_clobber: options.NoClobber = False,
    debug: options.Debug = False,
) -> None:
    """Estimate the normal of every point of a cloud."""
    given = options.given(num_neighbors=num_neighbors, viewpoint=viewpoint)
    with exit_codes(debug=debug):
        files.check_output(output, no_clobber=no_clobber)
        reading = files.Reading(intrinsics, columns, sample_mesh)
        in_place = files.check_in_place(output, source, reading)
        files.check_input(source, reading)
        with Watch() as watch:
            stages = Stages(watch)
            with stages("reading"):
                cloud = files.read_cloud(source, reading)
            with stages("normals"), failing_as(ExitCode.DATA, source, given):
                planes = edgel.estimate_normals(cloud, **given)
            with stages("writing"):
                values = (*planes.normals.astype(np.float32).T, planes.variation.astype(np.float32))
                written = make_room(cloud, _COLUMNS).with_attributes(**dict(zip(_COLUMNS, values, strict=True)))
                if in_place:
                    check_kept(output, cloud, written)
                files.write_cloud(output, written, no_clobber=no_clobber)
        files.tell_notices(source, cloud)
        rows: list[tuple[str, ...]] = [("points", count(len(cloud)))]
        not_finite = int(np.isnan(cloud.xyz.sum(axis=1) * 0).sum())
        if not_finite:
            rows.append(("not finite", count(not_finite), "without a normal"))
        if planes.num_undefined > not_finite:
            rows.append(("normals undefined", count(planes.num_undefined - not_finite), "the neighbours span no plane"))
        rows.append(("time", seconds(sum(stages.seconds.values()))))
        rows += [(f"  {name}", seconds(duration)) for name, duration in stages.seconds.items()]
        print_table(f"Normals of {source}", rows)
        if aside := set_aside(cloud.attributes, _COLUMNS):
            print_line(renamed(aside))
        print_line(f"{'stdout' if output == files.PIPE else output}: the whole cloud with nx, ny, nz and variation")
