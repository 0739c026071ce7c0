"""Registration: what a match answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Poses:
    """Some poses, best first.

    Attributes
    ----------
    poses : (P, 4, 4) float64
        T_target_source of each.
    scores : (P,) float64
        See `Registration.score`.
    """

    poses: np.ndarray
    scores: np.ndarray

    def __len__(self) -> int:
        return len(self.scores)


@dataclass(frozen=True, eq=False)
class Registration:
    """Where a source lies in a target.

    Attributes
    ----------
    T_target_source : (4, 4) float64
        Takes places of the source to the target; NaN where nothing was found.
    found : bool
        Whether edges and surface confirm the pose.
    reason : str
        Why nothing was found; empty if it was.
    score : float
        How far the pose is confirmed, 1 at most: the share of edges and surface found, less what speaks against it.
    fitness : float
        Share, 0 to 1, of a surface that lies on the other cloud's, by how near; what is hidden behind that is left out.
        The surface is that of the cloud with fewer edges, which is the one looked for.
    edge_fitness : float
        Share, 0 to 1, of the edges found in the other cloud, by how near; of that cloud of which more are found.
    rmse : float
        Root of the mean squared distance of the source's surface from the target's where they lie on each other, in the
        cloud's unit.
    margin : float
        How far the best pose is ahead of the next that is no other name for it: 0 they are as good, 1 the next scores
        half of it or less; times how far edges agree: 0 where creases contradict the pose as often as they confirm it.
        NaN where no other was looked for. Poses that differ by a symmetry are one, those along a free direction are
        not.
    alternatives : Poses
        The other poses that were verified.
    symmetries : (S, 4, 4) float64
        Moves of the source that leave it as it is, the identity first: of a model all of them, of a cloud those by
        which alternatives differ from the best pose.
    free_directions : (F, 6) float64
        Directions in which the pose is open, as a slide along a plane is: a rotation vector about `center` and a shift,
        both in the target's frame; moving the source along one of unit length changes its points by about as much.
    center : (3,) float64
        The middle of the source, in the target's frame.
    covariance : (6, 6) float64
        Of the rotation vector (radians) about `center` and of the shift (the cloud's unit), in the target's frame; open
        directions are not in it.
    method : str
        Who proposed the pose: "edges", "surface", "initial", or "none".
    seconds : mapping of str to float
        Time by stage, in seconds.
    """

    T_target_source: np.ndarray
    found: bool
    reason: str
    score: float
    fitness: float
    edge_fitness: float
    rmse: float
    margin: float
    alternatives: Poses
    symmetries: np.ndarray
    free_directions: np.ndarray
    center: np.ndarray
    covariance: np.ndarray
    method: str
    seconds: Mapping[str, float]

    def __repr__(self) -> str:
        if not self.found:
            return f"Registration(not found: {self.reason})"
        free = f", open in {len(self.free_directions)} directions" if len(self.free_directions) else ""
        return (
            f"Registration(fitness {self.fitness:.2f}, edges {self.edge_fitness:.2f}, rmse {self.rmse:.3g}, "
            f"margin {self.margin:.2f}{free})"
        )

    @property
    def position_std(self) -> float:
        """Standard deviation of where the middle of the source lies, in the cloud's unit (all axes together)."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))


def not_found(reason: str, seconds: Mapping[str, float], alternatives: Poses | None = None) -> Registration:
    """Say why there is no answer."""
    return Registration(
        T_target_source=np.full((4, 4), np.nan),
        found=False,
        reason=reason,
        score=0.0,
        fitness=0.0,
        edge_fitness=0.0,
        rmse=float("nan"),
        margin=0.0,
        alternatives=alternatives if alternatives is not None else Poses(np.empty((0, 4, 4)), np.empty(0)),
        symmetries=np.eye(4)[None],
        free_directions=np.empty((0, 6)),
        center=np.full(3, np.nan),
        covariance=np.full((6, 6), np.nan),
        method="none",
        seconds=seconds,
    )
