"""Rounded corners: arcs that touch two lines, found where edge points leave the lines before these meet."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.curves import _fit
from edgel.curves._circle import RADIUS, SHAPE, locals_of, offsets_of
from edgel.curves._measure import Measured, mean_of, measure
from edgel.curves._points import EdgePoints
from edgel.curves._ranges import ranges_of
from edgel.curves._rows import rows_of, rows_of_runs, take_rows

_LEAST_TURN, _MOST_TURN = math.radians(15.0), math.radians(155.0)
_FLAT = 0.5  # spacings: lines that pass each other at more are not in one plane
_AHEAD, _BEHIND = 12.0, 3.0  # spacings: where lines meet, beyond their ends or before them
_LARGEST = 20.0  # spacings along either line: a larger arc has pieces of its own
_LEAST, _BY_NOISE = 2.5, 2.0
"""Spacings, and for each spacing of noise: edge points of a sharp corner go round it by less."""
_FREE = 0.7  # of how far the smallest arc passes by its corner: a sharp corner has two edge points nearer than that
_SHORT = 10.0  # spacings: longer lines are not what was made of an arc
_ENDS, _AROUND = 16, 64
"""Ends about each that are tried, and edge points about a corner besides those of its two lines."""
_FAR = 1.0  # spacings: a point farther away costs no more
_FLOOR, _SHARE = 0.05, 0.3  # spacings, and of the noise: edge points scatter by no less
_GAIN, _ABSORBING = 6.0, 2.0  # logarithms of likelihood won, at least, and where a line less explains the same
_STEP = 1.12  # between radii that are tried
_NEAR, _FEWEST, _DENSE = 0.3, 3, 0.4  # spacings; edge points on an arc, and a spacing along it
_OWN = 0.6  # of an arc's points, or of a line's
_RATIO = 0.25  # logarithm of the radius that faces tell over that of edge points: at a sharp corner they differ by more
_SMOOTH, _BY_FACE = 0.06, 1.25  # spacings, and times the noise: faces of an arc are no rougher


def with_rounds(
    measured: Measured,
    rows: tuple[np.ndarray, np.ndarray],
    owner: np.ndarray,
    points: EdgePoints,
    position: np.ndarray,
    noise: float,
) -> tuple[Measured, tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Add the arcs that faces confirm, and take their edge points from the lines: these go on to where they meet.

    Takes shapes, their edge points (as rows, and where each shape's begin), the shape of each edge point (E,), -1 for
    none, the places (E, 3) of these, and the noise, in spacings. Returns the shapes that are left, their edge points,
    and which of them (K,) were added.
    """
    count, spacing = len(measured.holds), mean_of(points.spacing, rows)
    measured = replace(measured, ranges=ranges_of(measured.shape, rows, position))
    arcs, on = _find_arcs(measured, rows, owner, position, spacing, noise)
    theirs = rows_of_runs(on)
    around = mean_of(points.spacing, theirs)
    bends = measure(points.index, arcs, theirs, points, position, around)
    sure = _are_round(arcs, bends, around, noise)
    bends, owner, taken = replace(bends, holds=bends.holds | sure), owner.copy(), []
    for k in np.flatnonzero(sure).tolist():
        left = on[k][owner[on[k]] < count]
        if len(left) > _OWN * len(on[k]):
            owner[left] = count + len(taken)
            taken.append(k)
    every = measured.and_(bends.take(np.array(taken, np.int64)))
    kept = np.flatnonzero(np.bincount(owner[owner >= 0], minlength=len(every.holds)) >= _FEWEST)
    return every.take(kept), rows_of(owner, kept, len(every.holds)), kept >= count


