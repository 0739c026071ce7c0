"""Folds: where the planes of two windows, side by side, meet on the line between them.

Their slopes have to differ by more than chance, as the view itself shows it. The smooth alternative is a parabola: on
one, the surface between the windows leaves their planes much farther than beside a fold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.hysteresis import levels
from edgel._kernels.parallel import kernel, part, run_slices
from edgel._range_image.facet_fits import Facets
from edgel._range_image.rays import Rays
from edgel._range_image.window_pairs import BESIDE, DIRECTIONS, FAINTEST, compare_windows

WEAK = 0.5  # of what is sure, where a fold continues a sure one
CHAIN = 5  # cells: chains that are shorter are specks
PARABOLA = 0.3, 0.7  # pixels, and shares of what a parabola does, by which a fold's middle may leave its planes
_BAND = 8  # rows of cells


@dataclass(frozen=True, eq=False)
class Folds:
    """Lines on which planes meet, one a cell.

    Attributes
    ----------
    level : (M,) float64
        Highest threshold, in multiples of what is likely, at which hysteresis keeps it.
    cell : (M, 2) int64
        Row and column of the cell.
    first, second : (M, 3) float32
        The planes that meet.
    across : (M, 2) float64
        Unit vector in the image from the second to the first, rows and columns of pixels.
    offset : (M,) float64
        Where the line runs from the middle of the cell, in pixels along `across`.
    convex : (M,) bool
        Whether the surface falls away from the viewer on both sides.
    """

    level: np.ndarray
    cell: np.ndarray
    first: np.ndarray
    second: np.ndarray
    across: np.ndarray
    offset: np.ndarray
    convex: np.ndarray


def no_folds() -> Folds:
    """What is found where none are looked for."""
    return Folds(
        np.zeros(0), np.zeros((0, 2), np.int64), np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32),
        np.zeros((0, 2)), np.zeros(0), np.zeros(0, bool),
    )  # fmt: skip


def find_folds(rays: Rays, facets: Facets) -> Folds:
    """Find the folds of a range image."""
    pairs = compare_windows(facets, rays.central)
    kept = np.zeros(pairs.score.shape, np.float32)
    run_slices(
        _thin, len(kept), pairs.score, pairs.best, pairs.offset, pairs.shifts, pairs.lengths, pairs.widths,
        facets.ray, facets.plane, rays.ray, rays.near, facets.cell, kept, size=_BAND,
    )  # fmt: skip
    places, level = levels(kept, WEAK, CHAIN, WEAK * FAINTEST)
    row, col = np.divmod(places, facets.noise.shape[1])
    size, way = np.divmod(pairs.best[row, col], len(DIRECTIONS))
    down, right = pairs.shifts[size, way].T
    step = pairs.shifts[size, way] * facets.cell * (facets.stretch, 1.0)
    one, other = (size, row + down, col + right), (size, row - down, col - right)
    first, second = (facets.plane[at[0], :3, at[1], at[2]] for at in (one, other))
    between = (facets.ray[:3, row + down, col + right] - facets.ray[:3, row - down, col - right]).T
    return Folds(
        level,
        np.column_stack([row, col]),
        first,
        second,
        step / np.linalg.norm(step, axis=1, keepdims=True),
        pairs.offset[row, col].astype(np.float64),
        ((first - second) * between).sum(axis=1) < 0,
    )


@kernel
def _thin(start, stop, score, best, offset, shifts, lengths, widths, ray, plane, rays, near, cell, kept):
    """Keep what is largest across the line, unless the surface between the windows is as smooth as a parabola."""
    rows, cols = score.shape
    ways = shifts.shape[1]
    for i in range(start, stop):
        for j in range(cols):
            if score[i, j] == 0:
                continue
            own = _weight(score, best, offset, widths, ways, i, j)
            s, k = best[i, j] // ways, best[i, j] % ways
            largest = True
            for apart in (-2, -1, 1, 2):
                r = i + round(apart * DIRECTIONS[k, 0])
                c = j + round(apart * DIRECTIONS[k, 1])
                if r < 0 or r >= rows or c < 0 or c >= cols or score[r, c] == 0:
                    continue
                other = _weight(score, best, offset, widths, ways, r, c)
                if other > own or (other == own and apart < 0):
                    largest = False
                    break
            if not largest:
                continue
            down, right = shifts[s, k, 0], shifts[s, k, 1]
            first, second = plane[s, :, i + down, j + right], plane[s, :, i - down, j - right]
            # The place where the line runs, and how far the surface leaves the mean of both planes there.
            length = lengths[s, k]
            row = int(i * cell[0] + (cell[0] - 1) / 2 + offset[i, j] * down * cell[0] / length + 0.5)
            col = int(j * cell[1] + (cell[1] - 1) / 2 + offset[i, j] * right * cell[1] / length + 0.5)
            total, count = 0.0, 0
            for r in range(max(row - 1, 0), min(row + 2, near.shape[0])):
                for c in range(max(col - 1, 0), min(col + 2, near.shape[1])):
                    if near[r, c] == near[r, c]:
                        total += near[r, c]
                        for m in range(3):
                            total -= 0.5 * (first[m] + second[m]) * rays[r, c, m]
                        count += 1
            turn = 0.0
            for m in range(3):
                turn += (first[m] - second[m]) * (ray[m, i + down, j + right] - ray[m, i - down, j - right])
            if count == 0 or turn == 0.0:
                continue
            leaves = abs(total / count / turn) * 2 * length
            half = widths[s] / 2
            parabola = (length * length - half * half / 3) / (4 * length)
            if leaves < PARABOLA[0] + PARABOLA[1] * parabola:
                kept[i, j] = score[i, j]


@part
def _weight(score, best, offset, widths, ways, i, j):
    """Score, falling with the distance from the line."""
    reach = BESIDE[0] + BESIDE[1] * widths[best[i, j] // ways] / 2
    away = offset[i, j] / reach
    return score[i, j] * (1.0 - away * away)
