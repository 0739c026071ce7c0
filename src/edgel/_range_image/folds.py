"""Folds: where the planes of two windows, side by side, meet on the line between them.

Whether their slopes differ by chance is asked of the view itself: the difference over its nominal error is divided by
its own spread over places all over the view (by the lower quartile: true folds are above), for each size of window; so
quantised, smoothed or correlated noise needs no model. The smooth alternative is a parabola: on one, the surface
between the windows leaves their planes much farther than beside a fold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.hysteresis import levels
from edgel._kernels.parallel import kernel, part, run_slices
from edgel._range_image.facet_fits import HALVES, Facets
from edgel._range_image.noise import even_places, spread
from edgel._range_image.rays import Rays

SURE = 6.0  # spreads of chance by which slopes differ where a fold is as likely as not
FAINTEST = 0.1  # of that: what is less is not kept at any strength
WEAK = 0.5  # of that, where a fold continues a sure one
CHAIN = 5  # cells: chains that are shorter are specks
MIN_TURN = np.radians(20.0)  # least angle between the planes
GAPS = np.array([0.5, 0.5, 1.0])  # cells between the middle and each window, for each of `HALVES`
MISFIT = 4.0  # noises that a window may leave
EXPLAINED = np.array([1.4, 1.2, 1.1])
"""Of what windows leave in the median, for each of `HALVES`: where none leaves more, one plane explains the place."""
BESIDE = 2.0, 0.1  # pixels, and widths of the window, from the middle at which the planes may meet
PARABOLA = 0.3, 0.7  # pixels, and shares of what a parabola does, by which a fold's middle may leave its planes
DIRECTIONS = np.array([(0, 1), (1, 2), (1, 1), (2, 1), (1, 0), (2, -1), (1, -1), (1, -2)], float)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
_SPREAD = 0.25, 0.3186  # quantile of chance that tells its spread, and the normal distribution's: true folds are above
_BAND = 8  # rows of cells


@dataclass(frozen=True, eq=False)
class Folds:
    """Lines on which planes meet, one a cell.

    Attributes
    ----------
    level : (M,) float64
        Highest threshold, in multiples of `SURE`, at which hysteresis keeps it.
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
    shape = facets.noise.shape
    shifts, lengths, widths = _windows(facets)
    chance = _chance(facets, shifts, lengths, widths)
    score, best = np.zeros(shape, np.float32), np.zeros(shape, np.int32)
    offset = np.zeros(shape, np.float32)
    run_slices(
        _score, shape[0], facets.ray, facets.plane, facets.noise, facets.ratio, shifts, lengths, chance * SURE,
        widths, rays.central, score, best, offset, size=_BAND,
    )  # fmt: skip
    kept = np.zeros(shape)
    run_slices(
        _thin, shape[0], score, best, offset, shifts, lengths, widths, facets.ray, facets.plane, rays.ray,
        rays.near, facets.cell, kept, size=_BAND,
    )  # fmt: skip
    level = levels(kept, WEAK, CHAIN)
    row, col = np.nonzero(level)
    chosen = best[row, col]
    size, way = np.divmod(chosen, len(DIRECTIONS))
    down, right = shifts[size, way].T
    step = shifts[size, way] * facets.cell * (facets.stretch, 1.0)
    one, other = (size, row + down, col + right), (size, row - down, col - right)
    first, second = facets.plane[one][:, :3], facets.plane[other][:, :3]
    between = facets.ray[one[1:]][:, :3] - facets.ray[other[1:]][:, :3]
    return Folds(
        level[row, col],
        np.column_stack([row, col]),
        first,
        second,
        step / np.linalg.norm(step, axis=1, keepdims=True),
        offset[row, col].astype(np.float64),
        ((first - second) * between).sum(axis=1) < 0,
    )


