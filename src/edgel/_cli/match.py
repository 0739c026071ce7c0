"""``edgel match``: where a part, or another scan, lies in a scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from edgel._cli import files, jobs, options
from edgel._cli.batch import Talk, run_jobs
from edgel._cli.errors import ExitCode, Failure, exit_codes, failing_as
from edgel._cli.jobs import Job
from edgel._cli.outcome import Told, cautions, notices
from edgel._cli.output import count, length, time_rows
from edgel._neighbors.spacing import median_spacing
from edgel._objects import NORMALS
from edgel._stages import Stages
from edgel.cloud import Cloud
from edgel.io import READERS
from edgel.matching import FILES, SURE, Model, Registration, register
from edgel.plot import picture, save

HELP = """Find where a part lies in a scan, or one scan in another.

The part is a mesh (STL, PLY, OBJ, OFF), a STEP file, or a cloud; both in the same unit, or see --scale. All poses are
looked for, and what edges and surface do not confirm is not found (exit code 4). The margin says how far the answer is
ahead of the next.

\b
Examples:
  edgel match scan.ply part.stl
  edgel match scan.ply part.stl -o aligned.ply --picture match.png
  edgel match scan.ply other.laz --json
"""

_GROUP = "Match"
_LIFT = 1.0  # spacings of the scan
_COLORS = ((128, 136, 150), (235, 110, 20))  # of the scan and of what lies in it


def match(
    source: Annotated[str, typer.Argument(metavar="SCAN", help="The cloud in which to look; - reads PLY from stdin.")],
    part: Annotated[str, typer.Argument(metavar="PART", help="What to look for: a mesh, a STEP file, or a cloud.")],
    output: Annotated[str | None, options.output("The part in place, as points, in the scan's frame.")] = None,
    drawing: Annotated[
        str | None,
        options.own("--picture", text="Draw the scan and the part in place.", group=options.OUTPUT, metavar="PNG"),
    ] = None,
    most: Annotated[
        int,
        options.own("--most", text="Instances of the part to look for.", group=_GROUP, metavar="COUNT", default="1"),
    ] = 1,
    scale: Annotated[
        float,
        options.own(
            "--scale",
            text="Lengths of the part are multiplied by this: 0.001 takes millimetres to a scan in metres.",
            group=_GROUP,
            metavar="FACTOR",
            default="1",
        ),
    ] = 1.0,
    viewpoint: options.Viewpoint = None,
    intrinsics: options.Intrinsics = None,
    columns: options.Columns = None,
    clobber: options.Clobber = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Find where a part lies in a scan."""
    with exit_codes(as_json=as_json, debug=debug):
        if not 0 < scale < np.inf:
            raise Failure(ExitCode.USAGE, f"--scale: expected a number above 0, got {scale:g}")
        if most < 1:
            raise Failure(ExitCode.USAGE, f"--most: expected 1 or more, got {most}")
        if Path(source).suffix.lower() in FILES and Path(source).suffix.lower() not in READERS:
            raise Failure(ExitCode.USAGE, f"{source}: is no scan but a part; the scan comes first, then the part")
        reading = files.Reading(intrinsics, columns)
        files.check_input(part, files.Reading())
        with failing_as(ExitCode.INPUT, part):
            is_model = _is_model(part)
        wanted = _Wanted(reading, part, is_model, drawing, most, scale, viewpoint)
        if not is_model and (most > 1 or scale != 1):
            raise Failure(ExitCode.USAGE, f"{part}: --most and --scale are for meshes and STEP files; this is a cloud")
        todo = jobs.plan([source], reading, output=output, clobber=clobber)
        if len(todo) > 1:
            raise Failure(ExitCode.USAGE, f"{source}: is a folder; name one scan")
        run_jobs(todo, partial(_match, wanted), Talk("match", as_json, quiet, debug))


@dataclass(frozen=True)
class _Wanted:
    """What is asked for."""

    reading: files.Reading
    part: str
    is_model: bool
    drawing: str | None
    most: int
    scale: float
    viewpoint: tuple[float, float, float] | None


