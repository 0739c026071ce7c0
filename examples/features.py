"""Edges as features of a classifier: tell the points of three kinds of parts by what edges say around each.

    python examples/features.py                                 # pip install scikit-learn

How likely a crease and a boundary are at a point, and at its nearest points, is what a forest learns from here. For
clouds of your own put their points and labels in the place of `made`.
"""

import numpy as np
from sklearn.ensemble import RandomForestClassifier  # pyright: ignore[reportMissingImports]
from sklearn.neighbors import NearestNeighbors  # pyright: ignore[reportMissingImports]

import edgel
from edgel import synth

PARTS = {"gear": synth.gear, "cube fractal": synth.cube_fractal, "sphere": synth.sphere}


def made(seed: int) -> list[tuple[np.ndarray, int]]:
    """Sample each part as a scanner would; replace it by your own clouds and their labels."""
    return [
        (synth.sample(part(), spacing=3.0, noise=0.1, seed=seed).cloud.xyz, i) for i, part in enumerate(PARTS.values())
    ]


def features(points: np.ndarray) -> np.ndarray:
    """Return the probabilities of each point and, of its 64 nearest, their means and maxima (N, 6)."""
    own = edgel.probabilities(points)
    near = NearestNeighbors(n_neighbors=64).fit(points).kneighbors(points, return_distance=False)
    return np.hstack([own, own[near].mean(axis=1), own[near].max(axis=1)])


def table(clouds: list[tuple[np.ndarray, int]]) -> tuple[np.ndarray, np.ndarray]:
    """Put the features of all points below one another, and the label of each."""
    parts = [(features(points), np.full(len(points), label)) for points, label in clouds]
    return np.vstack([x for x, _ in parts]), np.concatenate([y for _, y in parts])


def main() -> None:
    """Learn from one scan of each part, and try another."""
    x, y = table(made(seed=1))
    forest = RandomForestClassifier(100, max_depth=12, random_state=0).fit(x, y)
    x, y = table(made(seed=2))
    print(f"{len(y):,} points of {len(PARTS)} parts: {forest.score(x, y):.1%} are told right")


if __name__ == "__main__":
    main()
