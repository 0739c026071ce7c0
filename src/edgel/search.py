"""Search the k nearest of eight queries in step, one in each lane.

What a group of queries may need is gathered once: the blocks of eight points within reach of all of them. Their squared
distances are computed without a branch, and the k smallest of each lane are told from the others by a limit, which is
found by counting: nothing is sorted. The reach is a guess from the group before; a lane that finds fewer than k within
it has the group searched again, farther.
"""

from __future__ import annotations

import numpy as np

from edgel.blocks import SLACK, pick, sure_reach, walk
from edgel.lanes import (
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
from edgel.parallel import kernel, part

_LESS = 1.0 - 2.0**-52  # of a number, the next smaller or the one after it
_ROUNDS = 20  # after so many counts a lane's k-th and next distance are taken to be equal


@part
def _measure(tree, room, count, reach):
    """Compute the squared distances of the blocks found; returns how many of each lane are within reach."""
    x, y, z, squared, found = tree.x, tree.y, tree.z, room.squared, room.found
    num_points = len(x)
    qx, qy, qz = load(room.queries, 0), load(room.queries, LANES), load(room.queries, 2 * LANES)
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
def _divide(room, count, k, reach, within):
    """Find the limit of each lane within which exactly k points lie, by counting; returns which lanes have one.

    The counts grow about evenly with the squared distance on a surface, so the next limit to try is interpolated; where
    one point too few or too many lies within, the next distance itself is the limit: 3.5 counts on average, 7.9
    without. The first try are the limits of the group before.
    """
    squared, points = room.squared, count * LANES * LANES
    low, high, fewer, more = spread(-1.0), spread(reach), counts_of(0), within
    limit, none, beyond = smaller(load(room.limits, 0), high), spread(-1.0), spread(np.inf)
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
        high, more = where(inside >= k, limit, high), where_counts(inside >= k, inside, more)
        one_less, one_more = inside == k - 1, inside == k + 1
        share = (k + 0.5 - as_floats(fewer)) / (as_floats(more) - as_floats(fewer))
        share = share if step % 3 < 2 else spread(0.5)
        limit = where(inside == k, limit, low + (high - low) * share)
        limit = where(one_less, over, where(one_more, under * _LESS, limit))
        if bits(one_less | one_more | (inside == k)) == 255:
            break
    inside = counts_of(0)
    for i in range(0, points, LANES):
        inside = counted(inside, load(squared, i) <= limit)
    store(room.limits, 0, where(inside == k, limit, low))
    return bits(inside == k)


@kernel
def first_of(tree, a, b):
    """Whether sorted point a comes before b by x, y, z; duplicates by their row in the input."""
    if tree.x[a] != tree.x[b]:
        return tree.x[a] < tree.x[b]
    if tree.y[a] != tree.y[b]:
        return tree.y[a] < tree.y[b]
    if tree.z[a] != tree.z[b]:
        return tree.z[a] < tree.z[b]
    return tree.order[a] < tree.order[b]


@part
def place_of(room, i):
    """Sorted place of the i-th point of the blocks found."""
    return LANES * room.found[i // LANES] + i % LANES


@kernel
def _settle(tree, room, count, k, lane):
    """Where the k-th distance equals the next one, leave only the points of smallest coordinates within the limit."""
    squared, low, missing = room.squared, room.limits[lane], k
    for i in range(count * LANES):
        missing -= squared[i * LANES + lane] <= low
    last, limit = -1, low
    for _ in range(missing):
        best, least = -1, np.inf
        for i in range(count * LANES):
            d = squared[i * LANES + lane]
            if d <= low or d > least or d < limit:
                continue
            if d == limit and last >= 0 and not first_of(tree, place_of(room, last), place_of(room, i)):
                continue
            if d < least or best < 0 or first_of(tree, place_of(room, i), place_of(room, best)):
                best, least = i, d
        last, limit = best, least
    for i in range(count * LANES):
        if (
            squared[i * LANES + lane] == limit
            and i != last
            and not first_of(tree, place_of(room, i), place_of(room, last))
        ):
            squared[i * LANES + lane] = np.inf
    room.limits[lane] = limit


@part
def _search(tree, room, near, near_reach, reach, k):
    """Find the k nearest of the queries in `room`: see `nearest_of_eight`."""
    qx, qy, qz = load(room.queries, 0), load(room.queries, LANES), load(room.queries, 2 * LANES)
    low_x, low_y, low_z = smallest_of(qx), smallest_of(qy), smallest_of(qz)
    high_x, high_y, high_z = largest_of(qx), largest_of(qy), largest_of(qz)
    count, within = 0, counts_of(0)
    for attempt in range(3):
        if attempt == 2 or not reach < np.inf:
            reach = sure_reach(tree, low_x, low_y, low_z, high_x, high_y, high_z, k)
        if reach <= near_reach:
            count = pick(room, near, low_x, low_y, low_z, high_x, high_y, high_z, reach)
        else:
            count = walk(tree, low_x, low_y, low_z, high_x, high_y, high_z, reach, room.found)
        if count < 0:
            return -1, reach
        within = _measure(tree, room, count, reach)
        if bits(within >= k) == 255:
            break
        reach *= 2.0
    settled = _divide(room, count, k, reach, within)
    for lane in range(LANES):
        if not (settled >> lane) & 1:
            _settle(tree, room, count, k, lane)
    return count, SLACK * largest_of(load(room.limits, 0))


@part
def _ask(queries, q, room, lane):
    """Put a query into a lane."""
    room.queries[lane] = queries.x[q]
    room.queries[LANES + lane] = queries.y[q]
    room.queries[2 * LANES + lane] = queries.z[q]


@part
def nearest_of_eight(tree, queries, first, last, begin, near, near_reach, reach, k, room):
    """Find the k nearest of the next queries of first..last-1, from `begin` on.

    Returns
    -------
    size : int
        How many queries were answered: eight unless fewer are left, one where they lie too far apart, or none where
        `room` is too small even for one: try again in a `larger_room`.
    count : int
        How many blocks were found. Point j of block i is among the k nearest of the query in a lane where
        ``room.squared[(8 i + j) 8 + lane] <= room.limits[lane]``; always exactly k are.
    reach : float
        Squared reach that the next queries may need.
    """
    size = min(LANES, last - begin)
    if (begin - first) % LANES == 0:
        if size == LANES:
            store(room.queries, 0, load(queries.x, begin))
            store(room.queries, LANES, load(queries.y, begin))
            store(room.queries, 2 * LANES, load(queries.z, begin))
        else:
            for lane in range(LANES):
                _ask(queries, begin + min(lane, size - 1), room, lane)
        count, farther = _search(tree, room, near, near_reach, reach, k)
        if count >= 0:
            return size, count, farther
    for lane in range(LANES):
        _ask(queries, begin, room, lane)
    count, farther = _search(tree, room, near, -1.0, reach, k)
    return (1, count, farther) if count >= 0 else (0, 0, reach)
