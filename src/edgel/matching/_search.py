"""The search on one screen: propose, verify, refine, verify again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edgel.matching._half_edges import HalfEdges, rareness
from edgel.matching._hypotheses import propose
from edgel.matching._prepare import Prepared
from edgel.matching._refine import middle_of, refine
from edgel.matching._surface_pairs import propose_by_surface
from edgel.matching._verify import MISSING, THROUGH, Field, Probes, confirm, field_of, probes_of, scores_of

PARTS = 28  # of the smaller cloud's size: how far apart half-edges are that propose
_APART = 8.0  # spacings, at most
_SOURCES, _TARGETS, _VOTERS, _SURFACE = 300, 2400, 64, 250
_PAIRS = 250_000  # that are tried, by fewer of the source where the target has many
_MOST = 2000  # half-edges, and places of the surface, that refine
_PROPOSED, _REFINED, _FINAL = 1500, 80, 12
REACH, _TIGHT, END = 4.0, 2.0, 1.5
"""Spacings within which matches lie: at first, of a verification, and in the end."""


@dataclass(frozen=True, eq=False)
class Found:
    """Distinct poses of a source in a target, best first.

    Attributes
    ----------
    poses : (P, 4, 4) float64
        T_target_source.
    scores : (P,) float64
    columns : (P, 2, 6) float64
        See `edgel.matching._verify.confirm`: the source looked for in the target, and the other way round; the former's
        `MISSING` and `THROUGH` count those of both.
    """

    poses: np.ndarray
    scores: np.ndarray
    columns: np.ndarray

    def take(self, rows: np.ndarray) -> Found:
        """Return some of the poses."""
        return Found(self.poses[rows], self.scores[rows], self.columns[rows])


@dataclass(frozen=True, eq=False)
class Match:
    """A source and a target, with what verification and refinement ask of them.

    Attributes
    ----------
    source, target : Prepared
    spacing : float
        Of the coarser of the two.
    apart : float
        Distance between the half-edges that propose.
    few, whole : Probes
        Of the source: some for verification, all for refinement.
    fine : Field
        Of the target.
    """

    source: Prepared
    target: Prepared
    spacing: float
    apart: float
    few: Probes
    whole: Probes
    fine: Field

    @property
    def tight(self) -> float:
        """Tolerance of a verification."""
        return _TIGHT * self.spacing

    @property
    def same(self) -> float:
        """Poses that move the surface by less come to the same."""
        return REACH * self.spacing

    @staticmethod
    def of(source: Prepared, target: Prepared, least: float = 0.0) -> Match:
        """Set a match up, at the spacing of the coarser cloud but at least another one, as models have none."""
        spacing = max(source.spacing, target.spacing, least)
        apart = _apart(source, target, spacing)
        few = _probes(source.half.thinned(apart, _SOURCES), source, _SURFACE)
        whole = _probes(source.half.thinned(spacing / 2, _MOST), source, _MOST)
        return Match(source, target, spacing, apart, few, whole, _field(target, target.half, REACH * spacing))

    @cached_property
    def apart_in_target(self) -> HalfEdges:
        """Half-edges of the target that lie apart."""
        return self.target.half.thinned(self.apart, _TARGETS)

    @cached_property
    def coarse(self) -> Field:
        """A field of the target in which half-edges lie apart."""
        return _field(self.target, self.apart_in_target, 1.5 * self.apart)

    @cached_property
    def back(self) -> tuple[Probes, Field]:
        """What verifies the other way round: the target's probes, and a field of the source."""
        theirs = _probes(self.apart_in_target, self.target, 2 * _SURFACE)
        return theirs, _field(self.source, self.source.half, REACH * self.spacing)

    def refined(self, poses: np.ndarray, end: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Refine poses (see `refine`), until matches lie within a distance."""
        return refine(poses, self.whole, self.fine, (max(REACH * self.spacing, end), end), (12, 10))

    def verified(self, poses: np.ndarray) -> Found:
        """Verify poses by both clouds, best first, without those that come to the same."""
        if not len(poses):
            return Found(poses, np.empty(0), np.empty((0, 2, 6)))
        there = confirm(poses, self.few, self.fine, self.tight)
        back = confirm(np.linalg.inv(poses), *self.back, self.tight)
        there[:, (MISSING, THROUGH)] += back[:, (MISSING, THROUGH)]
        scores = scores_of(there)
        found = Found(poses, scores, np.stack([there, back], axis=1)).take(np.argsort(-scores, kind="stable"))
        return found.take(distinct_rows(found.poses, self.whole, self.same))


def _apart(source: Prepared, target: Prepared, spacing: float) -> float:
    return min(min(source.size, target.size) / PARTS, _APART * spacing)


def has_more_edges(source: Prepared, target: Prepared) -> bool:
    """Tell whether a source has more edges than a target, by length."""
    apart = _apart(source, target, max(source.spacing, target.spacing))
    return len(source.half.thinned(apart, _TARGETS)) > len(target.half.thinned(apart, _TARGETS))


def search(match: Match, end: float, most: int = _FINAL, *, by_surface: bool = False) -> Found:
    """Find the poses, at most so many, of a source in a target that edges and surface confirm.

    Pairs of half-edges propose them, or pairs of places on the surface.
    """
    coarse, few, spacing = match.coarse, match.few, match.spacing
    if by_surface:
        poses = propose_by_surface(match.source, match.target)
        votes = scores_of(confirm(poses, _probes(HalfEdges.none(), match.source, _VOTERS), coarse, match.apart))
        poses = poses[np.argsort(-votes, kind="stable")[:_PROPOSED]]
    else:
        chosen = _some(few, max(_PAIRS // max(len(coarse.turn), 1), _VOTERS))
        poses = propose(chosen, _some(few, _VOTERS), coarse, match.apart, _PROPOSED)
    surface, normals, shares = (np.ascontiguousarray(column[::2]) for column in few[5:])
    rough = _some(few, 2 * _VOTERS)._replace(surface=surface, normals=normals, surface_weights=shares)
    scores = scores_of(confirm(poses, rough, coarse, match.apart))
    poses = _best(poses, scores, few, 2 * match.apart, max(_REFINED, 2 * most))
    poses, _, _ = refine(poses, few, coarse, (1.5 * match.apart, REACH * spacing), (5, 0))
    poses, _, _ = refine(poses, few, match.fine, (REACH * spacing, match.tight), (6, 0))
    scores = scores_of(confirm(poses, few, match.fine, match.tight))
    poses = _best(poses, scores, few, 2 * spacing, most)
    return match.verified(match.refined(poses, end)[0])


def _probes(half: HalfEdges, side: Prepared, most: int) -> Probes:
    """Make probes of half-edges and about so many places of a surface, each weighed by how rare its direction is."""
    rows = np.unique(np.linspace(0, len(side.surface) - 1, min(most, len(side.surface))).astype(np.int64))
    if most > 2 * _SURFACE:  # for refinement, which asks for no weights
        return probes_of(half, np.ones(len(half)), side.surface[rows], side.normals[rows], np.ones(len(rows)))
    shares, weights = rareness(side.normals[rows][:, None]), rareness(half.frames[:, :2])
    return probes_of(half, weights, side.surface[rows], side.normals[rows], shares)


def _field(side: Prepared, half: HalfEdges, reach: float) -> Field:
    """Make a field; between the places of its surface nothing is missed."""
    return field_of(half, side.surface, side.normals, side.smooth, side.sight, reach, max(reach, 1.5 * side.gap))


def _some(probes: Probes, most: int) -> Probes:
    """Choose at most so many of the half-edges, all over the part, in no order."""
    rows = np.random.default_rng(0).permutation(len(probes.weights))[:most]
    places, frames, turn, bend, weights = (column[rows] for column in probes[:5])
    return probes._replace(places=places, frames=frames, turn=turn, bend=bend, weights=weights)


def _best(poses: np.ndarray, scores: np.ndarray, probes: Probes, shift: float, most: int) -> np.ndarray:
    """Return the best poses that lie apart."""
    poses = poses[np.argsort(-scores, kind="stable")]
    return poses[distinct_rows(poses, probes, shift, most)]


def distinct_rows(poses: np.ndarray, probes: Probes, shift: float, most: int | None = None) -> np.ndarray:
    """Rows of poses, at most so many, each of which lies by more than a shift from all before (`distances`)."""
    places, kept = _placed(poses, probes), np.empty(0, np.int64)
    for p in range(len(poses)):
        if len(kept) == most:
            break
        if not len(kept) or (((places[kept] - places[p]) ** 2).sum(axis=1) > shift**2).all():
            kept = np.append(kept, p)
    return kept


def distances(poses: np.ndarray, other: np.ndarray, probes: Probes) -> np.ndarray:
    """How far poses (P, 4, 4) move the surface from where another one does, (P,): root mean square."""
    return np.sqrt(((_placed(poses, probes) - _placed(other[None], probes)) ** 2).sum(axis=1))


def _placed(poses: np.ndarray, probes: Probes) -> np.ndarray:
    """Place poses in a space (P, 12) in which they are as far apart as they move the surface, root mean square."""
    middle = middle_of(probes)
    values, vectors = np.linalg.eigh(np.cov((probes.surface - middle).T, bias=True))
    axes = vectors * np.sqrt(np.maximum(values, 0))
    turned = (poses[:, :3, :3] @ axes).reshape(-1, 9)
    return np.concatenate([turned, poses[:, :3, :3] @ middle + poses[:, :3, 3]], axis=1)
