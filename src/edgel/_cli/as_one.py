"""``edgel detect --as-one``: files that are parts of one cloud, in tiles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from edgel._cli import files, jobs, options
from edgel._cli.batch import Talk, run_jobs
from edgel._cli.errors import ExitCode, Failure, as_option, failing_as
from edgel._cli.jobs import Job
from edgel._cli.outcome import Told
from edgel._cli.output import count
from edgel.edges import as_kinds

GROUP = "One cloud in several files"
_ANSWERED = {
    "kinds",
    "min_strength",
    "num_neighbors",
    "viewpoint",
    "orient",
}  # options of `edgel.detect` that tiles know too

AsOne = Annotated[
    bool,
    options.own(
        "--as-one",
        text="The inputs are parts of one cloud of any size, which is cut into tiles: the answer is that of the whole "
        "by --method surface. -o names a folder; the same command again goes on where it stopped.",
        group=GROUP,
    ),
]
TilePoints = Annotated[
    float | None,
    options.own(
        "--tile-points",
        text="Points of a tile, at most: they decide how much memory a worker takes.",
        group=GROUP,
        metavar="COUNT",
        default="3e6",
    ),
]
Scheduler = Annotated[
    str | None,
    options.own(
        "--scheduler",
        text="Address of a Dask cluster that does the work, as in tcp://10.0.0.1:8786; without it --workers of this "
        "machine do.",
        group=GROUP,
        metavar="ADDRESS",
    ),
]
Overwrite = Annotated[
    bool,
    options.own(
        "--overwrite", text="Remove the results of other inputs or options from the folder first.", group=GROUP
    ),
]


@dataclass(frozen=True)
class Tiling:
    """The options of this group."""

    as_one: bool
    tile_points: float | None
    scheduler: str | None
    overwrite: bool

    def check_unused(self) -> None:
        """Raise a `Failure` for options of this group without ``--as-one``."""
        given = options.given(tile_points=self.tile_points, scheduler=self.scheduler)
        for name in [*given, *(["overwrite"] if self.overwrite else [])]:
            raise Failure(ExitCode.USAGE, f"{as_option(name)}: is for --as-one; add that, or leave it out")


def detect_as_one(
    words: Sequence[str],
    output: str | None,
    output_format: str | None,
    method: str,
    given: dict[str, Any],
    refused: dict[str, Any],
    tiling: Tiling,
    talk: Talk,
    workers: int,
) -> None:
    """Find the edges of one cloud in several files; `refused` are further options, of which none may be given."""
    for name, value in {**refused, **dict.fromkeys(given.keys() - _ANSWERED, 1)}.items():
        if value not in (None, False):
            raise Failure(ExitCode.USAGE, f"{as_option(name)}: is not for --as-one; leave one of them out")
    if method not in ("auto", "surface"):
        raise Failure(ExitCode.USAGE, f"--method: {method!r} looks at a whole cloud; --as-one looks at the surface")
    if output is None or output == files.PIPE:
        raise Failure(ExitCode.USAGE, "--as-one: needs a folder for its results; add -o DIR")
    sources = jobs.expand(words, files.Reading(None, None, None))
    if files.PIPE in sources:
        raise Failure(ExitCode.USAGE, "-: stdin is read once, and tiles read several times; name files instead")
    todo = [Job(f"{count(len(sources))} files as one" if len(sources) > 1 else sources[0], output)]
    work = partial(_detect, sources, options.extension(output_format), given, tiling, max(workers, 1))
    run_jobs(todo, work, talk)


def _detect(
    sources: Sequence[str],
    extension: str | None,
    given: dict[str, Any],
    tiling: Tiling,
    workers: int,
    job: Job,
    progress: Callable[[str], None],
) -> Told:
    from edgel import tiled  # compiles what few need

    wanted: dict[str, Any] = {name: as_kinds(value) if name == "kinds" else value for name, value in given.items()}
    if tiling.tile_points is not None:
        wanted["tile_points"] = int(tiling.tile_points)
    with failing_as(ExitCode.DATA, job.name, {*wanted, "workers"}):
        found = tiled.detect(
            sources,
            str(job.output),
            workers=workers,
            scheduler=tiling.scheduler,
            extension=extension,
            overwrite=tiling.overwrite,
            progress=progress,
            **wanted,
        )
    facts = {
        "inputs": list(sources),
        "outputs": list(found.outputs),
        "num_points": found.num_points,
        "num_edges": found.num_edges,
        "num_tiles": found.num_tiles,
        "notices": list(found.notices),
    }
    rows = [
        ("points", count(found.num_points)),
        ("edge points", f"{count(found.num_edges)} ({found.num_edges / found.num_points:.1%})"),
        ("tiles", count(found.num_tiles)),
    ]
    written = [f"{job.output}: the edge points of each input, and edges.vpc, an index of them"]
    return Told(facts, f"Edges of {job.name}", rows, remarks=[(n, "yellow") for n in found.notices], written=written)
