"""Normals of a whole surface turned outwards: from neighbour to neighbour, with the outermost points as anchors."""

from __future__ import annotations

import itertools
import math

import numpy as np

from edgel._kernels.frames import tangents
from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.normals import OUTWARD, OWN, SENSOR, UNKNOWN, Normals, fit_planes, no_planes
from edgel._neighbors.queries import Queries, every_place
from edgel._neighbors.scan_lines import scan_line_normals, scan_line_stretch
from edgel._objects import NORMALS
from edgel.cloud import Cloud

COUNTS = (8, 16, 32)  # neighbours of the plane at each point
WORSE = 2.0  # times the spread off the plane of fewer neighbours: with more they lie on it no longer
ORIENTS = ("auto", OUTWARD)

NEIGHBORS, SECTORS = 48, 8  # of the neighbours of a point, the nearest in each sector is compared with it
_PARALLEL = (
    0.8  # cosine of two planes that may be both sides of a plate, whose lines lie farther apart than it is thick
)
_STEP = (0.05, 0.6)  # share off the planes, squared, of the way between points on them that does not tell
SPARSE = 2.0  # times the median distance of neighbours: points that lie farther apart may be stray
_DIRECTIONS = np.array(
    [np.array(d) / np.linalg.norm(d) for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)]
)


def check_orient(orient: str, *, has_viewpoint: bool) -> None:
    """Refuse what is no way to orient normals, and one beside the viewpoint that a caller gives."""
    if orient not in ORIENTS:
        raise ValueError(f"orient: expected one of {', '.join(ORIENTS)}, got {orient!r}")
    if orient == OUTWARD and has_viewpoint:
        raise ValueError("orient: 'outward' and a viewpoint contradict each other; give one of them")


def who_knows(orient: str, cloud: Cloud, *, sensor: bool) -> tuple[str, np.ndarray | None]:
    """Say who tells the outside: the whole surface where that is asked for, else a sensor, else the cloud's normals.

    With the normals (N, 3) where it is they, which may not be units.
    """
    if orient == OUTWARD or sensor:
        return orient if orient == OUTWARD else SENSOR, None
    own = _own_normals(cloud)
    return UNKNOWN if own is None else OWN, own


def _own_normals(cloud: Cloud) -> np.ndarray | None:
    """Return the normals (N, 3) that came with a cloud as nx, ny, nz, None where it has none."""
    names = {"_".join(name.split()).lower(): name for name in cloud.attributes}
    if not {*NORMALS} <= set(names):
        return None
    columns = [cloud.attributes[names[name]] for name in NORMALS]
    if any(column.ndim != 1 or column.dtype.kind not in "fiu" for column in columns):
        return None
    normals = np.stack(columns, axis=1).astype(np.float64)
    return normals if np.nan_to_num(normals).any() else None


def outward_normals(index: NeighborIndex) -> np.ndarray:
    """Return normals of all points that look out of what the points enclose, (N, 3) float64; NaN where there is none.

    Neighbours are agreed pair by pair (Hoppe et al. 1992, doi:10.1145/133994.134011), whether a crease lies between
    them or not (`_agree`). Pieces grow by joining the one they agree with most, or disagree with most, over all pairs
    between them: one pair that errs decides nothing. Last, the outermost points of each piece look outwards.
    """
    order, count = index.order, len(index)
    stretch = scan_line_stretch(index)
    queries = every_place(index, stretch)
    planes = _steady_planes(index, queries)
    if stretch is not None:
        _put_lines(planes, index)
    xyz, normals = np.ascontiguousarray(index.xyz.T), planes.normals
    near, agreement = np.empty((count, SECTORS), np.int64), np.empty((count, SECTORS))
    k = min(NEIGHBORS, count)
    visit_neighbors(_agree, queries, index, k, normals, planes.offset, near, agreement)
    reach = np.linalg.norm(xyz[near] - xyz[:, None], axis=2).mean(axis=1)
    sign, piece = _join(np.repeat(np.arange(count), near.shape[1]), near.ravel(), agreement.ravel())
    sure = (agreement * sign[:, None] * sign[near]).mean(axis=1) - (reach > SPARSE * np.median(reach))
    sign *= _facing_out(xyz, normals * sign[:, None], sure, piece)[piece]
    outward = np.empty((count, 3))
    outward[order] = normals * sign[:, None]
    return outward


def _steady_planes(index: NeighborIndex, queries: Queries) -> Normals:
    """Fit a plane at each place to as many neighbours as lie on it no less well than fewer do.

    Few keep to one face of a blade or a plate, many average noise away.
    """
    planes, spread = no_planes(len(index)), np.full(len(index), np.inf)
    going_on = np.ones(len(index), bool)
    for k in COUNTS:
        if k > len(index) and k > COUNTS[0]:
            break
        more = fit_planes(index, queries, k)
        now = np.sqrt(more.residual / (k - 3))
        going_on &= ~(now > WORSE * spread)
        rows = np.flatnonzero(going_on)
        planes.put(rows, more.take(rows))
        spread = now
    return planes


def _put_lines(planes: Normals, index: NeighborIndex) -> None:
    """Put in the planes through scan lines, where they are known: they keep to one side of the thinnest plate."""
    normals = scan_line_normals(index, np.arange(len(index)))
    known = np.isfinite(normals[:, 0])
    planes.normals[known] = normals[known]
    planes.offset[known] = (normals * index.xyz.T).sum(axis=1)[known]


