"""The equations of the curve in which two faces meet: the sums of the faces' points, and their solution."""

from __future__ import annotations

import math

from edgel._kernels.cholesky import factorize
from edgel._kernels.parallel import routine
from edgel.curves._circle import RADIUS, local
from edgel.curves._fit import BENT, CENTRE, TURN, UNKNOWNS
from edgel.curves._profile import face_of, in_profile

TOLERANCES = (1.1, 0.8, 0.55)
"""Spacings: how far points of a face may lie from it, round after round; then four deviations."""
LEAST = 8
"""Points of a face: with fewer it is none."""
FLOOR = 0.03
"""Spacings: faces are no smoother than that."""
_CUT = 1.14  # times: the spread of points within four deviations, weighed as they are here, is so much too small
_CORRELATED = 3.0  # edge points next to each other come from the same points of the cloud
_SURELY, _STRAIGHT = 2.5, 0.004  # deviations, and 1 / spacings: a face bends that bends by more
_FIRM = 1e-4  # weight of one point for what no point decides
_SETTLED = 2e-3  # of a step in spacings, or radians: smaller ones change nothing


@routine
def _derivatives(shape, x, y, z, a, b, h, lever, terms):
    """Write how a distance with normal (a, b) in the profile changes with tilt, place, radius and height."""
    by_tilt = h / lever
    if shape[RADIUS] == 0.0:
        terms[0], terms[1], terms[2], terms[3] = -a * z * by_tilt, -b * z * by_tilt, -a * h, -b * h
        terms[6] = terms[7] = 0.0
        return
    rho = math.sqrt(x * x + y * y)
    u, v = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
    terms[0], terms[1] = (b * x - a * u * z) * by_tilt, (b * y - a * v * z) * by_tilt
    terms[2], terms[3], terms[6], terms[7] = -a * u * h, -a * v * h, -a * h, -b * h


@routine
def collect(shape, near, h, lever, depth, tolerance, faces, inward, bend, spread, parts, terms, number):
    """Add up the equations of the points of each face, by its spread, and count them.

    `parts` (2, 8, 9) holds a triangle of products of tilt, place, the face's turn and bend, radius and height; in the
    last column the right side; above the diagonal the sums of weights and of weighted squares.
    """
    for k in range(2):
        number[k] = 0.0
        for m in range(8):
            for n in range(9):
                parts[k, m, n] = 0.0
    size = 6 if shape[RADIUS] == 0.0 else 8
    for i in range(len(near)):
        x, y, z = local(shape, near[i, 0], near[i, 1], near[i, 2])
        p, q = (x, y) if size == 6 else (math.sqrt(x * x + y * y) - shape[RADIUS], z)
        k, off, along = face_of(p, q, h, tolerance, depth, faces, inward, bend)
        if k < 0:
            continue
        _derivatives(shape, x, y, z, faces[k, 0], faces[k, 1], h, lever, terms)
        terms[4], terms[5] = along, -along * along / h
        weight = (1.0 - (off / tolerance) ** 2) ** 2
        number[k] += 1.0
        parts[k, 0, 1] += weight
        parts[k, 0, 2] += weight * off * off
        weight /= max(spread[k], FLOOR * h) ** 2
        for m in range(size):
            one = weight * terms[m]
            parts[k, m, 8] -= one * off
            for n in range(m + 1):
                parts[k, m, n] += one * terms[n]


@routine
def put_together(parts, system, right):
    """Write the equations of all unknowns, both triangles."""
    for m in range(UNKNOWNS):
        right[m] = 0.0
        for n in range(UNKNOWNS):
            system[m, n] = 0.0
    for k in range(2):
        for m in range(8):
            i = m if m < 4 else (TURN + k if m == 4 else (BENT + k if m == 5 else m - 2))
            right[i] += parts[k, m, 8]
            for n in range(m + 1):
                j = n if n < 4 else (TURN + k if n == 4 else (BENT + k if n == 5 else n - 2))
                system[i, j] += parts[k, m, n]
                if m != n:
                    system[j, i] += parts[k, m, n]


