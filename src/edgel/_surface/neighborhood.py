"""The neighbours of a point, relative to it."""

from __future__ import annotations

from edgel._kernels.parallel import kernel


@kernel
def relative(places, queries, query, xyz, vectors):
    """Write the neighbours relative to the query into `vectors` (3, k)."""
    for axis in range(3):
        own, coordinates, row = queries[axis, query], xyz[axis], vectors[axis]
        for i in range(len(places)):
            row[i] = coordinates[places[i]] - own
