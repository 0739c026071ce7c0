"""Closed outlines: where a surface ends, all the way round."""

from __future__ import annotations

import numpy as np

from edgel._neighbors.knn import knn
from edgel.curves._corners import Nodes
from edgel.curves._points import EdgePoints
from edgel.curves._strands import Strands
from edgel.edges import OUTLINES

_AROUND = 16  # points around a place, whose middle lies in the surface


def find_loops(
    strands: Strands, nodes: Nodes, vertices: np.ndarray, start: np.ndarray, edge: np.ndarray, points: EdgePoints
) -> tuple[np.ndarray, np.ndarray]:
    """Number the closed outlines, (N,), -1 for all else; and tell which are holes, (L,)."""
    loop = np.full(len(strands), -1)
    is_hole = []
    outline = (edge & np.uint8(OUTLINES)) > 0
    for ring in _rings(strands, nodes, outline):
        path = _along(ring, vertices, start)
        loop[[strand for strand, _ in ring]] = len(is_hole)
        is_hole.append(_surface_is_outside(path, points))
    return loop, np.array(is_hole, bool)


def _rings(strands: Strands, nodes: Nodes, outline: np.ndarray) -> list[list[tuple[int, bool]]]:
    """Return the strands of each ring in order, and whether each is passed backwards."""
    at: dict[int, list[tuple[int, int]]] = {}
    for strand in np.flatnonzero(outline & ~strands.closed):
        for end in (0, 1):
            at.setdefault(int(nodes.of_end[strand, end]), []).append((int(strand), end))
    rings = [[(int(strand), False)] for strand in np.flatnonzero(outline & strands.closed)]
    done: set[int] = set()
    for first in np.flatnonzero(outline & ~strands.closed):
        ring, strand, entered = [], int(first), 0
        while strand not in done:
            done.add(strand)
            ring.append((strand, entered == 1))
            node = int(nodes.of_end[strand, 1 - entered])
            others = [pair for pair in at.get(node, []) if pair != (strand, 1 - entered)]
            if node < 0 or len(others) != 1:
                break
            strand, entered = others[0]
            if (strand, entered) == (int(first), 0):
                rings.append(ring)
                break
    return sorted(rings)


def _along(ring: list[tuple[int, bool]], vertices: np.ndarray, start: np.ndarray) -> np.ndarray:
    parts = [vertices[start[strand] : start[strand + 1]][:: -1 if turned else 1] for strand, turned in ring]
    return np.concatenate(parts)


def _surface_is_outside(path: np.ndarray, points: EdgePoints) -> bool:
    """Tell whether the points around a closed path lie outside of it."""
    middle, step = 0.5 * (path[1:] + path[:-1]), np.diff(path, axis=0)
    area = np.cross(middle - path.mean(axis=0), step).sum(axis=0)
    inwards = np.cross(area, step)
    found = knn(points.index, middle, min(_AROUND, len(points.index))).points
    around = points.index.at(points.index.places_of(found.ravel())).reshape(*found.shape, 3).mean(axis=1)
    return bool(((around - middle) * inwards).sum() < 0)
