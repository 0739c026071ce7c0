"""Normals of a whole surface turned outwards: from neighbour to neighbour, with the outermost points as anchors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from edgel._columns import plain
from edgel._kernels.frames import tangents
from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.normals import OUTWARD, OWN, SENSOR, UNKNOWN, Normals, fit_nearest, no_planes
from edgel._neighbors.pieces import (
    BINS,
    SURELY,
    UNIT,
    Outermost,
    Pairs,
    bins_of,
    cell_size,
    join,
    least_bin,
    within_cells,
)
from edgel._neighbors.queries import Queries, every_place
from edgel._neighbors.scan_lines import scan_line_normals, scan_line_stretch
from edgel._neighbors.spacing import cloud_spacing
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
SPARSE = 2.7  # spacings of the cloud: points that lie farther apart may be stray, the usual is 1.3


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
    own = own_normals(cloud)
    return UNKNOWN if own is None else OWN, own


def has_normals(cloud: Cloud) -> bool:
    """Whether a cloud has columns nx, ny and nz."""
    return {*NORMALS} <= {plain(name) for name in cloud.attributes}


def own_normals(cloud: Cloud) -> np.ndarray | None:
    """Return the normals (N, 3) that came with a cloud as nx, ny, nz, None where it has none."""
    if not has_normals(cloud):
        return None
    names = {plain(name): name for name in cloud.attributes}
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
    spacing = cloud_spacing(index)
    found = agreement(index, scan_line_stretch(index), spacing)
    order = np.lexsort(found.xyz.T[::-1])  # numbers by coordinates decide ties
    found = found.ordered(order)
    sign, root = join(within_cells(found.pairs, found.xyz, cell_size(spacing)), len(order), SURELY)
    roots, piece = np.unique(root, return_inverse=True)
    turn, body = join(found.pairs.renamed(piece, sign), len(roots))
    sign, body = sign * turn[piece], np.unique(body, return_inverse=True)[1][piece]
    normals, bins = found.normals * sign[:, None], bins_of(found.sure)
    counts = np.bincount(body * BINS + bins, minlength=(body.max() + 1) * BINS).reshape(-1, BINS)
    kept = bins >= least_bin(counts)[body]
    signs = Outermost.of(found.xyz[kept], np.nan_to_num(normals[kept]), body[kept], len(counts)).signs
    outward = np.empty_like(normals)
    outward[index.order[order]] = normals * signs[body][:, None]
    return outward


@dataclass(frozen=True, eq=False)
class Agreement:
    """What points (N,) say of each other's normals.

    Attributes
    ----------
    xyz : (N, 3) float64
    normals : (N, 3) float64
        Of either sign; NaN where there is none.
    pairs : Pairs
        Of each point, and the nearest in each sector.
    sure : (N,) float64
        How far they agree, or disagree, less 1 where points lie far apart.
    """

    xyz: np.ndarray
    normals: np.ndarray
    pairs: Pairs
    sure: np.ndarray

    def ordered(self, order: np.ndarray) -> Agreement:
        """Return the same of points (N,) in another order."""
        number = np.empty(len(order), np.int64)
        number[order] = np.arange(len(order))
        pairs = replace(self.pairs, a=number[self.pairs.a], b=number[self.pairs.b])
        return Agreement(self.xyz[order], self.normals[order], pairs, self.sure[order])


def agreement(index: NeighborIndex, stretch: np.ndarray | None, spacing: float) -> Agreement:
    """Compare the normal at each place with the nearest in each of some sectors around it.

    Takes the stretch (3, N) on scan lines, where there is one, and the cloud's spacing.
    """
    count, queries = len(index), every_place(index, stretch)
    planes = _steady_planes(index, queries)
    if stretch is not None:
        _put_lines(planes, index)
    near, agree = np.empty((count, SECTORS), np.int64), np.empty((count, SECTORS))
    visit_neighbors(_agree, queries, index, min(NEIGHBORS, count), planes.normals, planes.offset, near, agree)
    xyz, weight = np.ascontiguousarray(index.xyz.T), np.rint(agree * UNIT).astype(np.int64)
    away = np.linalg.norm(xyz[near] - xyz[:, None], axis=2).mean(axis=1)
    own = np.repeat(np.arange(count), SECTORS)
    pairs = Pairs(own, near.ravel(), weight.ravel(), np.ones(len(own), np.int64))
    sure = np.abs(agree).mean(axis=1) - (away > SPARSE * spacing)
    return Agreement(xyz, planes.normals, pairs, sure)


def _steady_planes(index: NeighborIndex, queries: Queries) -> Normals:
    """Fit a plane at each place to as many neighbours as lie on it no less well than fewer do.

    Few keep to one face of a blade or a plate, many average noise away.
    """
    planes, spread = no_planes(len(index)), np.full(len(index), np.inf)
    going_on = np.ones(len(index), bool)
    for k in COUNTS:
        if k > len(index) and k > COUNTS[0]:
            break
        more = fit_nearest(index, queries, k)
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
