"""Cells of a regular grid over x and y."""

from __future__ import annotations

from edgel._kernels.parallel import part


@part
def cell_of(xyz, p, lower, upper, width, height):
    """Return the cell of a point, flat: ``row * width + column``.

    Cells are half-open; points at the upper border belong to the last ones.
    """
    col = min(int(width * (xyz[p, 0] - lower[0]) / (upper[0] - lower[0])), width - 1)
    row = min(int(height * (xyz[p, 1] - lower[1]) / (upper[1] - lower[1])), height - 1)
    return row * width + col
