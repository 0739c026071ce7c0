"""Steps between the neighbours of an organized cloud: what its rays and its pixels are like."""

from __future__ import annotations

import numpy as np


def neighbours(index: np.ndarray, most: int | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pairs of points one below the other, and side by side; some `most` of each, evenly spread, if that is given."""
    stride = 1 if most is None else max(int(np.sqrt(index.size / most)), 1)
    pairs = []
    for a, b in ((index[:-1], index[1:]), (index[:, :-1], index[:, 1:])):
        a, b = a[::stride, ::stride], b[::stride, ::stride]
        both = (a >= 0) & (b >= 0)
        pairs.append((a[both], b[both]))
    return pairs


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distances between the unit vectors along vectors (M, 3) and (M, 3), where neither is 0."""
    lengths = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
    known = (lengths[0] > 0) & (lengths[1] > 0)
    return np.linalg.norm(a[known] / lengths[0][known, None] - b[known] / lengths[1][known, None], axis=1)


def parallel_direction(xyz: np.ndarray, pairs: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Direction along which alone the steps between neighbours differ, as they do where the rays are parallel."""
    scatter = np.zeros((3, 3))
    middles = []
    for a, b in pairs:
        step = xyz[b] - xyz[a]
        middles.append(np.median(step, axis=0) if len(step) else np.zeros(3))
        step = step - middles[-1]
        scatter += step.T @ step
    values, vectors = np.linalg.eigh(scatter)
    across = np.cross(*middles)
    length = np.linalg.norm(across)
    count = sum(len(a) for a, _ in pairs)
    if values[-1] <= 1e-12 * count * length and length > 0:  # one plane: any direction would do
        return across / length
    return vectors[:, -1]


def unevenness(steps: list[np.ndarray]) -> float:
    """Median deviation of the steps from their median, relative to it, the larger of both directions."""
    worst = 0.0
    for step in steps:
        middle = np.median(step) if len(step) else 0.0
        worst = max(worst, float(np.median(np.abs(step - middle)) / middle) if middle > 0 else np.inf)
    return worst


def pitch_of(steps: np.ndarray) -> float:
    """Median step from pixel to pixel; of those that are steps at all where most points lie in one place."""
    middle = float(np.median(steps)) if len(steps) else 1.0
    if middle > 0:
        return middle
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
