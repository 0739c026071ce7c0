"""Selection and sorting of keys: the value at a rank without sorting all, and a few points sorted by counting."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import routine
from edgel._kernels.simd import (
    LANES,
    as_floats,
    counted,
    counts_of,
    larger,
    largest_of,
    load,
    load_padded,
    spread,
    store,
    where,
)

_RANKED = 64  # so few keys are ranked by counting
_SAMPLE, _SPREAD = 32, 4  # keys of a sample, and how many of them lie between the median and either end of a window


@routine
def _ranked(keys, count, low_rank, high_rank):
    """Values at two ranks of the first `count` keys, by counting how many are smaller than each.

    The array of the keys goes on to a multiple of eight.
    """
    for p in range(count, (count + LANES - 1) // LANES * LANES):
        keys[p] = np.inf
    low, high = spread(-np.inf), spread(-np.inf)
    for p in range(0, count, LANES):
        v, less = load(keys, p), counts_of(0)
        for q in range(count):
            less = counted(less, v > keys[q])
        low = larger(low, where(less <= low_rank, v, -np.inf))
        high = larger(high, where(less <= high_rank, v, -np.inf))
    return largest_of(low), largest_of(high)


@routine
def _kept(source, first, count, low, high, scratch):
    """Copy the keys from `low` on and below `high` to `scratch`; returns how many lie below `low`, how many between."""
    below, kept = 0, 0
    for p in range(first, first + count):
        v = source[p]
        scratch[kept] = v  # written in any case and overwritten by the next: no branch to guess
        below += v < low
        kept += (v >= low) & (v < high)
    return below, kept


@routine
def value_at(rank, keys, first, count, scratch):
    """Value that would lie at `rank` were keys[first : first + count] sorted; `scratch` holds as many, and 8 more.

    Two values of a sample, which most likely lie on either side of it, leave a quarter of the keys (Floyd & Rivest
    1975), and again, until they can be counted.
    """
    low, high = -np.inf, np.inf
    below, kept = _kept(keys, first, count, low, high, scratch) if count <= _RANKED else (0, count)
    source, start = keys, first
    sample = np.empty(_SAMPLE)
    while kept > _RANKED:
        for i in range(_SAMPLE):
            sample[i] = source[start + i * kept // _SAMPLE]
        middle = (rank - below) * _SAMPLE // kept
        near, far = _ranked(sample, len(sample), max(middle - _SPREAD, 0), min(middle + _SPREAD, _SAMPLE - 1))
        far = np.nextafter(far, np.inf)
        under, between = _kept(source, start, kept, near, far, scratch)
        if between == kept:  # many equal keys
            half = len(sample) // 2
            near, _ = _ranked(sample, len(sample), half, half)
            far = np.nextafter(near, np.inf)
            under, between = _kept(keys, first, count, near, far, scratch)
            under -= below
        source, start = scratch, 0
        if under <= rank - below < under + between:
            low, high, below, kept = near, far, below + under, between
            if np.nextafter(low, np.inf) == high:
                return low
            continue
        if rank - below < under:
            high = near
        else:
            low = far
        below, kept = _kept(keys, first, count, low, high, scratch)
    return _ranked(scratch, kept, rank - below, rank - below)[0]


@routine
def select(values, count, rank):
    """Value that would lie at `rank` were the first `count` sorted; moves it there (Hoare 1961)."""
    low, high = 0, count - 1
    while low < high:
        pivot, i, j = values[(low + high) // 2], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if rank <= j:
            high = j
        elif rank >= i:
            low = i
        else:
            break
    return values[rank]


@routine
def quantile(values, count, share):
    """Value below which a share of the first `count` lie, between two of them along a line; moves them."""
    place = (count - 1) * share
    rank = int(place)
    lower = select(values, count, rank)
    upper = values[min(rank + 1, count - 1)]
    for i in range(rank + 2, count):
        upper = min(upper, values[i])
    return lower * (1.0 - (place - rank)) + upper * (place - rank)


@routine
def sort_places(key, second, third, order, first, last):
    """Sort places first..last-1 by four arrays, the first before the second and so on (Shell 1959)."""
    gap = 1
    while 3 * gap + 1 < last - first:
        gap = 3 * gap + 1
    while gap > 0:
        for p in range(first + gap, last):
            a, b, c, row, to = key[p], second[p], third[p], order[p], p
            while to - gap >= first:
                q = to - gap
                if key[q] != a:
                    if key[q] < a:
                        break
                elif second[q] != b:
                    if second[q] < b:
                        break
                elif third[q] < c or (third[q] == c and order[q] <= row):
                    break
                key[to], second[to], third[to], order[to] = key[q], second[q], third[q], order[q]
                to = q
            key[to], second[to], third[to], order[to] = a, b, c, row
        gap //= 3


@routine
def sort_leaf(axis, xyz, order, to_xyz, to_order, first, last, ranks):
    """Sort a leaf by an axis from one pair of arrays into the other: the rank of a point is how many lie before it.

    Counting ranks takes a fifth of the time of `sort_places`, which is left for equal coordinates.
    """
    key, second, third = xyz[axis], xyz[(axis + 1) % 3], xyz[(axis + 2) % 3]
    to_key, to_second, to_third = to_xyz[axis], to_xyz[(axis + 1) % 3], to_xyz[(axis + 2) % 3]
    count, total = last - first, 0
    for p in range(0, count, LANES):
        v, before = load_padded(key, first + p), counts_of(0)
        for q in range(first, last):
            before = counted(before, v > key[q])
        store(ranks, p, as_floats(before))
    for p in range(count):
        total += int(ranks[p])
    tied = total < count * (count - 1) // 2
    for p in range(count):
        to = first + (p if tied else int(ranks[p]))
        to_key[to], to_second[to], to_third[to] = key[first + p], second[first + p], third[first + p]
        to_order[to] = order[first + p]
    if tied:
        sort_places(to_key, to_second, to_third, to_order, first, last)
