"""The answer: what is compared at all, who proposes, and what is believed of what was found."""

from __future__ import annotations

import numpy as np

from edgel._stages import Stages
from edgel.matching._open import covariance_of, free_directions_of, moved_by
from edgel.matching._prepare import Prepared
from edgel.matching._refine import middle_of, radius_of
from edgel.matching._registration import Poses, Registration, not_found
from edgel.matching._search import END, REACH, Found, Match, has_more_edges, search
from edgel.matching._symmetry import same_answers
from edgel.matching._verify import EDGE, MISSING, SURFACE, VISIBLE

SURE = 0.1
"""Margin from which on an answer can be relied on: `docs/matching.md` says how often such answers are right."""
_LEAST_SCORE, _LEAST_FIT, _LEAST_AGREEMENT, _LEAST_OVERLAP = 0.15, 0.4, 0.1, 0.4
_LEAST_GIVEN = 0.03  # score of a pose that was given, and not found among others
_FAR = (0.5, 0.25)  # of the score, and at least: as far behind as that is out of the question
_ORDERS = 15.0  # spacings of either cloud that the other has to be large
_FEWEST_PLACES = 30
_FEW_EDGES = 24  # half-edges of a search, with fewer of which the surface proposes poses
_PLANE = 0.95  # cosine of normals that look the same way, and their share


def register_prepared(
    source: Prepared,
    target: Prepared,
    stages: Stages,
    initial: np.ndarray | None = None,
    end: float | None = None,
    symmetries: np.ndarray | None = None,
) -> Registration:
    """Find where a prepared source lies in a prepared target."""
    obstacle = _obstacle(source, target, given=initial is not None)
    if obstacle:
        return not_found(obstacle, stages.seconds)
    with stages("search"):
        # The cloud with fewer edges is looked for in the other: more of them have a match.
        swapped = initial is None and has_more_edges(source, target)
        match = Match.of(target, source) if swapped else Match.of(source, target)
        end = END * match.spacing if end is None else end
        if initial is None:
            found, method = _searched(match, end)
        else:
            found, method = match.verified(match.refined(_around(match, initial), end)[0]), "initial"
    if not len(found.poses):
        return not_found("no pose was proposed: neither edges nor surfaces look alike", stages.seconds)
    with stages("answer"):
        return _answer(match, found, swapped, end, stages, method, symmetries)


def _around(match: Match, pose: np.ndarray) -> np.ndarray:
    """Return a pose, and those a reach of matches beside it: what is as far off may slide to a neighbour instead."""
    steps = REACH * match.spacing * np.eye(6)
    return np.array([pose, *(moved_by(match, pose, sign * step) for step in steps for sign in (1, -1))])


def _searched(match: Match, end: float) -> tuple[Found, str]:
    """Search by edges, and by the surface where there are few or they find nothing to be believed; who found it."""
    by_edges = None
    if min(len(match.few.turn), len(match.target.half)) >= _FEW_EDGES:
        by_edges = search(match, end)
        if len(by_edges.poses) and not _doubt(by_edges, 1.0):
            return by_edges, "edges"
    by_surface = search(match, end, by_surface=True)
    if by_edges is None or not len(by_edges.poses):
        return by_surface, "surface"
    if len(by_surface.poses) and by_surface.scores[0] > by_edges.scores[0]:
        return by_surface, "surface"
    return by_edges, "edges"


