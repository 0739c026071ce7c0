"""Several instances of a part: each found is taken out of the scene before the next is looked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._stages import Stages
from edgel.matching._answer import register_prepared
from edgel.matching._grid import build_grid, find_cell
from edgel.matching._prepare import Prepared
from edgel.matching._registration import Registration
from edgel.matching._search import REACH

_CLAIM = 3.0  # spacings from the part within which the scene is its


def find_instances(
    model: Prepared, scene: Prepared, symmetries: np.ndarray, most: int, end: float | None, stages: Stages
) -> list[Registration]:
    """Find up to so many instances of a model in a scene."""
    found: list[Registration] = []
    while len(found) < most:
        one = register_prepared(model, scene, stages, None, end, symmetries)
        if not one.found:
            break
        found.append(one)
        if len(found) < most:
            scene = _without(scene, model, one.T_target_source)
    return found


def _without(scene: Prepared, model: Prepared, pose: np.ndarray) -> Prepared:
    """Take the edges and the surface that a model explains out of a scene."""
    grid = build_grid(model.surface, max(REACH * scene.spacing, 1.5 * model.gap))
    back = np.linalg.inv(pose)
    near = []
    for places in (scene.half.places, scene.surface):
        claimed = np.zeros(len(places), np.bool_)
        moved = places @ back[:3, :3].T + back[:3, 3]
        run_slices(_claim, len(moved), moved, model.surface, grid, _CLAIM * scene.spacing, model.normals, claimed)
        near.append(~claimed)
    half, surface = near
    return replace(
        scene,
        half=scene.half.take(half),
        surface=scene.surface[surface],
        normals=scene.normals[surface],
        smooth=scene.smooth[surface],
    )


@kernel
def _claim(start, stop, places, surface, grid, reach, normals, claimed):
    """Say which places lie within reach of the planes about a surface."""
    for p in range(start, stop):
        slot = find_cell(grid, places[p, 0], places[p, 1], places[p, 2])
        for m in range(grid.first[slot], grid.last[slot]):
            s = grid.members[m]
            away, squared = 0.0, 0.0
            for axis in range(3):
                off = places[p, axis] - surface[s, axis]
                away += off * normals[s, axis]
                squared += off * off
            claimed[p] |= abs(away) < reach and squared < grid.cell * grid.cell
