"""The search on one screen: propose, verify, refine, verify again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel.matching._half_edges import HalfEdges, rareness
from edgel.matching._hypotheses import propose
from edgel.matching._prepare import Prepared
from edgel.matching._refine import refine
from edgel.matching._verify import Field, Probes, confirm, field_of, probes_of, scores_of

PARTS = 28  # of the smaller cloud's size: how far apart half-edges are that propose
_APART = 8.0  # spacings, at most
_SOURCES, _TARGETS, _VOTERS, _SURFACE = 300, 2400, 64, 250
_PROPOSED, _REFINED, _FINAL = 1500, 80, 12


@dataclass(frozen=True, eq=False)
class Found:
    """Distinct poses, best first.

    Attributes
    ----------
    poses : (P, 4, 4) float64
    scores : (P,) float64
    columns : (P, 5) float64
        See `edgel.matching._verify.confirm`; of both clouds, each looked for in the other.
    """

    poses: np.ndarray
    scores: np.ndarray
    columns: np.ndarray
    information: np.ndarray
    residuals: np.ndarray


def search(source: Prepared, target: Prepared) -> Found:
    """Find the poses of a source in a target that edges and surface confirm."""
    spacing = max(source.spacing, target.spacing)
    apart = min(min(source.size, target.size) / PARTS, _APART * spacing)
    few, some = source.half.thinned(apart, _SOURCES), target.half.thinned(apart, _TARGETS)
    probes = _probes(few, source, _SURFACE)
    coarse = field_of(some, target.surface, target.normals, target.smooth, target.sight, 1.5 * apart)
    voters = _voters(probes)
    poses = propose(probes, voters, coarse, apart, _PROPOSED)
    columns = confirm(poses, probes, coarse, apart)
    poses = _distinct(poses, scores_of(columns), source, 2 * apart)[:_REFINED]
    poses, _, _ = refine(poses, probes, coarse, (1.5 * apart, 4 * spacing), (5, 0))
    tight = 2.0 * spacing
    fine = field_of(target.half, target.surface, target.normals, target.smooth, target.sight, 4 * spacing)
    poses, _, _ = refine(poses, probes, fine, (4 * spacing, 2 * spacing), (6, 0))
    poses = _distinct(poses, scores_of(confirm(poses, probes, fine, tight)), source, 2 * spacing)[:_FINAL]
    whole = _probes(source.half, source, len(source.surface))
    poses, information, residuals = refine(poses, whole, fine, (4 * spacing, 1.5 * spacing), (12, 10))
    there, back = confirm(poses, probes, fine, tight), np.zeros((len(poses), 5))
    if len(poses):
        their = _probes(some, target, 2 * _SURFACE)
        mine = field_of(source.half, source.surface, source.normals, source.smooth, source.sight, 4 * spacing)
        back = confirm(np.linalg.inv(poses), their, mine, tight)
    columns = np.stack([there, back], axis=1)
    scores = scores_of(there) - back[:, 2] - 0.5 * back[:, 3]
    order = np.argsort(-scores, kind="stable")
    order = order[_distinct_rows(poses[order], source, 4 * spacing)]
    return Found(poses[order], scores[order], columns[order], information[order], residuals[order])


def _probes(half: HalfEdges, side: Prepared, most: int) -> Probes:
    """Make probes of half-edges and about so many places of a surface, each weighed by how rare its direction is."""
    rows = np.unique(np.linspace(0, len(side.surface) - 1, min(most, len(side.surface))).astype(np.int64))
    shares = rareness(side.normals[rows][:, None]) if len(rows) <= 1000 else np.ones(len(rows))
    weights = rareness(half.frames[:, :2]) if len(half) <= 1000 else np.ones(len(half))
    return probes_of(half, weights, side.surface[rows], side.normals[rows], shares)


def _voters(probes: Probes) -> Probes:
    """Choose the half-edges that vote, one among others all over the part."""
    rows = np.random.default_rng(0).permutation(len(probes.weights))[:_VOTERS]
    return Probes(*(column[rows] for column in probes[:5]), *probes[5:])


def _distinct(poses: np.ndarray, scores: np.ndarray, source: Prepared, shift: float) -> np.ndarray:
    order = np.argsort(-scores, kind="stable")
    return poses[order][_distinct_rows(poses[order], source, shift)]


def _distinct_rows(poses: np.ndarray, source: Prepared, shift: float) -> np.ndarray:
    """Rows of poses that lie by more than a shift from all before: as the source's points move, root mean square."""
    middle = source.surface.mean(axis=0)
    spread = np.cov((source.surface - middle).T, bias=True)
    kept: list[int] = []
    for p in range(len(poses)):
        if kept:
            turn = poses[kept, :3, :3] - poses[p, :3, :3]
            off = turn @ middle + poses[kept, :3, 3] - poses[p, :3, 3]
            squared = np.einsum("pij,jk,pik->p", turn, spread, turn) + (off**2).sum(axis=1)
            if (squared < shift**2).any():
                continue
        kept.append(p)
    return np.array(kept, np.int64)