def _windows(facets: Facets) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells from the middle to each window (S, K, 2), that distance in pixels (S, K), and the widths in pixels (S,)."""
    reach = HALVES + 0.5 + GAPS
    shifts = np.round(reach[:, None, None] * DIRECTIONS).astype(np.int64)
    lengths = np.linalg.norm(shifts * facets.cell * (facets.stretch, 1.0), axis=2)
    return shifts, lengths, (2 * HALVES + 1) * np.sqrt(facets.cell[0] * facets.stretch * facets.cell[1])


def _chance(facets: Facets, shifts: np.ndarray, lengths: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """Spread of the difference of slopes over its nominal error, for each size of window, over the whole view."""
    places = even_places(facets.noise.shape)
    values = np.full((len(places), len(HALVES), len(DIRECTIONS)), np.nan, np.float32)
    run_slices(
        _sample, len(places), places, facets.ray, facets.plane, facets.noise, facets.ratio, shifts, lengths,
        widths, values, size=128,
    )  # fmt: skip
    return np.array([spread(values[:, s], *_SPREAD) for s in range(len(HALVES))])


@part
def _compare(i, j, down, right, length, ray, plane, noise):
    """Difference of slopes per pixel and of values in the middle, and the noise: infinite where none is known."""
    rows, cols = ray.shape[0], ray.shape[1]
    a, b, c, d = i + down, j + right, i - down, j - right
    if min(a, c) < 0 or max(a, c) >= rows or min(b, d) < 0 or max(b, d) >= cols:
        return 0.0, 0.0, np.inf
    left = max(plane[a, b, 3], plane[c, d, 3])
    if not left < MISFIT * noise:
        return 0.0, 0.0, np.inf
    turn = gap = 0.0
    for k in range(3):
        differs = plane[a, b, k] - plane[c, d, k]
        turn += differs * (ray[a, b, k] - ray[c, d, k])
        gap += differs * ray[i, j, k]
    return turn / (2 * length), gap, max(left, noise)


@kernel
def _sample(start, stop, places, ray, plane, noise, ratio, shifts, lengths, widths, values):
    for p in range(start, stop):
        i, j = places[p]
        if ray[i, j, 0] == 0 and ray[i, j, 1] == 0 and ray[i, j, 2] == 0:
            continue
        for s in range(len(widths)):
            nominal = np.sqrt(24.0) / (widths[s] * widths[s])
            for k in range(shifts.shape[1]):
                turn, _, left = _compare(
                    i, j, shifts[s, k, 0], shifts[s, k, 1], lengths[s, k], ray, plane[s], noise[i, j] * ratio[s]
                )
                if left < np.inf:
                    values[p, s, k] = abs(turn) / (left * nominal)


@kernel
def _score(start, stop, ray, plane, noise, ratio, shifts, lengths, sure, widths, central, score, best, offset):
    cols = noise.shape[1]
    cosine = np.cos(MIN_TURN)
    ways = shifts.shape[1]
    for i in range(start, stop):
        for j in range(cols):
            if ray[i, j, 0] == 0 and ray[i, j, 1] == 0 and ray[i, j, 2] == 0:
                continue
            explained = True
            for s in range(len(widths)):
                explained = explained and plane[s, i, j, 3] < EXPLAINED[s] * ratio[s] * noise[i, j]
            if explained:
                continue
            for s in range(len(widths)):
                nominal = np.sqrt(24.0) / (widths[s] * widths[s]) * sure[s]
                # Every other direction first, then those beside the best of them, or all where none could be compared.
                steepest, middle = 0.0, -1
                for n in range(ways):
                    k = 2 * n if n < ways // 2 else 2 * n - ways + 1
                    if n >= ways // 2 and middle >= 0 and k != (middle + 1) % ways and k != (middle + ways - 1) % ways:
                        continue
                    down, right = shifts[s, k, 0], shifts[s, k, 1]
                    turn, gap, left = _compare(i, j, down, right, lengths[s, k], ray, plane[s], noise[i, j] * ratio[s])
                    value = abs(turn) / (left * nominal)
                    if n < ways // 2 and value > steepest:
                        steepest, middle = value, k
                    if value < FAINTEST or not value > score[i, j]:
                        continue
                    if abs(gap) > (BESIDE[0] + BESIDE[1] * widths[s] / 2) * abs(turn):
                        continue
                    if _cosine(plane[s, i + down, j + right], plane[s, i - down, j - right], central) > cosine:
                        continue
                    score[i, j], best[i, j], offset[i, j] = value, s * ways + k, -gap / turn


@part
def _cosine(first, second, central):
    """Cosine of the angle between the normals of two planes."""
    dot = a2 = b2 = 0.0
    for m in range(3):
        a, b = np.float64(first[m]), np.float64(second[m])
        if m == 2 and not central:
            a = b = 1.0
        dot += a * b
        a2 += a * a
        b2 += b * b
    return dot / np.sqrt(a2 * b2) if a2 * b2 > 0.0 else 1.0


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
            first, second = plane[s, i + down, j + right], plane[s, i - down, j - right]
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
                turn += (first[m] - second[m]) * (ray[i + down, j + right, m] - ray[i - down, j - right, m])
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
