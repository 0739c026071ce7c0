"""Hypotheses without edges: pairs of places on the surface that look alike (Drost et al. 2010).

doi:10.1109/CVPR.2010.5540108, but without its voting: every pose is verified, the rarest pairs first.
"""

from __future__ import annotations

import numpy as np

from edgel.matching._half_edges import frames_of
from edgel.matching._prepare import Prepared

_SOURCES, _TARGETS = 100, 250  # places whose pairs are looked at
_NEAREST, _FARTHEST = 0.15, 0.8  # of the smaller size, between the places of a pair
_STEPS = 16  # of that size, in which distances count as the same
_ANGLE = np.radians(15.0)  # the same of angles
_MOST = 30_000  # poses


def propose_by_surface(source: Prepared, target: Prepared) -> np.ndarray:
    """Return the poses (P, 4, 4) that pairs of places give whose distance and normals are alike, the rarest first."""
    size = min(source.size, target.size)
    mine, frames, places = _pairs(source, _SOURCES, size)
    theirs, their_frames, their_places = _pairs(target, _TARGETS, size)
    keys, number = np.unique(np.concatenate([mine, theirs]), return_inverse=True)
    mine, theirs = number[: len(mine)], number[len(mine) :]
    count, their_count = (np.bincount(n, minlength=len(keys)) for n in (mine, theirs))
    matches = count * their_count
    rarest = np.argsort(np.where(matches > 0, matches, np.iinfo(np.int64).max), kind="stable")
    taken = rarest[: np.searchsorted(np.cumsum(matches[rarest]), _MOST)]
    by_key, their_by_key = (np.argsort(n, kind="stable") for n in (mine, theirs))
    first, their_first = np.cumsum(count) - count, np.cumsum(their_count) - their_count
    i, j = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for key in taken[matches[taken] > 0]:
        own = by_key[first[key] : first[key] + count[key]]
        other = their_by_key[their_first[key] : their_first[key] + their_count[key]]
        i.append(np.repeat(own, len(other)))
        j.append(np.tile(other, len(own)))
    a, b = np.concatenate(i), np.concatenate(j)
    poses = np.tile(np.eye(4), (len(a), 1, 1))
    poses[:, :3, :3] = np.einsum("nki,nkj->nij", their_frames[b], frames[a])
    poses[:, :3, 3] = their_places[b] - np.einsum("nij,nj->ni", poses[:, :3, :3], places[a])
    return poses


def _pairs(side: Prepared, most: int, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what pairs of places look like (a number each), their frames (K, 3, 3), and first places (K, 3)."""
    rows = np.unique(np.linspace(0, len(side.surface) - 1, min(most, len(side.surface))).astype(np.int64))
    places, normals = side.surface[rows], side.normals[rows]
    i, j = np.nonzero(~np.eye(len(rows), dtype=bool))
    along = places[j] - places[i]
    apart = np.linalg.norm(along, axis=1)
    kept = (apart > _NEAREST * size) & (apart < _FARTHEST * size)
    i, j, along, apart = i[kept], j[kept], along[kept], apart[kept]
    along /= apart[:, None]
    cosines = [
        (normals[i] * along).sum(axis=1),
        (normals[j] * along).sum(axis=1),
        (normals[i] * normals[j]).sum(axis=1),
    ]
    angles = np.arccos(np.clip(cosines, -1, 1))
    # Two places of one plane look like any two of another; a pair across its own normal has no frame.
    kept = ~((angles[2] < _ANGLE) & (np.abs(cosines[0]) < np.sin(_ANGLE))) & (np.abs(cosines[0]) < 1 - 1e-6)
    columns = np.floor(np.stack([apart / size * _STEPS, *(angles / _ANGLE)])).astype(np.int64)[:, kept]
    looks = ((columns[0] * 16 + columns[1]) * 16 + columns[2]) * 16 + columns[3]
    i, along = i[kept], along[kept]
    return looks, frames_of(along, normals[i]), places[i]
