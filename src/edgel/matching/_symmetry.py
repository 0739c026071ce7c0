"""Which poses are other names for the same one: the symmetries of a part."""

from __future__ import annotations

import numpy as np

from edgel.matching._open import rotation_of, vector_of
from edgel.matching._prepare import Prepared
from edgel.matching._search import END, Found, Match, distances, distinct_rows, search
from edgel.matching._verify import EDGE, MISSING, SURFACE, confirm

TURNS = 72
"""Turns that stand for any about an axis."""
_FINE = 150.0  # of the size: spacing at which a part is matched with itself
_EXACT, _SCANNED = (0.85, 0.98, 0.01), (0.9, 0.7, 0.03)
"""Least shares of surface and edges that a symmetry leaves in place, over those that no move leaves, and most share of
the creases that it takes to where the surface is smooth; of a model, whose edges are exact, while places of its surface
may find none beside them, and of a scan."""
_EXACT_SURFACE = 0.97  # of a model without edges
_MOST = 60  # symmetries that are looked for
_ROUND = 48  # and from how many on it is any turn about an axis
_TRIED = 1000  # products of symmetries that are tried at a time
_RIVAL = 0.5  # of the best score, from where on it is asked whether an alternative is the same by symmetry


def symmetries_of(part: Prepared) -> np.ndarray:
    """Find the moves (S, 4, 4) that leave a part as it is, the identity first; any turn about an axis as `TURNS`."""
    match = Match.of(part, part, part.size / _FINE)
    found = search(match, END * match.spacing, most=_MOST)
    moves = np.eye(4)[None]
    new = found.poses[_leave(match, found.poses)]
    while len(new) and len(moves) < _ROUND:  # what two of them do one after the other is a symmetry, too
        count = len(moves)
        moves = np.concatenate([moves, new])
        moves = moves[distinct_rows(moves, match.whole, match.same)]
        if len(moves) == count:
            break
        new = np.einsum("aij,bjk->abik", moves, moves).reshape(-1, 4, 4)[:_TRIED]
        new = new[_leave(match, new)]
    if len(moves) >= _ROUND:
        moves = np.concatenate([moves[:1], _turns(moves[1:], part.surface.mean(axis=0))])
    return moves


def same_answers(
    match: Match, found: Found, swapped: bool, symmetries: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Tell which poses come to the same as the first, or are that by a symmetry.

    Parameters
    ----------
    match : Match
    found : Found
        (P) poses.
    swapped : bool
        Whether the match looks for the target in the source.
    symmetries : (S, 4, 4) float64 or None
        Of the source, if they are known; else those of a cloud that was scanned all round are tried out.

    Returns
    -------
    (P,) bool, (S, 4, 4) float64
        The same, and the symmetries of the source, the identity first.
    """
    best = found.poses[0]
    same = distances(found.poses, best, match.whole) <= match.same
    group = np.eye(4)[None]
    if symmetries is not None:
        names = symmetries @ best if swapped else best @ symmetries
        for p in np.flatnonzero(~same):
            same[p] = (distances(names, found.poses[p], match.whole) <= match.same).any()
        return same, symmetries
    rivals = np.flatnonzero(~same & (found.scores > _RIVAL * found.scores[0]))
    whole = match.target if match.source.has_sight else match.source
    if whole.has_sight or not len(rivals):
        return same, group
    by_source = whole is match.source
    poses = found.poses[rivals]
    moves = np.linalg.inv(best) @ poses if by_source else poses @ np.linalg.inv(best)
    equal = _leave(Match.of(whole, whole, match.spacing), moves)
    same[rivals[equal]] = True
    moves = poses[equal] @ np.linalg.inv(best) if swapped else np.linalg.inv(best) @ poses[equal]
    return same, np.concatenate([group, moves])


def _leave(match: Match, moves: np.ndarray) -> np.ndarray:
    """Tell which moves (S, 4, 4) leave the source of a match, whose target it is too, as it is."""
    surfaces, edges, missing = _EXACT if match.source.spacing == 0 else _SCANNED
    columns = confirm(np.concatenate([np.eye(4)[None], moves]), match.few, match.fine, match.tight)
    still, columns = columns[0], columns[1:]
    if match.source.spacing == 0 and still[EDGE] == 0:
        surfaces = _EXACT_SURFACE
    kept = (columns[:, SURFACE] >= surfaces * still[SURFACE]) & (columns[:, EDGE] >= edges * still[EDGE])
    return kept & (columns[:, MISSING] <= still[MISSING] + missing)


def _turns(moves: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return turns about the axis that most moves keep, all but that by nothing; over, too, if a move does that."""
    vectors = np.array([vector_of(move[:3, :3]) for move in moves])
    axes = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    axis = axes[np.argmax((np.abs(axes @ axes.T) > 0.99).sum(axis=1))]
    turns = np.tile(np.eye(4), (TURNS, 1, 1))
    for k in range(TURNS):
        turns[k, :3, :3] = rotation_of(2 * np.pi * k / TURNS * axis)
    over = moves[moves[:, :3, :3] @ axis @ axis < -0.99]
    if len(over):
        turns = np.concatenate([turns, turns @ over[0]])
    turns[:, :3, 3] = middle - turns[:, :3, :3] @ middle
    return turns[1:]
