"""How sure a pose is, and what the data leave open."""

from __future__ import annotations

import numpy as np

from edgel.matching._prepare import shared_planes
from edgel.matching._refine import middle_of, radius_of
from edgel.matching._search import Match
from edgel.matching._verify import confirm, scores_of

_WEAK = 0.1  # of the mean information of a direction in which every plane would count: stronger ones are not asked
_MOVED = 3.0  # tolerances by which a pose is moved to see whether that is noticed
_FLOOR = 0.02  # spacings: no distance is known better
_UNNOTICED = 0.78  # of the score that is left where next to nothing notices: the ends of what was seen may, by chance


def free_directions_of(match: Match, pose: np.ndarray, information: np.ndarray, weight: float) -> np.ndarray:
    """Return the directions (F, 6) in which moving a pose changes next to nothing of what confirms it.

    A direction is a rotation vector about the moved middle, as arcs at the radius (`radius_of`), and a shift.
    """
    values, vectors = np.linalg.eigh(information)
    weak = vectors[:, values < _WEAK * max(weight, 1.0)].T
    if not len(weak):
        return np.empty((0, 6))
    step = _MOVED * match.tight
    moved = [moved_by(match, pose, sign * step * direction) for direction in weak for sign in (1, -1)]
    scores = scores_of(confirm(np.array([pose, *moved]), match.few, match.fine, match.tight))
    left = scores[1:].reshape(-1, 2).min(axis=1)
    return weak[left > _UNNOTICED * scores[0]]


def moved_by(match: Match, pose: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """Move a pose by arcs about its middle and a shift (6,)."""
    center = pose[:3, :3] @ middle_of(match.whole) + pose[:3, 3]
    turn = rotation_of(twist[:3] / radius_of(match.whole))
    moved = np.eye(4)
    moved[:3, :3] = turn @ pose[:3, :3]
    moved[:3, 3] = turn @ (pose[:3, 3] - center) + center + twist[3:]
    return moved


def rotation_of(vector: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    across = np.cross(np.eye(3), vector / angle)
    return np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * across @ across


def vector_of(rotation: np.ndarray) -> np.ndarray:
    """Return the rotation vector (3,) of a rotation (3, 3)."""
    cosine = np.clip((np.trace(rotation) - 1) / 2, -1, 1)
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    length = float(np.linalg.norm(axis))
    if length > 1e-12:
        return np.arctan2(length / 2, cosine) * axis / length
    if cosine > 0:
        return axis / 2
    column = int(np.argmax(np.diag(rotation)))  # half a turn
    axis = rotation[:, column] + np.eye(3)[column]
    return np.pi * axis / np.linalg.norm(axis)


def covariance_of(match: Match, information: np.ndarray, residuals: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return the covariance (6, 6) of what is not free, turns as arcs; see `refine` for what the arguments are."""
    weights, squares = np.maximum(residuals[::2], 1e-9), residuals[1::2]
    variances = np.maximum(squares / weights, (_FLOOR * match.spacing) ** 2)
    # Planes that share points err alike.
    variances[0] *= max(shared_planes(match.source), shared_planes(match.target))
    fixed = np.eye(6) - free.T @ free
    told = (information / variances[:, None, None]).sum(axis=0)
    return np.linalg.pinv(fixed @ told @ fixed, rcond=1e-10, hermitian=True)
