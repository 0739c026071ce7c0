"""Hypotheses: every pair of half-edges that look alike is a pose, and the other edges vote on it."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel.matching._verify import TURN, Field, Probes, find_edge, move

_EARLY = 12  # voters after which a pose that next to none confirms is left
_EARLY_SHARE = 0.06
_SLICE = 2048


@kernel
def _vote(start, stop, sources, targets, source, voters, field, tolerance, poses, votes):
    """Write the pose that each pair gives, and the share of the voters that confirm it."""
    for pair in range(start, stop):
        i, j, pose = sources[pair], targets[pair], poses[pair]
        for row in range(3):
            for column in range(3):
                total = 0.0
                for k in range(3):
                    total += field.frames[j, k, row] * source.frames[i, k, column]
                pose[row, column] = total
        for row in range(3):
            at = field.places[j, row]
            for k in range(3):
                at -= pose[row, k] * source.places[i, k]
            pose[row, 3], pose[3, row] = at, 0.0
        pose[3, 3] = 1.0
        total, weight = 0.0, 0.0
        for e in range(len(voters.weights)):
            if e == _EARLY and total < _EARLY_SHARE * weight:
                break
            x, y, z = move(pose, voters.places[e])
            fit, _ = find_edge(field, pose, x, y, z, voters.frames[e], voters.turn[e], voters.bend[e], tolerance)
            total += voters.weights[e] * fit
            weight += voters.weights[e]
        votes[pair] = total / weight


def propose(source: Probes, voters: Probes, field: Field, tolerance: float, most: int) -> np.ndarray:
    """Return the poses that pairs of half-edges give and the other half-edges confirm, best first.

    Parameters
    ----------
    source : Probes
        Its half-edges are paired with those of the field.
    voters : Probes
        Its half-edges vote.
    field : Field
    tolerance : float
        Across the edge, in the cloud's unit.
    most : int
        How many poses.

    Returns
    -------
    (P, 4, 4) float64
    """
    i, j = _alike(source, field)
    poses, votes = np.empty((len(i), 4, 4)), np.empty(len(i))
    run_slices(_vote, len(i), i, j, source, voters, field, tolerance, poses, votes, size=_SLICE)
    return poses[np.argsort(-votes, kind="stable")[:most]]


def _alike(source: Probes, field: Field) -> tuple[np.ndarray, np.ndarray]:
    """Pair the half-edges that may be the same one: creases that turn alike, or an outline and what is not concave."""
    turn, other = source.turn[:, None], field.turn[None]
    bend, other_bend = source.bend[:, None], field.bend[None]
    creases = (turn >= 0) & (other >= 0)
    same = (np.abs(turn - other) < TURN) & (bend * other_bend >= 0)
    i, j = np.nonzero(np.where(creases, same, (bend >= 0) & (other_bend >= 0)))
    return i, j
