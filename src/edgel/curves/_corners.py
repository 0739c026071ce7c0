"""Corners: where the faces of the curves that end near each other meet."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from edgel._kernels.parallel import kernel, routine
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.curves._circle import RADIUS, offset_of, offsets_of, tangent_of

REACH = 3.5
"""Spacings: so far from where its points end a curve meets others."""
_ASIDE = 0.7  # spacings: farther from a curve lies no corner of it, unless the curve is unsure
_MOST = 8  # ends near each that are tried
PRIOR = 3.0  # spacings: standard deviation of a corner about the ends, where no face decides
_FLOOR = 0.02  # spacings: no face is surer
_UNSURE, _LONE, _PASSED, _BY_NOISE, _NOISY = 0.4, 0.9, 0.3, 0.8, 0.2
"""Spacings: corners of two curves that are less sure, how far the nearest edge point may be from one, and how far
that may be from both curves; what noise adds to each, and the noise from which on none tells right from wrong."""
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


def without_unsure(nodes: Nodes, noise: float, spacing: np.ndarray) -> Nodes:
    """Leave out corners of two curves whose place is unsure: a corner of faces has three, and a curve may just end.

    Takes the noise in spacings and the spacing (N,) of the curves.
    """
    if noise > _NOISY:
        return nodes
    uses, h = _uses(nodes, spacing)
    return _without(nodes, (uses == 2) & (nodes.std > (_UNSURE + _BY_NOISE * noise) * h))


def without_passed(
    nodes: Nodes, through: np.ndarray, shapes: np.ndarray, position: np.ndarray, noise: float, spacing: np.ndarray
) -> Nodes:
    """Leave out corners of two curves past which edge points (E, 3) run from one to the other, as round fillets.

    Takes which curves (T, 2) pass through which nodes, and the shapes (N, 13) of the curves, else as `without_unsure`.
    """
    if noise > _NOISY or not len(nodes.position):
        return nodes
    uses, h = _uses(nodes, spacing)
    near = knn(build_index(position), nodes.position, 1)
    curve = np.concatenate([np.nonzero(nodes.of_end >= 0)[0], through[:, 1]])
    node = np.concatenate([nodes.of_end[nodes.of_end >= 0], through[:, 0]])
    aside = np.full(len(h), np.inf)
    np.fmin.at(aside, node, offsets_of(shapes[curve], position[near.points[node, 0]]))
    passed = (near.distances[:, 0] > (_LONE + _BY_NOISE * noise) * h) & (aside > (_PASSED + _BY_NOISE * noise) * h)
    return _without(nodes, (uses + np.bincount(through[:, 0], minlength=len(h)) == 2) & passed)


def corners_of_shapes(nodes: Nodes, through: np.ndarray, is_run: np.ndarray) -> Nodes:
    """Call no joint a corner at which fewer than two curves with a shape meet: where runs end says little of where.

    Takes which curves (T, 2) pass through which nodes, and which curves (N,) bool are runs of edge points.
    """
    shaped = np.where(is_run[:, None], -1, nodes.of_end)
    node = np.concatenate([shaped[shaped >= 0], through[:, 0]])
    return replace(nodes, is_corner=nodes.is_corner & (np.bincount(node, minlength=len(nodes.position)) >= 2))


def _uses(nodes: Nodes, spacing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how many curves end at each node, (M,) int64, and their mean spacing (M,)."""
    count, meeting = len(nodes.position), nodes.of_end >= 0
    ends = np.bincount(nodes.of_end[meeting], minlength=count)
    return ends, np.bincount(nodes.of_end[meeting], np.repeat(spacing, 2)[meeting.ravel()], count) / np.maximum(ends, 1)


def _without(nodes: Nodes, out: np.ndarray) -> Nodes:
    """Leave out some nodes (M,), if they are corners."""
    gone = np.append(nodes.is_corner & out, False)  # the last, for ends that have no node
    return replace(nodes, of_end=np.where(gone[nodes.of_end], -1, nodes.of_end))


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
        together = False
        for q in range(count):
            together |= members[q] == two
        if together:
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
    h = xx = xy = xz = yy = yz = zz = x = y = z = 0.0
    for q in range(count):
        h += spacing[curve[members[q]]] / count
    prior = 1.0 / (PRIOR * h) ** 2
    for q in range(count):
        i = members[q]
        xx, xy, xz = xx + squares[i, 0, 0], xy + squares[i, 0, 1], xz + squares[i, 0, 2]
        yy, yz, zz = yy + squares[i, 1, 1], yz + squares[i, 1, 2], zz + squares[i, 2, 2]
        x, y = x + rights[i, 0] + prior * places[i, 0] / count, y + rights[i, 1] + prior * places[i, 1] / count
        z += rights[i, 2] + prior * places[i, 2] / count
    xx, yy, zz = xx + prior, yy + prior, zz + prior
    # Cofactors of the symmetric matrix, over its determinant.
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    det = xx * a + xy * b + xz * c
    position[0], position[1] = (a * x + b * y + c * z) / det, (b * x + d * y + e * z) / det
    position[2] = (c * x + e * y + f * z) / det
    return math.sqrt((a + d + f) / det)


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
        x, y, z = position[0] - places[i, 0], position[1] - places[i, 1], position[2] - places[i, 2]
        along = x * tangents[i, 0] + y * tangents[i, 1] + z * tangents[i, 2]
        square = x * x + y * y + z * z
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
    members, ways = np.empty(2 * _MOST, np.int64), np.empty((2 * _MOST, 3))
    number[:] = -1
    for end in range(len(ring)):
        count = _members(end, ring, members)
        if count < 2 or number[end] >= 0:
            continue
        node = position[found]
        std[found] = _solve(members, count, places, squares, rights, spacing, curve, node)
        straight = 1.0
        for q in range(count):
            i = members[q]
            number[i] = found
            x, y, z = tangents[i, 0], tangents[i, 1], tangents[i, 2]
            if math.isfinite(shapes[curve[i], RADIUS]):  # an arc has turned on the way from its end to the node
                x, y, z = tangent_of(shapes[curve[i]], node[0], node[1], node[2])
            ways[q, 0], ways[q, 1], ways[q, 2] = x, y, z
            for r in range(q):
                straight = min(straight, abs(x * ways[r, 0] + y * ways[r, 1] + z * ways[r, 2]))
        is_corner[found] = straight < CORNER
        found += 1
    return found
