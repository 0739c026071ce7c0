"""Search the k nearest of eight queries in step, one in each lane.

What a group of queries may need is gathered once: the blocks of eight points within reach of all of them. Their squared
distances are computed without a branch, and the k smallest of each lane are told from the others by a limit, which is
found by counting: nothing is sorted. The reach is a guess from the group before; a lane that finds fewer than k within
it has the group searched again, farther.
"""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import part, routine
from edgel._kernels.simd import (
    LANES,
    as_floats,
    bits,
    counted,
    counts_of,
    larger,
    largest_of,
    load,
    smaller,
    smallest_of,
    spread,
    store,
    where,
    where_counts,
)
from edgel._neighbors.candidates import SLACK, kth_distance, select_blocks, traverse

_LESS = 1.0 - 2.0**-52  # of a number, the next smaller or the one after it
_ROUNDS = 20  # counts after which the points between too few and too many are sorted instead


@part
def _measure(tree, scratch, count, reach):
    """Compute the squared distances of the blocks found; returns how many of each lane are within reach."""
    x, y, z, squared, found = tree.x, tree.y, tree.z, scratch.squared, scratch.found
    num_points = len(x)
    qx, qy, qz = load(scratch.queries, 0), load(scratch.queries, LANES), load(scratch.queries, 2 * LANES)
    within = counts_of(0)
    for i in range(count):
        first = LANES * found[i]
        if first + LANES > num_points:  # the last, not a whole one
            for j in range(LANES):
                store(squared, (i * LANES + j) * LANES, spread(np.inf))
        for j in range(min(LANES, num_points - first)):
            dx, dy, dz = x[first + j] - qx, y[first + j] - qy, z[first + j] - qz
            d = dx * dx + dy * dy + dz * dz
            store(squared, (i * LANES + j) * LANES, d)
            within = counted(within, d <= reach)
    return within


@part
def _divide(scratch, count, k, reach, within):
    """Find the limit of each lane within which exactly k points lie, by counting; returns which lanes have one.

    The counts grow about evenly with the squared distance on a surface, so the next limit to try is interpolated; where
    one point too few or too many lies within, the next distance itself is the limit: 3.5 counts on average, 7.9
    without. The first try are the limits of the group before.
    """
    squared, points = scratch.squared, count * LANES * LANES
    none, beyond = spread(-1.0), spread(np.inf)
    low, above, high, fewer, more = none, none, spread(reach), counts_of(0), within
    limit = smaller(load(scratch.limits, 0), high)
    for step in range(_ROUNDS):
        # Two points at a time, each with its own results: the next need not wait for the one before.
        inside, under, over = counts_of(0), none, beyond
        inside_2, under_2, over_2 = inside, under, over
        for i in range(0, points, 2 * LANES):
            d, d_2 = load(squared, i), load(squared, i + LANES)
            nearer, nearer_2 = d <= limit, d_2 <= limit
            inside, inside_2 = counted(inside, nearer), counted(inside_2, nearer_2)
            under, under_2 = larger(under, where(nearer, d, none)), larger(under_2, where(nearer_2, d_2, none))
            over, over_2 = smaller(over, where(nearer, beyond, d)), smaller(over_2, where(nearer_2, beyond, d_2))
        inside, under, over = inside + inside_2, larger(under, under_2), smaller(over, over_2)
        low, fewer = where(inside < k, limit, low), where_counts(inside < k, inside, fewer)
        above = where(inside < k, over, above)
        high, more = where(inside >= k, under, high), where_counts(inside >= k, inside, more)
        one_less, one_more = inside == k - 1, inside == k + 1
        share = (k + 0.5 - as_floats(fewer)) / (as_floats(more) - as_floats(fewer))
        share = share if step % 3 < 2 else spread(0.5)
        # Where exactly k lie within the reach the share is above one; beyond it other points may lie.
        limit = where(inside == k, limit, smaller(low + (high - low) * share, high))
        limit = where(one_less, over, where(one_more, under * _LESS, limit))
        if bits(one_less | one_more | (inside == k) | (above == high)) == 255:  # the last: nothing but ties between
            break
    inside = counts_of(0)
    for i in range(0, points, LANES):
        inside = counted(inside, load(squared, i) <= limit)
    store(scratch.limits, 0, where(inside <= k, limit, low))
    store(scratch.ends, 0, where(inside >= k, limit, high))
    return bits(inside == k)


@part
def first_of(x, y, z, order, a, b):
    """Whether the point at place a comes before that at b by x, y, z; duplicates by their number."""
    if x[a] != x[b]:
        return x[a] < x[b]
    if y[a] != y[b]:
        return y[a] < y[b]
    if z[a] != z[b]:
        return z[a] < z[b]
    return order[a] < order[b]


