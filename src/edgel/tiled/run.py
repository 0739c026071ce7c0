"""All passes, one after the other."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from edgel._detect import DEFAULT_KINDS
from edgel._kinds import LIKELY
from edgel._neighbors.normals import OUTWARD
from edgel._neighbors.orientation import check_orient
from edgel.cloud import as_vector
from edgel.edges import EdgeKind, Edges, as_kinds
from edgel.io import WRITERS
from edgel.io.files import stem
from edgel.tiled.aside import clear_stale
from edgel.tiled.disk import check_before
from edgel.tiled.engine import Engine, start
from edgel.tiled.manifest import FILE, check_manifest
from edgel.tiled.output import edges_of, write_index, write_part
from edgel.tiled.passes import TileError, find_edges, raise_for, see_all
from edgel.tiled.plan import Options, Plan, cut, origin_left_out
from edgel.tiled.scans import load_scans
from edgel.tiled.spool import Part, Spool, spool

TILE_POINTS = 3_000_000


@dataclass(frozen=True, eq=False)
class Tiled:
    """What a run in tiles has left.

    Attributes
    ----------
    folder : Path
    outputs : sequence of str
        The file of each input's edge points, in the order of the inputs.
    num_points, num_edges, num_tiles : int
        Those of organized scans, which are in no tile, are among the points and edges.
    points_read : int
        Points read of the spool for classification, halos included.
    notices : sequence of str
        What its user should know.
    """

    folder: Path
    outputs: Sequence[str]
    num_points: int
    num_edges: int
    num_tiles: int
    points_read: int
    notices: Sequence[str]

    def edges(self, number: int) -> Edges:
        """Return the edge points of an input, by its number in the order given."""
        plan = Plan.read(self.folder / "work")
        return edges_of(plan, plan.spool.parts[number])


def detect(
    files: Sequence[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    *,
    tile_points: int = TILE_POINTS,
    workers: int = 1,
    scheduler: str | None = None,
    extension: str | None = None,
    overwrite: bool = False,
    kinds: EdgeKind | str | Iterable[str] = DEFAULT_KINDS,
    min_strength: float = LIKELY,
    num_neighbors: int = 16,
    viewpoint: Any = None,
    orient: str = "auto",
    progress: Callable[[str], None] | None = None,
) -> Tiled:
    """Find the edge points of a cloud that lies in several files, tile by tile.

    The answer is that of ``edgel.detect(points, method="surface")`` for all points together, to the bit on one kind of
    CPU, whatever the tiles. The same call again goes on where it stopped. Organized scans among the files, several of a
    PTX or E57 too, are no points of that cloud: each is seen from its own sensor, as by ``edgel.detect(scan)``.

    Parameters
    ----------
    files : sequence of path
        The parts of the cloud, all in one frame.
    folder : path
        Takes a file of edge points for each input, an index of them (``edges.vpc``), and what is needed to go on.
    tile_points : int
        Points of a tile, at most, without its halo: they decide the memory of a worker, 0.3 to 0.6 kB a point.
    workers : int
        Processes on this machine; more than one need Dask distributed.
    scheduler : str, optional
        Address of a Dask cluster whose workers see the same folder, such as ``"tcp://10.0.0.1:8786"``.
    extension : str, optional
        Of the files written, ``".laz"``; by default that of each input, ``".ply"`` where that is only read.
    overwrite : bool
        Whether results of other files or options in the folder are removed first.
    kinds, min_strength, num_neighbors, viewpoint, orient
        As in `edgel.detect`.
    progress : callable, optional
        Called with a line for people, pass by pass and tile by tile.

    Returns
    -------
    Tiled

    Raises
    ------
    FileNotFoundError, FormatError, ValueError
        If a file cannot be read, or lies in another frame (CRS) than the first; if the cloud is one that tiles cannot
        answer (shown best from a side, color edges, normals in some files alone and no viewpoint); if the
        folder holds results of something else; if the disk is too small. The message names the file and the remedy.
    TileError
        If a tile failed twice; the others are done, and the same call does what is missing.

    Examples
    --------
    >>> import tempfile, numpy as np, edgel, edgel.tiled
    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(60.0), np.arange(40.0)))
    >>> roof = np.c_[x, y, -abs(x - 30.2)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for name, part in (("west", roof[x < 25]), ("east", roof[x >= 25])):
    ...         edgel.write(f"{folder}/{name}.npy", edgel.Cloud(part))
    ...     found = edgel.tiled.detect([f"{folder}/west.npy", f"{folder}/east.npy"], f"{folder}/out")
    ...     len(edgel.read(f"{folder}/out/east.npy")) == len(found.edges(1)) > 0
    True
    """
    options = _options(kinds, min_strength, num_neighbors, viewpoint, orient, tile_points)
    paths, folder, say = [os.fspath(file) for file in files], Path(folder), progress or (lambda line: None)
    if not paths:
        raise ValueError("files: none were given; name at least one")
    if len({os.path.abspath(path) for path in paths}) < len(paths):
        raise ValueError("files: a file is named twice, and its points would be; name it once")
    outputs = _outputs(paths, folder, extension)
    if overwrite:
        shutil.rmtree(folder / "work", ignore_errors=True)
        (folder / FILE).unlink(missing_ok=True)
    work = folder / "work"
    work.mkdir(parents=True, exist_ok=True)
    notices = check_manifest(folder, paths, options)
    clear_stale(folder)
    check_before(paths, work)
    with start(workers, scheduler, say) as engine:
        plan = _prepare(engine, paths, work, options)
        if plan.tiles:
            find_edges(engine, plan)
        see_all(engine, plan, paths)
        jobs = [(work, number, output) for number, output in enumerate(outputs)]
        raise_for(engine.run("writing", write_part, jobs), "file", paths)
    write_index(folder / "edges.vpc", plan, outputs)
    points, edges, read = _count(plan)
    return Tiled(folder, outputs, points, edges, len(plan.tiles), read, notices + _of_scans(plan))


def _options(
    kinds: Any, min_strength: float, num_neighbors: int, viewpoint: Any, orient: str, tile_points: int
) -> Options:
    flags = as_kinds(kinds)
    if flags & (EdgeKind.COLOR | EdgeKind.FRAME):
        raise ValueError("kinds: color and frame edges are not looked for in tiles; leave them out")
    if not 0 < min_strength <= 1:
        raise ValueError(f"min_strength: expected a number above 0 and at most 1, got {min_strength}")
    if num_neighbors < 3:
        raise ValueError(f"num_neighbors: a plane needs at least 3, got {num_neighbors!r}")
    if tile_points < 1000:
        raise ValueError(f"tile_points: expected 1000 points or more, got {tile_points}")
    check_orient(orient, has_viewpoint=viewpoint is not None)
    place = None if viewpoint is None else tuple(as_vector(viewpoint, "viewpoint").tolist())
    return Options(int(flags), float(min_strength), int(num_neighbors), place, orient, int(tile_points))


def _outputs(paths: Sequence[str], folder: Path, extension: str | None) -> list[str]:
    """Name the output of each file by its own name; of files of one name by their numbers too."""
    stems, outputs = [stem(path) for path in paths], []
    for number, (path, own) in enumerate(zip(paths, stems, strict=True)):
        ending = extension or Path(path).name[len(own) :]
        ending = ending if Path(f"a{ending}").suffix.lower() in WRITERS else ".ply"  # what is read and never written
        outputs.append(str(folder / f"{own if stems.count(own) == 1 else f'{own}_{number}'}{ending}"))
    return outputs


def _prepare(engine: Engine, paths: Sequence[str], work: Path, options: Options) -> Plan:
    """Fill the spool, check that the files are one cloud, and cut it."""
    jobs = [(path, number, work / "spool") for number, path in enumerate(paths)]
    failed = engine.run("reading", spool, jobs)
    if failed:
        (number, error), *others = failed.items()
        more = f"; {', '.join(paths[n] for n, _ in others)} failed too" if others else ""
        what = str(error) if paths[number] in str(error) else f"{paths[number]}: {error}"
        if isinstance(error, OSError):
            raise TileError(f"{what}{more}; mend that, or free space on the disk of {work}, and go on") from error
        raise ValueError(
            f"{what}{more}; every file is needed for the answer: mend it, or leave it out; all others are read"
        ) from error
    parts = [spool(path, number, work / "spool") for number, path in enumerate(paths)]
    _check_parts(parts, options)
    some = any(part.num_points for part in parts)
    tiles = cut(Spool(work / "spool", parts, origin_left_out(parts)), options.tile_points) if some else []
    plan = Plan(work, options, tiles, len(parts))
    plan.save()
    return plan


def _check_parts(parts: Sequence[Part], options: Options) -> None:
    some = [part for part in parts if part.num_points]
    if sum(part.num_points for part in some) < 3 and (some or not any(part.num_scans for part in parts)):
        raise ValueError("files: needs at least 3 points with finite coordinates in all of them")
    for part in some:
        if part.crs != some[0].crs:
            raise ValueError(
                f"{part.path}: its CRS ({(part.crs or 'none')[:60]}) is not that of {some[0].path} "
                f"({(some[0].crs or 'none')[:60]}); transform it, or leave it out"
            )
        if part.normals != some[0].normals and options.viewpoint is None and options.orient != OUTWARD:
            has, lacks = (part, some[0]) if part.normals else (some[0], part)
            raise ValueError(
                f"{has.path}: has normals of its own (nx, ny, nz), which would tell the outside, and {lacks.path} has "
                "none; give a viewpoint, or leave them out"
            )


def _of_scans(plan: Plan) -> list[str]:
    return [
        f"{part.path}: {part.num_scans} organized scan{'s' * (part.num_scans > 1)}, each seen from its own sensor"
        for part in plan.spool.parts
        if part.num_scans
    ]


def _count(plan: Plan) -> tuple[int, int, int]:
    points, edges, read = plan.num_points, 0, 0
    for tile in range(len(plan.tiles)):
        with plan.load("label", tile) as found:
            edges += len(found["key"])
        with plan.load("classify", tile) as found:
            read += int(found["read"])
    for part in plan.spool.parts:
        for found in load_scans(plan, part):
            points, edges = points + int(found["points"]), edges + len(found["row"])
    return points, edges, read