def _match(wanted: _Wanted, job: Job, progress: Callable[[str], None]) -> Told:
    jobs.check_job(job, wanted.reading, "the part in place")
    if job.output is not None:
        files.check_not_input(job.output, [wanted.part])
    if wanted.drawing is not None:
        files.check_not_input(wanted.drawing, [job.source, wanted.part, wanted.reading.intrinsics])
        files.check_extension(wanted.drawing, [".png"])
        files.check_file(wanted.drawing, no_clobber=job.no_clobber)
    stages = Stages(progress)
    with stages("reading"):
        scan = files.read_cloud(job.source, wanted.reading)
        scan = scan if wanted.viewpoint is None else replace(scan, viewpoint=np.array(wanted.viewpoint))
        with failing_as(ExitCode.INPUT, wanted.part):
            part = Model(wanted.part, scale=wanted.scale) if wanted.is_model else files.read_cloud(wanted.part)
    with stages("matching"), failing_as(ExitCode.DATA, job.source):
        found = part.find(scan, most=wanted.most) if isinstance(part, Model) else [register(part, scan)]
    if not found or not found[0].found:
        why = found[0].reason if found else "nothing in it is confirmed by its edges and surface"
        raise Failure(ExitCode.DATA, f"{wanted.part}: not found in {job.name}: {why}")
    placed = _placed(part, found)
    with stages("writing"), failing_as(ExitCode.OUTPUT, wanted.drawing or job.target):
        lost = jobs.write(job, placed)
        if wanted.drawing is not None:
            save(wanted.drawing, picture(_together(scan, _drawn(part, found, scan)), color_by="rgb"))
    facts = {"input": job.source, "part": wanted.part, "output": job.output, "picture": wanted.drawing}
    facts |= {"notices": notices(scan), "found": [_facts(one) for one in found], "seconds": stages.seconds}
    written = [f"{job.target}: the part in place, {count(len(placed))} points"] if job.output else []
    written += [f"{wanted.drawing}: the scan and, in orange, what lies in it"] if wanted.drawing else []
    return Told(
        facts,
        title=f"{Path(wanted.part).name} in {job.name}",
        rows=[*(row for one in found for row in _rows(one)), *time_rows(stages.seconds)],
        headline=f"{job.name}: found",
        remarks=[*cautions(job, scan, lost), *_doubts(found)],
        written=written,
    )


def _is_model(part: str) -> bool:
    """Whether a file is a mesh or STEP, not a cloud; PLY and OBJ may be either."""
    if Path(part).suffix.lower() in (".ply", ".obj"):
        from edgel.io.mesh import has_faces

        return has_faces(part)
    return Path(part).suffix.lower() in FILES


def _placed(part: Model | Cloud, found: list[Registration]) -> Cloud:
    """Return the points of a part, moved to where it was found, once for each instance."""
    return _moved(part.to_cloud() if isinstance(part, Model) else part, found)


def _drawn(part: Model | Cloud, found: list[Registration], scan: Cloud) -> Cloud:
    """Return what a picture shows of a part in place: the creases of a model, a little above the scan, or the cloud."""
    return _moved(Cloud(part.creases(_LIFT * median_spacing(scan))) if isinstance(part, Model) else part, found)


def _moved(cloud: Cloud, found: list[Registration]) -> Cloud:
    """Move points, and their normals, to where they were found, once for each instance."""
    cloud = replace(cloud, shape=None, viewpoint=None)
    normals = all(name in cloud.attributes for name in NORMALS)
    clouds = []
    for one in found:
        rotation, shift = one.T_target_source[:3, :3], one.T_target_source[:3, 3]
        moved = replace(cloud, xyz=cloud.xyz @ rotation.T + shift)
        if normals:
            turned = np.stack([cloud.attributes[name] for name in NORMALS], axis=1) @ rotation.T
            moved = moved.with_attributes(**{name: turned[:, i].astype(np.float32) for i, name in enumerate(NORMALS)})
        clouds.append(moved)
    attributes = {name: np.concatenate([c.attributes[name] for c in clouds]) for name in cloud.attributes}
    return Cloud(np.concatenate([c.xyz for c in clouds]), attributes)


def _together(scan: Cloud, placed: Cloud) -> Cloud:
    """Put the scan and what lies in it into one cloud, each in its color."""
    colors = np.repeat(np.array(_COLORS, np.uint8), [len(scan), len(placed)], axis=0)
    names: dict[str, Any] = dict(zip(("red", "green", "blue"), colors.T, strict=True))
    return Cloud(np.concatenate([scan.xyz, placed.xyz]), names, viewpoint=scan.viewpoint)


def _facts(one: Registration) -> dict[str, Any]:
    return {
        "T_target_source": one.T_target_source.tolist(),
        "fitness": one.fitness,
        "edge_fitness": one.edge_fitness,
        "rmse": one.rmse,
        "margin": one.margin,
        "symmetries": len(one.symmetries),
        "free_directions": one.free_directions.tolist(),
        "position_std": one.position_std,
        "method": one.method,
    }


def _rows(one: Registration) -> list[tuple[str, ...]]:
    x, y, z = one.T_target_source[:3, 3]
    return [
        ("shift", f"{x:.6g} {y:.6g} {z:.6g}", f"of the part's origin; its middle to {length(one.position_std)}"),
        ("  surface found", f"{one.fitness:.0%}", "of what is not hidden"),
        ("  edges found", f"{one.edge_fitness:.0%}", ""),
        ("  distance", length(one.rmse), "of the surfaces, root mean square"),
        ("  margin", f"{one.margin:.0%}", "ahead of the next pose"),
    ]


def _doubts(found: list[Registration]) -> list[tuple[str, str]]:
    """Say what a user should know before relying on an answer."""
    lines = []
    if any(one.margin < SURE for one in found):
        lines.append("another pose is confirmed nearly as well: look at the picture, or give a scan that shows more")
    if any(len(one.free_directions) for one in found):
        lines.append("what the scan shows leaves the pose open along a direction (free_directions)")
    return [(line, "yellow") for line in lines]
