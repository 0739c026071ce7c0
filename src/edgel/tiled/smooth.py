"""Smoothing tile by tile: where noise asks for it each point is moved towards the plane of its nearest, once."""

from __future__ import annotations

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import at_places
from edgel._surface.smoothing import NEIGHBORS, move
from edgel.tiled.box import Box
from edgel.tiled.plan import Plan
from edgel.tiled.store import Stored

_HALO = 16.0  # spacings around a tile, at first


def smooth_tile(plan: Plan, share: float, spacing: float, tile: int) -> None:
    """Store where the points of a tile are looked at: moved by this share of the way to their planes."""
    plan.smoothed.keep(tile, lambda: _smooth(plan, share, spacing, plan.tiles[tile]))


def _smooth(plan: Plan, share: float, spacing: float, core: Box) -> Stored:
    xyz, keys = plan.points.load(core)
    seen, todo, halo = xyz.copy(), np.arange(len(xyz)), _HALO * spacing
    order = np.argsort(keys)
    while len(todo):
        box = Box.around(xyz[todo]).grown(halo, spacing).without_end(*plan.bounds)
        near, near_keys = plan.points.load(box)
        index = build_index(near)
        wanted = np.isin(near_keys, keys[todo])[index.order]
        places = np.flatnonzero(wanted)
        count = min(NEIGHBORS, len(index))
        reach = knn(index, at_places(index, places), count).distances[:, -1]
        if not box.endless:
            places = places[(reach < box.depth(index.at(places))) & (count == NEIGHBORS)]
        row = order[np.searchsorted(keys, near_keys[index.order[places]], sorter=order)]
        seen[row] = move(index, at_places(index, places), index.at(places), share)
        todo = np.setdiff1d(todo, row)
        halo *= 2
    return Stored(keys, xyz, seen)