def _find_arcs(
    measured: Measured,
    rows: tuple[np.ndarray, np.ndarray],
    owner: np.ndarray,
    position: np.ndarray,
    spacing: np.ndarray,
    noise: float,
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return arcs (A, 13) that edge points follow better than the two lines they touch, and these edge points."""
    pairs, frames, half, reach = _corners(measured, spacing)
    if not len(pairs):
        return np.empty((0, SHAPE)), []
    index = build_index(position)
    second = knn(index, frames[:, 0], 2).distances[:, 1]
    h = spacing[pairs[:, 0]]
    least = (_LEAST + _BY_NOISE * noise) * h
    may = second > _FREE * least * (1 / np.sin(half) - 1)
    pairs, frames, half, reach, h, least = (part[may] for part in (pairs, frames, half, reach, h, least))
    # Besides their own, lines are asked for points of nobody, of arcs, and of short lines.
    around = knn(index, frames[:, 0], min(_AROUND, len(position))).points
    of = owner[around]
    length = measured.ranges[:, 1] - measured.ranges[:, 0]
    is_arc = measured.shape[:, RADIUS] > 0
    foreign = (of[:, :, None] != pairs[:, None]).all(axis=2) & ((of < 0) | (is_arc | (length < _SHORT * spacing))[of])
    by_line = foreign & (of >= 0) & ~is_arc[of]
    theirs = np.where(foreign, np.inf, -1.0)
    theirs[by_line] = offsets_of(measured.shape[of[by_line]], position[around[by_line]])
    radius, gain = np.zeros(len(pairs)), np.zeros(len(pairs))
    floor = np.maximum(_FLOOR, _SHARE * noise) * h
    arguments = (pairs, frames, half, reach, least, floor, h, position, *rows, around, theirs)
    run_slices(_fit_rounds, len(pairs), *arguments, radius, gain, size=8)
    order = np.flatnonzero(gain > _ABSORBING)
    order = order[np.lexsort((*frames[order, 0].T, -gain[order]))]
    arcs, on = [], []
    for k in order.tolist():
        corner, inwards, across, up = frames[k]
        arc = np.concatenate([corner + radius[k] / np.sin(half[k]) * inwards, -inwards, -across, up, radius[k : k + 1]])
        every = np.concatenate([take_rows(rows, pairs[k])[0], around[k][foreign[k]]])
        x, y, _ = locals_of(arc[None], position[every])
        on_arc = np.abs(np.arctan2(y, x)) < math.pi / 2 - half[k]
        mine = every[on_arc & (offsets_of(arc[None], position[every]) < max(_NEAR * h[k], 10 * floor[k]))]
        shares = np.bincount(owner[mine][owner[mine] >= 0], minlength=len(spacing))
        shares[is_arc] = shares[pairs[k].tolist()] = 0
        absorbs = (shares > _OWN * np.diff(rows[1])).any()
        if gain[k] > (_ABSORBING if absorbs else _GAIN):
            arcs.append(arc)
            on.append(mine)
    return np.array(arcs).reshape(-1, SHAPE), on


def _are_round(arcs: np.ndarray, bends: Measured, spacing: np.ndarray, noise: float) -> np.ndarray:
    """Tell of which arcs (A, 13) the faces (measured in `bends`) say the same, (A,) bool."""
    with np.errstate(divide="ignore"):
        alike = np.abs(np.log(bends.shape[:, RADIUS] / arcs[:, RADIUS])) < _RATIO
    faces = bends.fit[:, _fit.COUNTS : _fit.COUNTS + 2] > 0
    rough = bends.fit[:, _fit.SIGMA : _fit.SIGMA + 2] > (max(_SMOOTH, _BY_FACE * noise) * spacing)[:, None]
    return alike & faces.any(axis=1) & ~(faces & rough).any(axis=1)


def _corners(measured: Measured, spacing: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return pairs of lines (C, 2) that would meet near an end of both, and where: (C, 4, 3), (C,) and (C,).

    The frames are the corner, and unit vectors from it inwards between both lines, across that in their plane, and up;
    with them come half the angle between both lines, and how long these are from the corner on.
    """
    lines = np.flatnonzero(measured.shape[:, RADIUS] == 0)
    if len(lines) < 2:
        return np.empty((0, 2), np.int64), np.empty((0, 4, 3)), np.empty(0), np.empty(0)
    shape, ranges = measured.shape[lines], measured.ranges[lines]
    outwards = np.stack([-shape[:, 9:12], shape[:, 9:12]], axis=1).reshape(-1, 3)
    place = (shape[:, None, :3] + ranges[:, :, None] * shape[:, None, 9:12]).reshape(-1, 3)
    near = knn(build_index(place), place, min(_ENDS, len(place)))
    a, b = np.repeat(np.arange(len(place)), near.points.shape[1]), near.points.ravel()
    both = (a // 2 != b // 2) & (near.distances.ravel() < 2 * _AHEAD * spacing[lines[a // 2]])
    # Each pair once, also where only one of the two has the other among its nearest.
    a, b = np.unique(np.sort(np.stack([a[both], b[both]]), axis=0), axis=1)
    h = spacing[lines[a // 2]]
    cosine, across = (outwards[a] * outwards[b]).sum(axis=1), np.cross(outwards[a], outwards[b])
    sine = np.linalg.norm(across, axis=1)
    turn = np.arctan2(sine, -cosine)
    good = (turn > _LEAST_TURN) & (turn < _MOST_TURN)
    a, b, h, cosine, across, sine = (part[good] for part in (a, b, h, cosine, across, sine))
    way = place[b] - place[a]
    along_a, along_b = (way * outwards[a]).sum(axis=1), (way * outwards[b]).sum(axis=1)
    s, t = (along_a - cosine * along_b) / sine**2, (cosine * along_a - along_b) / sine**2
    good = np.abs((way * across).sum(axis=1)) < _FLAT * h * sine
    for ahead in (s, t):
        good &= (ahead > -_BEHIND * h) & (ahead < _AHEAD * h)
    a, b, h, s, t, across = a[good], b[good], h[good], s[good], t[good], (across / sine[:, None])[good]
    corner = 0.5 * (place[a] + s[:, None] * outwards[a] + place[b] + t[:, None] * outwards[b])
    length = ranges[:, 1] - ranges[:, 0]
    reach = np.minimum(0.95 * np.minimum(length[a // 2] + s, length[b // 2] + t), _LARGEST * h)
    inwards = -outwards[a] - outwards[b]
    size = np.linalg.norm(inwards, axis=1)
    inwards /= size[:, None]
    frames = np.stack([corner, inwards, np.cross(across, inwards), across], axis=1)
    return lines[np.stack([a // 2, b // 2], axis=1)], frames, np.arccos(np.minimum(0.5 * size, 1.0)), reach


@kernel
def _fit_rounds(
    start, stop, pairs, frames, half, reach, least, floor, spacing, position, rows, first, around, theirs, radii, gain
):  # fmt: skip
    """Write the radii of arcs, and what each wins over two lines that meet; 0 where edge points are too few."""
    for k in range(start, stop):
        h, one, two = spacing[k], pairs[k, 0], pairs[k, 1]
        own, count = 0, first[one + 1] - first[one] + first[two + 1] - first[two] + len(around[k])
        flat = np.empty((count, 5))
        for line in pairs[k]:
            for i in rows[first[line] : first[line + 1]]:
                _flatten(position[i], frames[k], half[k], np.inf, flat[own])
                own += 1
        count = own
        for q in range(len(around[k])):
            if theirs[k, q] >= 0.0:
                _flatten(position[around[k, q]], frames[k], half[k], theirs[k, q], flat[count])
                count += 1
        flat = flat[:count]
        radius = _best_radius(flat, half[k], reach[k], h)
        on, now, then, square, near = 0, 0.0, 0.0, 0.0, 0
        for i in range(count):
            miss, sharp = _squared(flat[i], half[k], radius), _squared(flat[i], half[k], 0.0)
            then += min(miss, (_FAR * h) ** 2)
            now += min(sharp, flat[i, 4], (_FAR * h) ** 2)
            on += flat[i, 2] < radius / math.tan(half[k]) and miss < max(_NEAR * h, 10.0 * floor[k]) ** 2
            if i < own and miss < (0.5 * _FAR * h) ** 2:
                square, near = square + miss, near + 1
        if radius > least[k] and on >= max(_FEWEST, _DENSE * radius * (math.pi - 2.0 * half[k]) / h):
            variance = max(square / max(near, 1), floor[k] * floor[k])
            radii[k], gain[k] = radius, (now - then) / (4.0 * variance)  # neighbours come from nearly the same points


@routine
def _flatten(place, frame, half, theirs, point):
    """Write where a place lies: inwards from the corner, across that, along its line; and two squared distances."""
    x = y = z = 0.0
    for axis in range(3):
        away = place[axis] - frame[0, axis]
        x, y, z = x + away * frame[1, axis], y + away * frame[2, axis], z + away * frame[3, axis]
    y = abs(y)
    point[0], point[1], point[2] = x, y, x * math.cos(half) + y * math.sin(half)
    point[3], point[4] = z * z, theirs * theirs


@routine
def _squared(point, half, radius):
    """Return the squared distance of a point from the lines and the arc between."""
    if point[2] < radius / math.tan(half):
        aside = math.hypot(point[0] - radius / math.sin(half), point[1]) - radius
    else:
        aside = point[0] * math.sin(half) - point[1] * math.cos(half)
    return aside * aside + point[3]


@routine
def _misfit(flat, half, radius, h):
    total = 0.0
    for i in range(len(flat)):
        total += min(_squared(flat[i], half, radius), (_FAR * h) ** 2)
    return total


@routine
def _best_radius(flat, half, reach, h):
    """Return the radius that explains most points, tried in steps and then between its neighbours."""
    best, least, radius = h, math.inf, h
    while radius < reach * math.tan(half):
        misfit = _misfit(flat, half, radius, h)
        if misfit < least:
            best, least = radius, misfit
        radius *= _STEP
    low, high = best / _STEP, best * _STEP
    for _ in range(8):
        a, b = low + 0.382 * (high - low), low + 0.618 * (high - low)
        if _misfit(flat, half, a, h) < _misfit(flat, half, b, h):
            high = b
        else:
            low = a
    return 0.5 * (low + high)
