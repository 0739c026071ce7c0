"""Boosted decision trees: the sum of what many small trees say of a row of numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import IO

import numpy as np

from edgel.parallel import kernel, run_slices


@dataclass(frozen=True, eq=False)
class Forest:
    """Trees for `evaluate`, laid out one after the other.

    Attributes
    ----------
    roots : (T,) int32
        First node of each tree.
    feature : (M,) int16
        The feature a node asks for; -1 in a leaf.
    threshold : (M,) float32
        A row goes left where its feature is at most this; the value of a leaf.
    right : (M,) int32
        Where a row goes on that does not go left; left is the next node.
    """

    roots: np.ndarray
    feature: np.ndarray
    threshold: np.ndarray
    right: np.ndarray


def read_forests(file: str | IO[bytes]) -> dict[str, Forest]:
    """Read the forests of an NPZ file, by name."""
    with np.load(file) as stored:
        names = dict.fromkeys(key.split(".")[0] for key in stored)
        return {n: Forest(*(stored[f"{n}.{key}"] for key in Forest.__dataclass_fields__)) for n in names}


def evaluate(forest: Forest, features: np.ndarray) -> np.ndarray:
    """Return the probability (N,) float64 that the forest gives each row of features (N, F) float32."""
    result = np.empty(len(features))
    run_slices(_evaluate, len(features), forest.roots, forest.feature, forest.threshold, forest.right, features, result)
    return result


@kernel
def probability(row, roots, feature, threshold, right):
    """Return the probability that trees, laid out as in `Forest`, give one row of features."""
    total = 0.0
    for root in roots:
        node = root
        while feature[node] >= 0:
            node = node + 1 if row[feature[node]] <= threshold[node] else right[node]
        total += threshold[node]
    return 1.0 / (1.0 + math.exp(-total))


@kernel
def _evaluate(start, stop, roots, feature, threshold, right, features, result):
    for row in range(start, stop):
        result[row] = probability(features[row], roots, feature, threshold, right)
