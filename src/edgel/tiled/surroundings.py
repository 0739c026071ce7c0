"""The edge points of a run, and the points of the cloud around them: what curves of a whole survey are made of."""

from __future__ import annotations

import json
import os
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.spacing import DISC
from edgel.cloud import Cloud, check_points
from edgel.edges import Edges
from edgel.io import read
from edgel.tiled.manifest import FILE
from edgel.tiled.output import edges_of
from edgel.tiled.plan import Plan

_REACH = 10.0  # spacings: `edgel.curves.trace` looks at nothing farther from an edge point, but along arcs that grow


def is_run(folder: str | os.PathLike[str]) -> bool:
    """Whether a folder holds what `edgel.tiled.detect` leaves."""
    try:
        stored = json.loads((Path(folder) / FILE).read_text())
    except (OSError, ValueError):
        return False
    return isinstance(stored, dict) and {"version", "options", "inputs", "cpus"} <= stored.keys()


def surroundings(folder: str | os.PathLike[str]) -> tuple[Cloud, Edges]:
    """Return all edge points of a run as those of one cloud, and that cloud: the points within 10 spacings of them.

    Files are read one at a time, twice. Curves of both have no seam: tiles and files are put together before. Arcs that
    would grow beyond their edge points grow only as far as these points go.

    Parameters
    ----------
    folder : path
        That `edgel.tiled.detect` wrote into, with its folder ``work``.

    Raises
    ------
    FileNotFoundError
        If the state of the run is gone.
    ValueError
        If no file has any point left.
    """
    work = Path(folder) / "work"
    if not (work / "plan.json").is_file():
        raise FileNotFoundError(f"{folder}: the state of the run is gone ({work}); run edgel detect --as-one again")
    plan = Plan.read(work)
    parts = [part for part in plan.spool.parts if part.num_points or part.num_scans]
    found = [edges_of(plan, part) for part in parts]
    if not found:
        raise ValueError(f"{folder}: has no points; run edgel detect --as-one on other files")
    spacing = np.concatenate([_spacing(part.path, edges) for part, edges in zip(parts, found, strict=True)])
    position = np.concatenate([edges.position for edges in found])
    of_edges = build_index(position) if len(position) else None
    clouds, rows, offset = [], [], 0
    for part, edges in zip(parts, found, strict=True):
        xyz = read(part.path).xyz
        kept = np.union1d(_near(xyz, of_edges, spacing), edges.index)
        clouds.append(xyz[kept])
        rows.append(offset + np.searchsorted(kept, edges.index))
        offset += len(kept)
    names = [field.name for field in fields(Edges) if isinstance(getattr(found[0], field.name), np.ndarray)]
    columns = {name: np.concatenate([getattr(edges, name) for edges in found]) for name in names}
    columns["index"] = np.concatenate(rows)
    cloud = Cloud(np.concatenate(clouds), crs=parts[0].crs)
    return cloud, replace(found[0], **columns, num_points=len(cloud), num_dropped=0)


def _spacing(path: str, edges: Edges) -> np.ndarray:
    """Return the spacing of a file's points at its edge points; at seams, where half of them are missing, more."""
    if not len(edges):
        return np.empty(0)
    points = check_points(read(path), minimum=1)  # as the run took it: a part of a cloud may be small
    near = knn(build_index(points.xyz), edges.position, min(DISC, len(points.xyz)))
    return near.distances[:, -1] * np.sqrt(np.pi / near.distances.shape[1])


def _near(xyz: np.ndarray, of_edges: NeighborIndex | None, spacing: np.ndarray) -> np.ndarray:
    """Return which points lie around edge points."""
    finite = np.flatnonzero(np.isfinite(xyz).all(axis=1))
    if of_edges is None:
        return finite[:0]
    nearest = knn(of_edges, np.ascontiguousarray(xyz[finite]), 1)
    return finite[nearest.distances[:, 0] <= _REACH * spacing[nearest.points[:, 0]]]
