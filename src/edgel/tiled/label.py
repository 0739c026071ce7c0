"""The edges of a tile: strengths, kinds and places, once everything global is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._faces import Faces
from edgel._labels import Labels
from edgel._neighbors.normals import UNKNOWN
from edgel._surface.coarser import Carried
from edgel._surface.line import Strengths
from edgel.edges import EdgeKind
from edgel.tiled.chains import Line
from edgel.tiled.coarser import faces_of
from edgel.tiled.found import fits_of, outermost_around, strengths_of_tile
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan


def label_tile(plan: Plan, whole: Whole, line: Line, tile: int) -> None:
    """Find the edges in the core of a tile."""
    plan.keep("label", tile, lambda: _label(plan, whole, line, tile))


def _label(plan: Plan, whole: Whole, line: Line, tile: int) -> dict[str, np.ndarray]:
    with plan.load("classify", tile) as found:
        own, side, xyz = strengths_of_tile(plan, line, tile), found["side"], found["xyz"]
    if not plan.result("carry", tile).exists():  # no coarser look was taken
        key, kind, strength = _labelled(plan, line, own, side)
        faces = _faces(plan, whole, tile, key, kind)
    else:
        with plan.load("carry", tile) as found:
            carried = Carried(Strengths(found["key"], found["crease"], found["outline"]), found["source"])
            both = np.concatenate([own.points, found["key"]])
            side, xyz = np.concatenate([side, found["side"]]), np.concatenate([xyz, found["xyz"]])
            tiles = found["tile"]
        joined = own.join(carried.strengths)
        at = np.unique(both, return_index=True)[1]
        key, kind, strength = _labelled(plan, line, joined, side[at])
        xyz = xyz[at][np.isin(joined.points, key)]
        faces = Faces.of_points(xyz, np.full_like(xyz, np.nan))
        known = np.isin(key, own.points)
        faces.put(known, _faces(plan, whole, tile, key[known], kind[known]), slice(None))
        rows, sources = carried.seen_at(key, own)
        of_carried = np.searchsorted(carried.strengths.points, key[rows])
        from_coarser, of_source = faces_of(plan, sources, tiles[of_carried])
        faces.put(rows, from_coarser.along(xyz[rows], of_source), slice(None))
    if plan.orientation == UNKNOWN:
        faces = replace(faces, convex=np.zeros_like(faces.convex))
    return {"key": key, "kind": kind, "strength": strength, **vars(faces)}


def _labelled(plan: Plan, line: Line, found: Strengths, side: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Label points (M,), by what lies beside each (M,); returns keys, kinds and strengths of the edge points."""
    labels, everyone = Labels(len(found.points)), np.arange(len(found.points))
    labels.add(everyone, EdgeKind.CREASE, found.crease)
    labels.add(everyone, side if line.sides else EdgeKind.BOUNDARY, found.outline)
    kind = labels.of(EdgeKind(plan.options.kinds), plan.options.min_strength)
    edge = np.flatnonzero(kind > 0)
    return found.points[edge], kind[edge], labels.strength[edge]


def _faces(plan: Plan, whole: Whole, tile: int, key: np.ndarray, kind: np.ndarray) -> Faces:
    """Say where edges run at some points (E,), ascending, that the tile keeps, by their own neighbours."""
    with plan.load("classify", tile) as found:
        fits = fits_of(plan, tile).take(np.searchsorted(found["key"], key))
    viewpoint = None if plan.options.viewpoint is None else np.array(plan.options.viewpoint)
    return fits.faces(kind, outermost_around(plan, whole, tile, fits.xyz), viewpoint)
