"""Pairs of windows, side by side: how much more their slopes differ than by chance.

Chance is asked of the view itself: the difference over its nominal error is divided by its own spread over places all
over the view (by the lower quartile: true folds are above), for each size of window; so quantised, smoothed or
correlated noise needs no model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, part, run_slices
from edgel._range_image.facet_fits import HALVES, Facets
from edgel._range_image.noise import even_places, spread

SURE = 6.8  # spreads of chance by which slopes differ where a fold is as likely as not
FAINTEST = 0.1  # of that: what is less is not kept at any strength
MIN_TURN = np.radians(20.0)  # least angle between the planes
GAPS = np.array([0.5, 0.5, 1.0])  # cells between the middle and each window, for each of `HALVES`
MISFIT = 4.0  # noises that a window may leave
EXPLAINED = np.array([1.4, 1.2, 1.1])
"""Of what windows usually leave, for each of `HALVES`: where none leaves more, one plane explains the place."""
BESIDE = 2.0, 0.1  # pixels, and widths of the window, from the middle at which the planes may meet
DIRECTIONS = np.array([(0, 1), (1, 2), (1, 1), (2, 1), (1, 0), (2, -1), (1, -1), (1, -2)], float)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
_SPREAD = 0.25, 0.3186  # quantile of chance that tells its spread, and the normal distribution's: true folds are above
_BAND, _BLOCK = 8, 32  # rows of cells, and cells of a row that are compared in one go (more, and LLVM unrolls no loop)


@dataclass(frozen=True, eq=False)
class WindowPairs:
    """Of the pairs of windows around each cell the one whose slopes differ most, over chance.

    Attributes
    ----------
    score : (I, J) float32
        Difference of their slopes, in multiples of `SURE` spreads of chance; 0 where none is compared.
    best : (I, J) int32
        Which pair: its size times the number of `DIRECTIONS`, and its direction.
    offset : (I, J) float32
        Where their planes meet, in pixels from the cell's middle towards the first window.
    shifts : (S, K, 2) int64
        Cells from the middle to the first window of each pair; the second lies as far on the other side.
    lengths : (S, K) float64
        That distance in pixels.
    widths : (S,) float64
        Widths of the windows in pixels.
    """

    score: np.ndarray
    best: np.ndarray
    offset: np.ndarray
    shifts: np.ndarray
    lengths: np.ndarray
    widths: np.ndarray


def compare_windows(facets: Facets, central: bool) -> WindowPairs:
    """Compare the pairs of windows around the cells that no single plane explains; whether rays leave a viewpoint."""
    shape = facets.noise.shape
    shifts, lengths, widths = _windows(facets)
    chance = _chance(facets, shifts, lengths, widths)
    score, offset = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    best = np.zeros(shape, np.int32)
    run_slices(
        _score, shape[0], facets.ray, facets.plane, facets.noise, facets.ratio, shifts, lengths, chance * SURE,
        widths, central, score, best, offset, size=_BAND,
    )  # fmt: skip
    return WindowPairs(score, best, offset, shifts, lengths, widths)


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


@kernel
def _sample(start, stop, places, ray, plane, noise, ratio, shifts, lengths, widths, values):
    rows, cols = noise.shape
    for p in range(start, stop):
        i, j = places[p]
        if ray[0, i, j] == 0 and ray[1, i, j] == 0 and ray[2, i, j] == 0:
            continue
        for s in range(len(widths)):
            nominal = np.sqrt(24.0) / (widths[s] * widths[s])
            for k in range(shifts.shape[1]):
                a, b, c, d = i + shifts[s, k, 0], j + shifts[s, k, 1], i - shifts[s, k, 0], j - shifts[s, k, 1]
                if min(a, c) < 0 or max(a, c) >= rows or min(b, d) < 0 or max(b, d) >= cols:
                    continue
                left = max(plane[s, 3, a, b], plane[s, 3, c, d])
                if left < MISFIT * noise[i, j] * ratio[s]:
                    turn = 0.0
                    for m in range(3):
                        turn += (plane[s, m, a, b] - plane[s, m, c, d]) * (ray[m, a, b] - ray[m, c, d])
                    left = max(left, noise[i, j] * ratio[s])
                    values[p, s, k] = abs(turn) / (2 * lengths[s, k] * left * nominal)


@kernel
def _score(start, stop, ray, plane, noise, ratio, shifts, lengths, sure, widths, central, score, best, offset):
    """Compare the windows of every size and direction around each cell that no single plane explains.

    In blocks, copied side by side: loops over them, of a length known when they are compiled, run on SIMD.
    """
    rows, cols = noise.shape
    ways = shifts.shape[1]
    block, found = np.empty((18, _BLOCK), np.float32), np.empty((4, _BLOCK), np.float32)
    for i in range(start, stop):
        for at in range(0, cols, _BLOCK):
            if not _begin(i, at, ray, plane, noise, ratio, block, found):
                continue
            for s in range(len(widths)):
                for k in range(ways):
                    down, right = shifts[s, k, 0], shifts[s, k, 1]
                    low, high = max(abs(right) - at, 0), min(cols - abs(right) - at, _BLOCK)
                    if abs(down) > min(i, rows - 1 - i) or low >= high:
                        continue
                    _take(block, 0, i + down, at + low + right, low, high, plane[s], ray)
                    _take(block, 7, i - down, at + low - right, low, high, plane[s], ray)
                    length = 2 * lengths[s, k]
                    nominal = np.sqrt(24.0) / (widths[s] * widths[s]) * sure[s] * length
                    reach = (BESIDE[0] + BESIDE[1] * widths[s] / 2) / length
                    _compare(block, ratio[s], nominal, reach, s * ways + k, found)
            for j in range(min(_BLOCK, cols - at)):
                if found[3, j] < 0:
                    continue
                s, k = int(found[3, j]) // ways, int(found[3, j]) % ways
                down, right = shifts[s, k, 0], shifts[s, k, 1]
                one, two = plane[s, :, i + down, at + j + right], plane[s, :, i - down, at + j - right]
                if _cosine(one, two, central) <= np.cos(MIN_TURN):
                    score[i, at + j], best[i, at + j] = abs(found[0, j]) / found[1, j], s * ways + k
                    offset[i, at + j] = -found[2, j] / found[0, j] * 2 * lengths[s, k]


@part
def _begin(i, at, ray, plane, noise, ratio, block, found):
    """Note the rays and the noise of a block of cells, 0 where one plane explains the place; False where all are."""
    some = False
    block[:] = 0.0
    found[0], found[1], found[2], found[3] = FAINTEST, 1.0, 0.0, -1.0
    for j in range(min(_BLOCK, noise.shape[1] - at)):
        col = at + j
        if ray[0, i, col] == 0 and ray[1, i, col] == 0 and ray[2, i, col] == 0:
            continue
        explained = True
        for s in range(len(ratio)):
            explained = explained and plane[s, 3, i, col] < EXPLAINED[s] * ratio[s] * noise[i, col]
        if not explained:
            block[14, j], block[15, j], block[16, j] = ray[0, i, col], ray[1, i, col], ray[2, i, col]
            block[17, j] = noise[i, col]
            some = True
    return some


@part
def _take(block, to, row, col, low, high, plane, ray):
    """Copy the planes of windows, what they leave, and their rays; those beyond the image leave too much."""
    # Unsigned: Numba lets signed numbers count from the end, which keeps a loop off SIMD.
    row, col, first, count = np.uint64(row), np.uint64(col), np.uint64(low), np.uint64(high - low)
    for j in range(_BLOCK):
        block[to + 3, j] = np.inf
    for m in range(4):
        for j in range(count):
            block[to + m, first + j] = plane[m, row, col + j]
    for m in range(3):
        for j in range(count):
            block[to + 4 + m, first + j] = ray[m, row, col + j]


@part
def _compare(block, ratio, nominal, reach, tag, found):
    """Keep a pair of windows where its slopes differ more, over chance, and its planes meet near the middle."""
    ratio, nominal, reach, tag = np.float32(ratio), np.float32(nominal), np.float32(reach), np.float32(tag)
    for j in range(_BLOCK):
        x, y, z = block[0, j] - block[7, j], block[1, j] - block[8, j], block[2, j] - block[9, j]
        turn = x * (block[4, j] - block[11, j]) + y * (block[5, j] - block[12, j]) + z * (block[6, j] - block[13, j])
        gap = x * block[14, j] + y * block[15, j] + z * block[16, j]
        sigma = block[17, j] * ratio
        left = max(block[3, j], block[10, j])
        chance = max(left, sigma) * nominal
        better = (left < np.float32(MISFIT) * sigma) & (abs(gap) <= reach * abs(turn))
        better = better & (abs(turn) * found[1, j] > abs(found[0, j]) * chance)
        found[0, j] = turn if better else found[0, j]
        found[1, j] = chance if better else found[1, j]
        found[2, j] = gap if better else found[2, j]
        found[3, j] = tag if better else found[3, j]


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