@kernel
def _agree(first, places, squared, queries, targets, xyz, normals, offset, near, agreement):
    """Choose the nearest neighbour in each of some sectors of the tangent plane, and say how far both normals agree.

    That is the cosine of one normal and the other's mirror image in the plane midway between the points: 1 where one
    surface has both, since that mirrors one face of a crease onto the other, as it does two points of an arc. Points
    are laid onto their planes first, or noise would tilt what lies between near ones.
    """
    stretched = queries.shape[0] > 3
    for q in range(places.shape[0]):
        p = targets[first + q]
        near[p], agreement[p] = p, 0.0
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        if not np.isfinite(nx):
            continue
        ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
        left = SECTORS
        for i in range(1, places.shape[1]):
            j = places[q, i]
            x, y, z = xyz[0, j] - xyz[0, p], xyz[1, j] - xyz[1, p], xyz[2, j] - xyz[2, p]
            turn = math.atan2(x * vx + y * vy + z * vz, x * ux + y * uy + z * uz) / (2.0 * math.pi)
            sector = int((turn + 0.5) * SECTORS) % SECTORS
            if near[p, sector] != p:
                continue
            mx, my, mz = normals[j, 0], normals[j, 1], normals[j, 2]
            own = offset[p] - (nx * xyz[0, p] + ny * xyz[1, p] + nz * xyz[2, p])
            other = offset[j] - (mx * xyz[0, j] + my * xyz[1, j] + mz * xyz[2, j])
            x, y, z = x + other * mx - own * nx, y + other * my - own * ny, z + other * mz - own * nz
            apart = x * x + y * y + z * z
            cosine = nx * mx + ny * my + nz * mz
            if apart > 0.0:
                off = (x * nx + y * ny + z * nz) * (x * mx + y * my + z * mz) / apart
                if stretched and abs(cosine) > _PARALLEL and _STEP[0] < abs(off) < _STEP[1]:
                    continue
                cosine -= 2.0 * off
            if np.isfinite(cosine):
                near[p, sector], agreement[p, sector] = j, cosine
                left -= 1
                if left == 0:
                    break


def _join(a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give the ends of pairs a sign each, so that pairs of positive weight get equal ones; Boruvka's rounds.

    Returns the signs (N,) and the piece (N,) that each belongs to: what pairs connect.
    """
    piece = np.arange(int(max(a.max(), b.max())) + 1)
    sign, number = np.ones(len(piece)), len(piece)
    while True:
        a, b, weight = _merged(a, b, weight, number)
        if not len(a):
            return sign, piece
        parent, turn = _strongest(a, b, weight, number)
        while (parent != parent[parent]).any():
            turn, parent = turn * turn[parent], parent[parent]
        weight, sign = weight * turn[a] * turn[b], sign * turn[piece]
        roots, renamed = np.unique(parent, return_inverse=True)
        a, b, piece, number = renamed[a], renamed[b], renamed[piece], len(roots)


def _merged(a: np.ndarray, b: np.ndarray, weight: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Add up the pairs between the same two pieces, those within one left out."""
    apart = a != b
    a, b = np.minimum(a, b)[apart], np.maximum(a, b)[apart]
    keys, which = np.unique(a * number + b, return_inverse=True)
    return keys // number, keys % number, np.bincount(which, weight[apart], len(keys))


def _strongest(a: np.ndarray, b: np.ndarray, weight: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the piece that each joins, itself where it is the first of two that choose each other, and the sign."""
    order = np.lexsort((b, a, -np.abs(weight)))
    ends, others = np.stack([a, b], axis=1)[order].ravel(), np.stack([b, a], axis=1)[order].ravel()
    pieces, at = np.unique(ends, return_index=True)
    parent, turn = np.arange(number), np.ones(number)
    parent[pieces], turn[pieces] = others[at], np.where(weight[order[at // 2]] < 0, -1.0, 1.0)
    first = (parent[parent] == np.arange(number)) & (np.arange(number) < parent)
    parent[first], turn[first] = np.flatnonzero(first), 1.0
    return parent, turn


def _facing_out(xyz: np.ndarray, normals: np.ndarray, sure: np.ndarray, piece: np.ndarray) -> np.ndarray:
    """Return 1 for each piece (of the points, numbered from 0 on) whose outermost points look outwards, else -1.

    Only the half of its points that is surest counts: stray points lie outermost of all.
    """
    order = np.lexsort((-sure, piece))
    starts = np.flatnonzero(np.diff(piece[order], prepend=-1))
    size = np.diff(starts, append=len(piece))
    rank = np.arange(len(piece)) - np.repeat(starts, size)
    kept = np.sort(order[rank < np.repeat((size + 1) // 2, size)])
    votes, xyz, normals, piece = np.zeros(len(starts)), xyz[kept], np.nan_to_num(normals[kept]), piece[kept]
    for direction in _DIRECTIONS:
        far = np.lexsort((-(xyz @ direction), piece))
        outermost = far[np.flatnonzero(np.diff(piece[far], prepend=-1))]
        votes += normals[outermost] @ direction
    return np.where(votes < 0, -1.0, 1.0)
