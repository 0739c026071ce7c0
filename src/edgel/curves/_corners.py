"""Corners: where the faces of the curves that end near each other meet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.curves._circle import RADIUS, offset_of

REACH = 3.5
"""Spacings: so far from where its points end a curve meets others."""
_ASIDE = 0.7  # spacings: farther from a curve lies no corner of it, unless the curve is unsure
_MOST = 8  # ends near each that are tried
PRIOR = 3.0  # spacings: standard deviation of a corner about the ends, where no face decides
_FLOOR = 0.02  # spacings: no face is surer
CORNER = math.cos(math.radians(20.0))  # between tangents: nearer to straight the joint is smooth


@dataclass(frozen=True, eq=False)
class Ends:
    """The two ends of each curve.

    Attributes
    ----------
    place, tangent : (N, 2, 3) float64
        Where it ends, and its unit tangent outwards there.
    normals : (N, 2, 2, 3) float64
        Of two planes through the end in which the curve lies, its faces where it has two.
    std : (N, 2, 2) float64
        How sure the place is across each.
    is_open : (N,) bool
    """

    place: np.ndarray
    tangent: np.ndarray
    normals: np.ndarray
    std: np.ndarray
    is_open: np.ndarray


@dataclass(frozen=True, eq=False)
class Nodes:
    """Where curves meet.

    Attributes
    ----------
    position : (M, 3) float64
    std : (M,) float64
        Root of the mean squared distance from the true place.
    is_corner : (M,) bool
        Tangents differ; else the joint is smooth.
    of_end : (N, 2) int64
        The node at each end of each curve; -1 for none.
    """

    position: np.ndarray
    std: np.ndarray
    is_corner: np.ndarray
    of_end: np.ndarray


def meet(ends: Ends, shapes: np.ndarray, spacing: np.ndarray) -> Nodes:
    """Let ends meet that lie near each other, and whose faces have a place in common on all their curves.

    Takes the shapes (N, 13) of the curves, of a polyline the line at neither end (radius NaN), and the spacing (N,).
    """
    count = len(shapes)
    of_end = np.full((count, 2), -1)
    flat = np.flatnonzero(np.repeat(ends.is_open, 2))
    if len(flat) < 2:
        return Nodes(np.empty((0, 3)), np.empty(0), np.empty(0, bool), of_end)
    places = ends.place.reshape(-1, 3)[flat]
    near = knn(build_index(places), places, min(_MOST + 1, len(flat)))
    a = np.repeat(np.arange(len(flat)), near.points.shape[1])
    b, far = near.points.ravel(), near.distances.ravel()
    kept = (a < b) | ((near.points[b] != a[:, None]).all(axis=1) & (a != b))
    kept &= far < 2 * REACH * spacing[flat[a] // 2]
    a, b, far = a[kept], b[kept], far[kept]
    order = np.lexsort((*(places[a] + places[b]).T, far))
    squares, rights = _equations(ends, flat)
    ring = np.arange(len(flat))
    parts = (places, ends.tangent.reshape(-1, 3)[flat], squares, rights, flat // 2, shapes, spacing)
    _join(a[order], b[order], ring, *parts)
    number = np.zeros(len(flat), np.int64)
    position, std, is_corner = np.empty((len(flat), 3)), np.empty(len(flat)), np.empty(len(flat), np.bool_)
    found = _settle(ring, number, *parts, position, std, is_corner)
    of_end.reshape(-1)[flat] = number
    return Nodes(position[:found], std[:found], is_corner[:found], of_end)


def _equations(ends: Ends, flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations of the planes of each end."""
    normals, std = ends.normals.reshape(-1, 2, 3)[flat], ends.std.reshape(-1, 2)[flat]
    weighted = normals / std[..., None] ** 2
    squares = np.einsum("eki,ekj->eij", weighted, normals)
    return squares, np.einsum("eij,ej->ei", squares, ends.place.reshape(-1, 3)[flat])


@kernel
def _join(a, b, ring, places, tangents, squares, rights, curve, shapes, spacing):
    """Join pairs of ends, the nearest first, where what all of them say agrees; each group is a ring of ends."""
    members = np.empty(2 * _MOST, np.int64)
    for pair in range(len(a)):
        one, two = a[pair], b[pair]
        count = _members(one, ring, members)
        if (members[:count] == two).any():
            continue
        ring[one], ring[two] = ring[two], ring[one]
        if not _agrees(one, ring, places, tangents, squares, rights, curve, shapes, spacing):
            ring[one], ring[two] = ring[two], ring[one]


@routine
def _members(end, ring, members):
    """Write the ends of a group, and return how many there are, as many as there is room for."""
    members[0] = end
    count, following = 1, ring[end]
    while following != end and count < len(members):
        members[count] = following
        count += 1
        following = ring[following]
    return count


@routine
def _solve(members, count, places, squares, rights, spacing, curve, position):
    """Write where the planes of some ends meet, and return the standard deviation of that place."""
    matrix, side, mean = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    h = 0.0
    for q in range(count):
        i = members[q]
        matrix += squares[i]
        side += rights[i]
        mean += places[i] / count
        h += spacing[curve[i]] / count
    prior = 1.0 / (PRIOR * h) ** 2
    for axis in range(3):
        matrix[axis, axis] += prior
        side[axis] += prior * mean[axis]
    inverse = np.linalg.inv(matrix)
    for axis in range(3):
        position[axis] = 0.0
        for other in range(3):
            position[axis] += inverse[axis, other] * side[other]
    return math.sqrt(inverse[0, 0] + inverse[1, 1] + inverse[2, 2])


@routine
def _agrees(end, ring, places, tangents, squares, rights, curve, shapes, spacing):
    members = np.empty(2 * _MOST, np.int64)
    count = _members(end, ring, members)
    if count == len(members):
        return False
    for q in range(count):
        for r in range(q):
            if curve[members[q]] == curve[members[r]]:
                return False
    position = np.empty(3)
    _solve(members, count, places, squares, rights, spacing, curve, position)
    for q in range(count):
        i = members[q]
        h = spacing[curve[i]]
        d = position - places[i]
        along = d[0] * tangents[i, 0] + d[1] * tangents[i, 1] + d[2] * tangents[i, 2]
        square = d[0] ** 2 + d[1] ** 2 + d[2] ** 2
        if math.sqrt(square) > REACH * h:
            return False
        if math.isfinite(shapes[curve[i], RADIUS]):
            aside = offset_of(shapes[curve[i]], position[0], position[1], position[2])
        else:
            aside = math.sqrt(max(square - along * along, 0.0))
        if aside > _ASIDE * h:
            return False
    return True


@kernel
def _settle(ring, number, places, tangents, squares, rights, curve, shapes, spacing, position, std, is_corner):
    """Number the groups of several ends, write what each is, and return how many there are."""
    found = 0
    members = np.empty(2 * _MOST, np.int64)
    number[:] = -1
    for end in range(len(ring)):
        count = _members(end, ring, members)
        if count < 2 or number[end] >= 0:
            continue
        std[found] = _solve(members, count, places, squares, rights, spacing, curve, position[found])
        straight = 1.0
        for q in range(count):
            number[members[q]] = found
            for r in range(q):
                i, j = members[q], members[r]
                cosine = abs(
                    tangents[i, 0] * tangents[j, 0] + tangents[i, 1] * tangents[j, 1] + tangents[i, 2] * tangents[j, 2]
                )
                straight = min(straight, cosine)
        is_corner[found] = straight < CORNER
        found += 1
    return found
