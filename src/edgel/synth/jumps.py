"""Where a depth map breaks off: the rim against nothing, and the near and far side of each step in depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel.edges import EdgeKind
from edgel.synth.rays import RayTree, cast

_JUMP = 2.0  # spacings: what a step in depth has beyond the slopes of both sides
_BREAK = 1.0  # spacings: what is left of it between rays 1/256 of a pixel apart
_HALVINGS = 8
_STEEPEST = 20.0  # slope from which a face is so nearly edge-on that its plane explains any step


@dataclass(frozen=True, eq=False)
class Rays:
    """A sensor's rays in the solid's frame: the pixel [i, j] at depth t sees ``origins[i, j] + t directions[i, j]``.

    Attributes
    ----------
    origins, directions : (H, W, 3) float64
    """

    origins: np.ndarray
    directions: np.ndarray

    def at(self, depth: np.ndarray) -> np.ndarray:
        """Return the places (H, W, 3) at depths (H, W); NaN where there is none."""
        return self.origins + np.where(np.isfinite(depth), depth, np.nan)[..., None] * self.directions


def grid_kinds(tree: RayTree, rays: Rays, depth: np.ndarray, normals: np.ndarray, spacing: float) -> np.ndarray:
    """Find boundary, occluding and occluded hits among neighbours (of 4) in a grid.

    A step in depth is a break when it exceeds both tangent planes' slopes by more than 2 spacings, or when it is more
    than 2 spacings and rays in between, halving the gap 8 times, still find a step of more than one.

    Parameters
    ----------
    tree : RayTree
    rays : Rays
    depth : (H, W) float64
        Of the noise-free hits; infinite for misses.
    normals : (H, W, 3) float64
        In the frame of the rays.
    spacing : float

    Returns
    -------
    (H, W) uint8
        `EdgeKind` flags.
    """
    kind = np.zeros(depth.shape, np.uint8)
    flat, hit = kind.reshape(-1), np.isfinite(depth).ravel()
    cells = np.arange(depth.size).reshape(depth.shape)
    t, normal = depth.ravel(), normals.reshape(-1, 3)
    origins, directions = rays.origins.reshape(-1, 3), rays.directions.reshape(-1, 3)
    for a, b in ((cells[:-1].ravel(), cells[1:].ravel()), (cells[:, :-1].ravel(), cells[:, 1:].ravel())):
        flat[a[hit[a] & ~hit[b]]] |= int(EdgeKind.BOUNDARY)
        flat[b[hit[b] & ~hit[a]]] |= int(EdgeKind.BOUNDARY)
        both = hit[a] & hit[b]
        near, far = np.where(t[a] <= t[b], a, b)[both], np.where(t[a] <= t[b], b, a)[both]
        gap = (t[far] - t[near]) * np.linalg.norm(directions[near], axis=1)
        near, far, gap = (part[gap > _JUMP * spacing] for part in (near, far, gap))
        slope = np.maximum(
            _slope(origins, directions, t, normal, near, far), _slope(origins, directions, t, normal, far, near)
        )
        rest = _narrow(tree, origins, directions, t, near, far)
        broken = (gap > slope + _JUMP * spacing) | (rest > _BREAK * spacing)
        flat[near[broken]] |= int(EdgeKind.OCCLUDING)
        flat[far[broken]] |= int(EdgeKind.OCCLUDED)
    return kind


def _slope(
    origins: np.ndarray, directions: np.ndarray, t: np.ndarray, normal: np.ndarray, a: np.ndarray, b: np.ndarray
) -> np.ndarray:
    """Step in depth, mm, from ray a to ray b along the tangent plane where a hits."""
    place = origins[a] + t[a, None] * directions[a]
    length = np.linalg.norm(directions[a], axis=1)
    apart = np.linalg.norm(place - origins[b] - t[a, None] * directions[b], axis=1)
    reach = np.einsum("ij,ij->i", normal[a], place - origins[b])
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.abs(reach / np.einsum("ij,ij->i", normal[a], directions[b]) - t[a]) * length
    return np.where(step < _STEEPEST * apart, step, np.inf)


def _narrow(
    tree: RayTree, origins: np.ndarray, directions: np.ndarray, t: np.ndarray, a: np.ndarray, b: np.ndarray
) -> np.ndarray:
    """Halve the way from ray a to ray b towards the larger step in depth; returns the step that is left, mm."""
    low, high = np.zeros(len(a)), np.ones(len(a))
    depth_low, depth_high = t[a], t[b]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        part = middle[:, None]
        depth = cast(
            tree, (1 - part) * origins[a] + part * origins[b], (1 - part) * directions[a] + part * directions[b]
        ).distance
        with np.errstate(invalid="ignore"):
            first = np.nan_to_num(np.abs(depth - depth_low), nan=0.0, posinf=np.inf)
            second = np.nan_to_num(np.abs(depth_high - depth), nan=0.0, posinf=np.inf)
        lower = first > second
        high, depth_high = np.where(lower, middle, high), np.where(lower, depth, depth_high)
        low, depth_low = np.where(lower, low, middle), np.where(lower, depth_low, depth)
    with np.errstate(invalid="ignore"):
        rest = np.nan_to_num(np.abs(depth_high - depth_low), nan=0.0, posinf=np.inf)
    return rest * np.linalg.norm(directions[a], axis=1)
