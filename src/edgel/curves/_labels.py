"""Where labels of a drawing stand, so that none covers another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SIZE = 3.0
"""Millimetres on paper."""
_WIDE = 0.6  # of the size: a letter
_GAP = 0.5  # millimetres, between a label and its curve
_ALONG = (0.5, 0.3, 0.7, 0.15, 0.85)


def place_labels(
    paths: Sequence[np.ndarray], labels: Sequence[str], importance: np.ndarray, width: float, height: float
) -> dict[int, tuple[float, float]]:
    """Return where labels begin, x and y of their base lines, by the number of the curve.

    The most important come first; each stands beside its curve, where there is room on paper. What finds none is left
    out. Takes the paths on paper, y downwards.
    """
    taken: list[tuple[float, float, float, float]] = []
    places: dict[int, tuple[float, float]] = {}
    for curve in np.argsort(-importance, kind="stable").tolist():
        if not labels[curve]:
            continue
        wide = _WIDE * SIZE * len(labels[curve])
        for x, y in _candidates(paths[curve], wide):
            box = (x, y - SIZE, x + wide, y)
            on_paper = box[0] >= 0 and box[1] >= 0 and box[2] <= width and box[3] <= height
            if on_paper and not any(_meet(box, other) for other in taken):
                taken.append(box)
                places[curve] = (x, y)
                break
    return places


def _candidates(path: np.ndarray, wide: float) -> list[tuple[float, float]]:
    """Return places above, below, right and left of a path, in its middle first."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    found = []
    for share in _ALONG:
        x, y = (float(np.interp(share * along[-1], along, path[:, axis])) for axis in range(2))
        found += [
            (x - 0.5 * wide, y - _GAP), (x - 0.5 * wide, y + SIZE + _GAP),
            (x + _GAP, y + 0.5 * SIZE), (x - wide - _GAP, y + 0.5 * SIZE),
        ]  # fmt: skip
    return found


def _meet(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