@part
def _before(x, y, z, order, found, squared, lane, i, j):
    """Whether the i-th point of the blocks found comes before the j-th: by distance, then by coordinates."""
    a, b = squared[i * LANES + lane], squared[j * LANES + lane]
    if a != b:
        return a < b
    return first_of(x, y, z, order, LANES * found[i // LANES] + i % LANES, LANES * found[j // LANES] + j % LANES)


@routine
def _settle(tree, scratch, count, k, lane):
    """Where the k-th distance equals the next one, leave only the points of smallest coordinates within the limit."""
    # Taken out of their tuples once: each time costs two atomic operations, for the count of references.
    x, y, z, order, found, squared = tree.x, tree.y, tree.z, tree.order, scratch.found, scratch.squared
    low, high, missing = scratch.limits[lane], scratch.ends[lane], k
    for i in range(count * LANES):
        missing -= squared[i * LANES + lane] <= low
    if missing < 1:  # no distance between the limits is a number
        return
    nearest, kept = np.zeros(missing, np.int64), 0
    for i in range(count * LANES):
        d = squared[i * LANES + lane]
        if d <= low or d > high:
            continue
        slot = kept
        while slot > 0 and _before(x, y, z, order, found, squared, lane, i, nearest[slot - 1]):
            if slot < missing:
                nearest[slot] = nearest[slot - 1]
            slot -= 1
        if slot < missing:
            nearest[slot] = i
            kept = min(kept + 1, missing)
    last = nearest[missing - 1]
    limit = squared[last * LANES + lane]
    for i in range(count * LANES):
        if squared[i * LANES + lane] == limit and i != last and _before(x, y, z, order, found, squared, lane, last, i):
            squared[i * LANES + lane] = np.inf
    scratch.limits[lane] = limit


@part
def _search(tree, scratch, size, near, near_reach, reach, k):
    """Find the k nearest of the first `size` queries in `scratch`: see `nearest_of_eight`."""
    qx, qy, qz = load(scratch.queries, 0), load(scratch.queries, LANES), load(scratch.queries, 2 * LANES)
    low_x, low_y, low_z = smallest_of(qx), smallest_of(qy), smallest_of(qz)
    high_x, high_y, high_z = largest_of(qx), largest_of(qy), largest_of(qz)
    dx, dy, dz = high_x - low_x, high_y - low_y, high_z - low_z
    diagonal = dx * dx + dy * dy + dz * dz
    if size == LANES and diagonal > 0.0:
        # Where the points suddenly lie closer than those before, the size of the group itself says so.
        reach = min(reach, diagonal * k / LANES)
    count, within = 0, counts_of(0)
    for attempt in range(3):
        if attempt == 2 or not reach < np.inf:  # no more guesses: what one needs, and how far the others lie from it
            sure = math.sqrt(
                kth_distance(tree, scratch.queries[0], scratch.queries[LANES], scratch.queries[2 * LANES], k)
            )
            reach = (sure + math.sqrt(diagonal)) ** 2 * (1.0 + 1e-12)
        if reach <= near_reach:
            count = select_blocks(scratch, near, low_x, low_y, low_z, high_x, high_y, high_z, reach)
        else:
            count = traverse(tree, low_x, low_y, low_z, high_x, high_y, high_z, reach, k, scratch.found)
        if count < 0:
            return -1, reach
        within = _measure(tree, scratch, count, reach)
        if bits(within >= k) == 255:
            break
        reach *= 2.0
    settled = _divide(scratch, count, k, reach, within)
    for lane in range(size):
        if not (settled >> lane) & 1:
            _settle(tree, scratch, count, k, lane)
    return count, SLACK * largest_of(load(scratch.limits, 0))


@part
def _ask(queries, q, scratch, lane):
    """Put a query into a lane."""
    scratch.queries[lane] = queries.x[q]
    scratch.queries[LANES + lane] = queries.y[q]
    scratch.queries[2 * LANES + lane] = queries.z[q]


@part
def nearest_of_eight(tree, queries, first, last, begin, near, near_reach, reach, k, scratch):
    """Find the k nearest of the next queries of first..last-1, from `begin` on.

    Returns
    -------
    size : int
        How many queries were answered: eight unless fewer are left, one where they lie too far apart, or none where
        `scratch` is too small even for one: try again in a `larger_scratch`.
    count : int
        How many blocks were found. Point j of block i is among the k nearest of the query in a lane where
        ``scratch.squared[(8 i + j) 8 + lane] <= scratch.limits[lane]``; always exactly k are.
    reach : float
        Squared reach that the next queries may need.
    """
    size = min(LANES, last - begin)
    if (begin - first) % LANES == 0:
        if size == LANES:
            store(scratch.queries, 0, load(queries.x, begin))
            store(scratch.queries, LANES, load(queries.y, begin))
            store(scratch.queries, 2 * LANES, load(queries.z, begin))
        else:
            for lane in range(LANES):
                _ask(queries, begin + min(lane, size - 1), scratch, lane)
        count, farther = _search(tree, scratch, size, near, near_reach, reach, k)
        if count >= 0:
            return size, count, farther
    for lane in range(LANES):
        _ask(queries, begin, scratch, lane)
    count, farther = _search(tree, scratch, 1, near, -1.0, np.inf, k)
    return (1, count, farther) if count >= 0 else (0, 0, reach)
