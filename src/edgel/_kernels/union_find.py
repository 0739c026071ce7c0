"""Union-find: which set each of some things belongs to."""

from __future__ import annotations

from edgel._kernels.parallel import kernel


@kernel
def find_root(parents, member):
    """Return the root of a member's set, and shorten the way there."""
    while parents[member] != member:
        parents[member] = parents[parents[member]]
        member = parents[member]
    return member
