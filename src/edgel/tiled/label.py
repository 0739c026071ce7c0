"""The edges of a tile: strengths, kinds and places, once everything global is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._labels import Labels
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.normals import UNKNOWN
from edgel._surface.faces import LocalFits
from edgel._surface.line import SURE as PLAIN
from edgel._surface.line import Faint, strength_of, with_faint
from edgel._surface.rims import COUNTS as RIM_COUNTS
from edgel._surface.surface import SURE
from edgel.edges import EdgeKind
from edgel.tiled.box import Box
from edgel.tiled.chains import KINDS, Line
from edgel.tiled.classify import FITS_KEPT, HALO
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan


def label_tile(plan: Plan, whole: Whole, line: Line, tile: int) -> None:
    """Find the edges in the core of a tile."""
    plan.keep("label", tile, lambda: _label(plan, whole, line, tile))


def _label(plan: Plan, whole: Whole, line: Line, tile: int) -> dict[str, np.ndarray]:
    with plan.load("classify", tile) as found:
        key, side, probabilities = found["key"], found["side"], [found[kind] for kind in KINDS]
        fits = LocalFits(**{name: found[name] for name in FITS_KEPT}, seen=found["xyz"])
    labels, options = Labels(len(key)), plan.options
    crease, outline = (
        _strengths(plan, tile, kind, probability, even)
        for kind, probability, even in zip(KINDS, probabilities, line.even, strict=True)
    )
    everyone = np.arange(len(key))
    labels.add(everyone, EdgeKind.CREASE, crease)
    labels.add(everyone, side if line.sides else EdgeKind.BOUNDARY, outline)
    kind = labels.of(EdgeKind(options.kinds), options.min_strength)
    edge = np.flatnonzero(kind > 0)
    fits = fits.take(edge)
    viewpoint = None if options.viewpoint is None else np.array(options.viewpoint)
    outermost = _outermost(plan, plan.tiles[tile], fits.xyz, HALO * whole.statistics.spacing / 4)
    faces = fits.faces(kind[edge], outermost, viewpoint)
    if plan.orientation == UNKNOWN:
        faces = replace(faces, convex=np.zeros_like(faces.convex))
    return {"key": key[edge], "kind": kind[edge], "strength": labels.strength[edge], **vars(faces)}


def _strengths(plan: Plan, tile: int, kind: str, probability: np.ndarray, even: float) -> np.ndarray:
    if even >= PLAIN:
        return strength_of(probability, even)
    with plan.load("link", tile) as found, plan.load(f"chained {kind}", tile) as chained:
        rows = found[f"{kind}_row"]
        faint = Faint(rows, np.zeros((len(rows), 0), np.int64), found[f"{kind}_likeliest"])
        return with_faint(probability, even, faint, chained["kept"])


def _outermost(plan: Plan, core: Box, xyz: np.ndarray, halo: float) -> np.ndarray:
    """Return the points (K, 3) that surely are where the surface ends, as far around as edge points (E, 3) ask for."""
    while True:
        box = core.grown(halo, halo).without_end(*plan.bounds)
        found = [np.zeros((0, 3))]
        for tile in plan.around(box):
            with plan.load("classify", tile) as kept:
                found.append(kept["xyz"][kept["outline"] > SURE])
        outermost = np.concatenate(found)
        if box.endless or not len(xyz):
            return outermost
        outermost = outermost[box.holds(outermost)]
        if len(outermost) >= RIM_COUNTS[-1]:
            away = knn(build_index(outermost), xyz, RIM_COUNTS[-1]).distances[:, -1]
            if (away < box.depth(xyz)).all():
                return outermost
        halo *= 2
