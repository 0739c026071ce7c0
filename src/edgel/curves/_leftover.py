"""Sure edge points that no strand runs past, linked into paths: crowded edges, which tangents do not follow."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel._kernels.union_find import find_root
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn

_STRENGTH = 0.65  # of the edge points that are linked: fainter ones scatter beside edges, and in crowns of trees
_PASSED = 1.5  # spacings from a strand: its own edge, or one that cannot be told from it
_REACH, _AROUND = 1.6, 7  # spacings between linked points; points, each itself among them, that one may link to
_ONWARD = 0.3  # cosine between a step of a path and the next, at least
_POINTS = 3  # of a path at least


def leftover_paths(
    position: np.ndarray, strength: np.ndarray, kind: np.ndarray, spacing: np.ndarray, passed: np.ndarray
) -> list[np.ndarray]:
    """Return the edge points (P,) of each path through sure ones of (E,), in order, beside none of the places (S, 3).

    The nearest are linked first, each with two others at most, and no path turns back: Kruskal's tree with the degree
    bounded, since what runs here is a line and has no branches.
    """
    sure = np.flatnonzero(strength >= _STRENGTH)
    if len(passed) and len(sure):
        away = knn(build_index(passed), position[sure], 1).distances[:, 0]
        sure = sure[away >= _PASSED * spacing[sure]]
    if len(sure) < _POINTS:
        return []
    sure = sure[np.lexsort(position[sure].T)]
    places = position[sure]
    near = knn(build_index(places), places, min(_AROUND, len(sure)))
    first = np.broadcast_to(np.arange(len(sure))[:, None], near.points.shape)
    linked = (first < near.points) & (near.distances < _REACH * spacing[sure][:, None])
    linked &= (kind[sure][first] & kind[sure][near.points]) > 0
    pairs = np.stack([first[linked], near.points[linked]], axis=1)
    pairs = pairs[np.lexsort((*pairs.T, near.distances[linked]))]
    order, start = np.empty(len(sure), np.int64), np.zeros(len(sure) + 1, np.int64)
    count = _link(pairs, places, order, start)
    paths = (order[start[k] : start[k + 1]] for k in range(count))
    return [sure[path] for path in paths if len(path) >= _POINTS]


@kernel
def _link(pairs, places, order, start):
    """Write the rows of all paths one after the other, and where each begins; return how many there are."""
    number = len(places)
    links, parents = np.full((number, 2), -1, np.int64), np.arange(number)
    for p in range(len(pairs)):
        a, b = pairs[p, 0], pairs[p, 1]
        if links[a, 1] >= 0 or links[b, 1] >= 0:
            continue
        one, other = find_root(parents, a), find_root(parents, b)
        if one == other or not _goes_on(links[a, 0], a, b, places) or not _goes_on(links[b, 0], b, a, places):
            continue
        parents[max(one, other)] = min(one, other)
        links[a, 1 if links[a, 0] >= 0 else 0] = b
        links[b, 1 if links[b, 0] >= 0 else 0] = a
    paths, filled, done = 0, 0, np.zeros(number, np.bool_)
    for end in range(number):
        if links[end, 0] < 0 or links[end, 1] >= 0 or done[end]:
            continue
        before, here = -1, end
        while here >= 0:
            order[filled] = here
            filled += 1
            following = links[here, 0] if links[here, 0] != before else links[here, 1]
            before, here = here, following
        done[before] = True  # the other end begins no path
        paths += 1
        start[paths] = filled
    return paths


@routine
def _goes_on(before, here, following, places):
    """Tell whether a path goes on: -1 where nothing is before."""
    if before < 0:
        return True
    product, one, other = 0.0, 0.0, 0.0
    for axis in range(3):
        u, v = places[here, axis] - places[before, axis], places[following, axis] - places[here, axis]
        product, one, other = product + u * v, one + u * u, other + v * v
    return product > _ONWARD * math.sqrt(one * other)
