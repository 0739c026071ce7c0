"""What was found in a tile: strengths by what the whole cloud says, fits, and where the surface ends around."""

from __future__ import annotations

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._surface.faces import LocalFits
from edgel._surface.line import SURE as PLAIN
from edgel._surface.line import Faint, Strengths, strength_of, with_faint
from edgel._surface.rims import COUNTS as RIM_COUNTS
from edgel._surface.surface import SURE
from edgel.tiled.chains import KINDS, Line
from edgel.tiled.classify import HALO
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan


def fits_of(plan: Plan, tile: int) -> LocalFits:
    """Return the fits of the points that a tile keeps, by their keys, ascending."""
    with plan.load("classify", tile) as found:
        seen = found["seen"] if "seen" in found.files else found["xyz"]
        names = [name for name in LocalFits.__dataclass_fields__ if name != "seen"]
        return LocalFits(**{name: found[name] for name in names}, seen=seen)


def strengths_of_tile(plan: Plan, line: Line, tile: int) -> Strengths:
    """Return how marked the edges are at the points that a tile keeps, by their keys, ascending."""
    with plan.load("classify", tile) as found:
        key, probabilities = found["key"], [found[kind] for kind in KINDS]
    of_kinds = zip(KINDS, probabilities, line.even, strict=True)
    return Strengths(key, *(_strengths(plan, tile, kind, probability, even) for kind, probability, even in of_kinds))


def _strengths(plan: Plan, tile: int, kind: str, probability: np.ndarray, even: float) -> np.ndarray:
    if even >= PLAIN:
        return strength_of(probability, even)
    with plan.load("link", tile) as found, plan.load(f"chained {kind}", tile) as chained:
        rows = found[f"{kind}_row"]
        faint = Faint(rows, np.zeros((len(rows), 0), np.int64), found[f"{kind}_likeliest"])
        return with_faint(probability, even, faint, chained["kept"])


def outermost_around(plan: Plan, whole: Whole, tile: int, xyz: np.ndarray) -> np.ndarray:
    """Return the points (K, 3) that surely are where the surface ends, as far around as edge points (E, 3) ask for."""
    core, halo = plan.tiles[tile], HALO * whole.statistics.spacing / 4
    while True:
        box = core.grown(halo, halo).without_end(*plan.bounds)
        found = [np.zeros((0, 3))]
        for other in plan.around(box):
            with plan.load("classify", other) as kept:
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