def _answer(
    match: Match,
    found: Found,
    swapped: bool,
    end: float,
    stages: Stages,
    method: str,
    symmetries: np.ndarray | None,
) -> Registration:
    """Say what was found, in the frames of the source and the target that were asked for."""
    (pose, *_), score = found.poses, float(found.scores[0])
    same, group = same_answers(match, found, swapped, symmetries)
    others = found.scores[~same]
    margin = margin_of(found, float(others.max(initial=0.0)))
    turned = found.poses if not swapped else np.linalg.inv(found.poses)
    alternatives = Poses(turned[1:], found.scores[1:])
    doubt = _doubt(found, margin, given=method == "initial")
    if doubt:
        return not_found(doubt, stages.seconds, Poses(turned, found.scores))
    _, information, residuals = match.refined(pose[None], end)
    free = free_directions_of(match, pose, information[0].sum(axis=0), residuals[0, 0])
    scale = np.append(np.full(3, 1 / radius_of(match.whole)), np.ones(3))
    covariance = covariance_of(match, information[0], residuals[0], free) * np.outer(scale, scale)
    center = pose[:3, :3] @ middle_of(match.whole) + pose[:3, 3]
    free = free * scale
    if swapped:  # a small move of the target in the source, seen from the target, is the opposite move
        back = np.kron(np.eye(2), turned[0, :3, :3])
        covariance, free = back @ covariance @ back.T, -free @ back.T
        center = turned[0, :3, :3] @ center + turned[0, :3, 3]
    return Registration(
        T_target_source=turned[0],
        found=True,
        reason="",
        score=score,
        fitness=_fitness(found),
        edge_fitness=float(found.columns[0, :, EDGE].max()),
        rmse=float(np.sqrt(residuals[0, 1] / max(residuals[0, 0], 1e-9))),
        margin=margin if method != "initial" else float("nan"),
        alternatives=alternatives,
        symmetries=group,
        free_directions=free,
        center=center,
        covariance=covariance,
        method=method,
        seconds=stages.seconds,
    )


def _obstacle(source: Prepared, target: Prepared, *, given: bool) -> str:
    """Say why two clouds cannot be compared at all; empty if they can, as planes from a pose that is given."""
    for side, other, name, its in ((source, target, "source", "target's"), (target, source, "target", "source's")):
        if side.size < _ORDERS * other.spacing:
            return (
                f"the {name} is {side.size:.3g} large, the {its} points lie {other.spacing:.3g} apart: are both in the "
                "same unit?"
            )
        if len(side.surface) < _FEWEST_PLACES:
            return f"the {name} has too little surface: {len(side.surface)} places of it lie on a plane"
        if not given and not side.half.is_crease.any() and _is_plane(side):
            return f"the {name} is one plane without a crease, which fits anywhere on another"
    return ""


def _is_plane(side: Prepared) -> bool:
    """Whether all of a surface looks the same way."""
    middle = side.normals.mean(axis=0)
    return bool((side.normals @ middle > _PLANE * np.linalg.norm(middle)).mean() > _PLANE)


def _fitness(found: Found) -> float:
    """Share of the surface looked for that lies where it should, at the best pose."""
    there = found.columns[0, 0]
    return float(there[SURFACE] / max(there[VISIBLE], 1e-9))


def agreement(found: Found) -> float:
    """How far edges speak for the best pose: 1 where none contradict it, 0 where as many do as are found."""
    edge, missing = found.columns[0, 0, [EDGE, MISSING]]
    return float(max(edge - missing, 0) / (edge + missing)) if edge + missing > 0 else 1.0


def margin_of(found: Found, other: float) -> float:
    """How far the best pose is ahead of another score: 1 from `_FAR` on, less where its edges do not all agree."""
    score = float(found.scores[0])
    return agreement(found) * float(np.clip((score - other) / max(_FAR[0] * score, _FAR[1]), 0, 1))


def _doubt(found: Found, margin: float, *, given: bool = False) -> str:
    """Say why the best pose is not believed; empty if it is. What was given is not asked whether others do as well."""
    score, fitness = float(found.scores[0]), _fitness(found)
    if fitness < _LEAST_FIT:
        there = f"{fitness:.0%} of the surface lie where it should, {_LEAST_FIT:.0%} is asked"
        return f"no pose is confirmed: the best lets {there}"
    least = _LEAST_GIVEN if given else _LEAST_SCORE
    if score < least:
        return f"no pose is confirmed by edges and surface: the best scores {score:.2f}, {least:g} is asked"
    if given:
        return ""
    if agreement(found) < _LEAST_AGREEMENT:
        return "no pose is confirmed: creases contradict the best about as often as they confirm it"
    overlap = found.columns[0, 0, SURFACE]
    if overlap < _LEAST_OVERLAP and margin < SURE:
        return f"no pose is confirmed: the best lets {overlap:.0%} of the surface lie on the other, and is not alone"
    return ""
