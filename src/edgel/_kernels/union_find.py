"""Union-find: which set each of some things belongs to."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel, routine


@routine
def find_root(parents, member):
    """Return the root of a member's set, and shorten the way there."""
    while parents[member] != member:
        parents[member] = parents[parents[member]]
        member = parents[member]
    return member


@kernel
def keep_linked(links, strong, kept):
    """Tell (M,) which of some things links (M, k), -1 for none, join to a strong one (M,), directly or by others."""
    parents = np.arange(len(links))
    for row in range(len(links)):
        for other in links[row]:
            if other >= 0:
                a, b = find_root(parents, row), find_root(parents, other)
                parents[max(a, b)] = min(a, b)
    holds = np.zeros(len(links), np.bool_)
    for row in range(len(links)):
        if strong[row]:
            holds[find_root(parents, row)] = True
    for row in range(len(links)):
        kept[row] = holds[find_root(parents, row)]


def join(count: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Number the sets (count,) int64, by their first members, that pairs of members a (M,), b (M,) make."""
    parents = np.arange(count)
    _join(a.astype(np.int64), b.astype(np.int64), parents)
    return np.unique(parents, return_inverse=True)[1]


@kernel
def _join(a, b, parents):
    for i in range(len(a)):
        one, other = find_root(parents, a[i]), find_root(parents, b[i])
        parents[max(one, other)] = min(one, other)
    for member in range(len(parents)):
        parents[member] = find_root(parents, member)