@routine
def spread_of(parts, number, turn, faces, spread):
    """Write the spreads of points about their faces, drop faces of too few, and return the larger; -1 of none."""
    sigma = -1.0
    for k in range(2):
        if number[k] < LEAST:
            faces[k, 0] = faces[k, 1] = 0.0
            continue
        cut = _CUT if turn >= len(TOLERANCES) else 1.0
        spread[k] = cut * math.sqrt(parts[k, 0, 2] / max(parts[k, 0, 1] - 4.0, 1.0))
        sigma = max(sigma, spread[k])
    return sigma


@routine
def collect_edge(shape, rows, position, h, lever, across, system, right, terms):
    """Add the equations of the edge points, along the only face, and return their spread."""
    square = weights = 0.0
    for i in rows:
        p, q, _ = in_profile(shape, position[i, 0], position[i, 1], position[i, 2])
        off = across[0] * p + across[1] * q
        weight = 1.0 / (1.0 + (off / (0.5 * h)) ** 2)
        square, weights = square + weight * off * off, weights + weight
    spread = max(math.sqrt(square / max(weights - 3.0, 1.0)), 0.05 * h)
    for i in rows:
        x, y, z = local(shape, position[i, 0], position[i, 1], position[i, 2])
        p, q, _ = in_profile(shape, position[i, 0], position[i, 1], position[i, 2])
        off = across[0] * p + across[1] * q
        _derivatives(shape, x, y, z, across[0], across[1], h, lever, terms)
        terms[4], terms[5] = terms[6], terms[7]
        weight = 1.0 / (1.0 + (off / (0.5 * h)) ** 2) / (_CORRELATED * spread * spread)
        for m in range(TURN):
            right[m] -= weight * terms[m] * off
            for n in range(TURN):
                system[m, n] += weight * terms[m] * terms[n]
    return spread


@routine
def solve(system, right, free, h, lever, lower, inner, covariance, judge):
    """Solve for the free unknowns, into `right`, and write their covariance in the cloud's unit (tilts in radians)."""
    firm = 0.5 * _FIRM * (system[CENTRE, CENTRE] + system[CENTRE + 1, CENTRE + 1])
    for m in range(UNKNOWNS):
        # What no point decides stays: a step of a spacing, or a tilt or turn of a third, weighs as one deviation.
        system[m, m] += firm + (1.0 if m < TURN else 10.0)
    again = True
    while again:
        for m in range(UNKNOWNS):
            if not free[m]:
                for n in range(UNKNOWNS):
                    system[m, n] = system[n, m] = 0.0
                system[m, m], right[m] = 1.0, 0.0
        factorize(system, lower, inner)
        for m in range(UNKNOWNS):
            for n in range(m + 1):
                total = 0.0
                for i in range(m, UNKNOWNS):
                    total += inner[i, m] * inner[i, n]
                covariance[m, n] = covariance[n, m] = total
        again = False
        for m in range(BENT, UNKNOWNS):
            step = 0.0
            for n in range(UNKNOWNS):
                step += covariance[m, n] * right[n]
            if judge and free[m] and abs(step) < max(_SURELY * math.sqrt(covariance[m, m]), _STRAIGHT):
                free[m], again = False, True
    for m in range(UNKNOWNS):
        lower[0, m] = 0.0
        for n in range(UNKNOWNS):
            lower[0, m] += covariance[m, n] * right[n]
    for m in range(UNKNOWNS):
        right[m] = lower[0, m] if free[m] else 0.0
        for n in range(UNKNOWNS):
            if free[m] and free[n]:
                covariance[m, n] *= _unit_of(m, h, lever) * _unit_of(n, h, lever)
            else:
                covariance[m, n] = 0.0


@routine
def is_small(step):
    largest = 0.0
    for m in range(BENT):
        largest = max(largest, abs(step[m]))
    return largest <= _SETTLED


@routine
def _unit_of(unknown, h, lever):
    if unknown < CENTRE:
        return h / lever
    return h if unknown < TURN else (1.0 if unknown < BENT else 1.0 / h)
