"""Hysteresis at every threshold at once: up to which a pixel stays, and its chain is long enough."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel._kernels.union_find import find_root


def levels(values: np.ndarray, weak: float, least: int, faintest: float) -> tuple[np.ndarray, np.ndarray]:
    """Find the highest threshold at which hysteresis keeps each pixel.

    Hysteresis at a threshold t keeps a pixel above ``weak * t`` that 8-neighbours above it join to one of t or more,
    and here to `least` pixels in all. A lower threshold keeps whatever a higher one does, so one number says it all;
    found by joining pixels from the largest down, as in a maximum spanning tree.

    Parameters
    ----------
    values : (H, W) float
    weak : float
        In (0, 1].
    least : int
    faintest : float
        What lies below is not looked at.

    Returns
    -------
    (K,) int64, (K,) float64
        Places, ascending, in the flat image of the pixels that some threshold keeps, and the highest.
    """
    flat = values.ravel()
    shown = np.flatnonzero(flat >= faintest)
    falling = np.argsort(-flat[shown], kind="stable")
    order = shown[falling]
    rank = np.full(len(flat), -1, np.int32)
    rank[order] = np.arange(len(order))
    level = np.zeros(len(order))
    _join(order, rank, flat[order].astype(np.float64), values.shape[1], weak, least, level)
    found = np.empty(len(order))
    found[falling] = level
    return shown[found > 0], found[found > 0]


@routine
def _settle(root, until, weak, least, values, size, since, following, head, found):
    """Give the members of a chain that have no level yet the one that it reaches before it changes at `until`."""
    if size[root] < least:
        return
    level = min(values[root], since[root] / weak)
    if level < until / weak:
        return
    member = head[root]
    while member >= 0:
        found[member] = level
        member = following[member]
    head[root] = -1


@kernel
def _join(order, rank, values, width, weak, least, found):
    """Join pixels by their rank, the largest first; a chain's root is its largest pixel, `since` when it last grew."""
    count = len(values)
    parent = np.full(count, -1, np.int64)
    following, head, tail = np.full(count, -1, np.int64), np.full(count, -1, np.int64), np.full(count, -1, np.int64)
    size, since = np.zeros(count, np.int64), np.zeros(count)
    for pixel in range(count):
        value = values[pixel]
        parent[pixel] = head[pixel] = tail[pixel] = pixel
        size[pixel], since[pixel] = 1, value
        for r in range(-1, 2):
            for c in range(-1, 2):
                place, col = order[pixel] + r * width + c, order[pixel] % width + c
                if place < 0 or place >= len(rank) or col < 0 or col >= width:
                    continue
                beside = rank[place]
                if beside < 0 or parent[beside] < 0:
                    continue
                a, b = find_root(parent, beside), find_root(parent, pixel)
                if a == b:
                    continue
                _settle(a, value, weak, least, values, size, since, following, head, found)
                _settle(b, value, weak, least, values, size, since, following, head, found)
                if values[b] > values[a]:
                    a, b = b, a
                parent[b] = a
                size[a] += size[b]
                since[a] = value
                if head[b] >= 0:
                    if head[a] >= 0:
                        following[tail[a]] = head[b]
                    else:
                        head[a] = head[b]
                    tail[a] = tail[b]
    for pixel in range(count):
        if parent[pixel] == pixel:
            _settle(pixel, 0.0, weak, least, values, size, since, following, head, found)
