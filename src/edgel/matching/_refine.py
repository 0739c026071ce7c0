"""Refinement: planes settle what they can, edges fill what planes leave free."""

from __future__ import annotations

import math

import numpy as np

from edgel._kernels.cholesky import explain, factorize, solve
from edgel._kernels.eigen import turn_to_axes
from edgel._kernels.parallel import kernel, routine, run_slices
from edgel.matching._verify import Field, Probes, find_edge, find_surface, move, turned_by

_SHRINK = 0.75  # of the reach, from step to step
_ROBUST = 0.5  # of the reach: residuals at which a match counts a quarter (Geman and McClure)
_LIGHT = 20.0  # plane points that all edges together weigh as in the end: an edge is off along its whole length alike
_NORMAL_NOISE = 0.06  # radians by which normals are off: so much of a plane tells of directions that it leaves free
_DAMPING = 1e-4  # of the mean weight, so that what nothing settles stays as it is
_SETTLED = 1e-5  # of the reach: a step that moves less is the last


@routine
def _add(matrix, right, normal, offset, away, radius, weight):
    """Add one distance along a normal (3,) at an offset (3,) from the centre; rotations count as arcs at the radius."""
    row = np.empty(6)
    row[0] = (offset[1] * normal[2] - offset[2] * normal[1]) / radius
    row[1] = (offset[2] * normal[0] - offset[0] * normal[2]) / radius
    row[2] = (offset[0] * normal[1] - offset[1] * normal[0]) / radius
    row[3], row[4], row[5] = normal[0], normal[1], normal[2]
    for i in range(6):
        right[i] -= weight * row[i] * away
        for j in range(i + 1):
            matrix[i, j] += weight * row[i] * row[j]


@routine
def _equations(pose, probes, field, centre, radius, reach, light, information, sums, matrix, right):
    """Write the normal equations of one step, and what planes and edges tell and weigh, each by themselves."""
    planes, edges = information[0], information[1]
    planes[:], edges[:], right[:], sums[:] = 0.0, 0.0, 0.0, 0.0
    edges_right, offset = np.zeros(6), np.empty(3)
    for e in range(len(probes.weights)):
        x, y, z = move(pose, probes.places[e])
        _, found = find_edge(field, pose, x, y, z, probes.frames[e], probes.turn[e], probes.bend[e], reach)
        if found < 0:
            continue
        offset[0], offset[1], offset[2] = x - centre[0], y - centre[1], z - centre[2]
        for side in range(2):
            normal, away = field.frames[found, side], 0.0
            away += (x - field.places[found, 0]) * normal[0]
            away += (y - field.places[found, 1]) * normal[1]
            away += (z - field.places[found, 2]) * normal[2]
            w = 1.0 / (1.0 + (away / (_ROBUST * reach)) ** 2) ** 2
            _add(edges, edges_right, normal, offset, away, radius, w)
            sums[2] += w
            sums[3] += w * away * away
    for s in range(len(probes.surface_weights)):
        x, y, z = move(pose, probes.surface[s])
        n0, n1, n2 = turned_by(pose, probes.normals[s])
        found, away = find_surface(field, x, y, z, n0, n1, n2, reach)
        if found < 0:
            continue
        offset[0], offset[1], offset[2] = x - centre[0], y - centre[1], z - centre[2]
        w = 1.0 / (1.0 + (away / (_ROBUST * reach)) ** 2) ** 2
        _add(planes, right, field.normals[found], offset, away, radius, w)
        sums[0] += w
        sums[1] += w * away * away
    share = 1.0
    if light:
        share = min(1.0, _LIGHT / max(sums[2], 1e-9))
        _without_noise(planes, right, _NORMAL_NOISE * _NORMAL_NOISE * sums[0])
    for i in range(6):
        right[i] += share * edges_right[i]
        for j in range(i + 1):
            edges[i, j] *= share
            matrix[i, j] = planes[i, j] + edges[i, j]
        matrix[i, i] += _DAMPING * (sums[0] + share * sums[2])


@routine
def _without_noise(planes, right, noise):
    """Take what the noise of normals adds to each axis of the planes' information (6, 6) out of it, in place.

    The normals of a long bar's sides, each off a little, would settle where it lies along itself; its ends' edges know.
    """
    values, vectors = np.empty((6, 6)), np.empty((6, 6))
    for i in range(6):
        for j in range(i + 1):
            values[i, j] = values[j, i] = planes[i, j]
    turn_to_axes(values, vectors)
    old = right.copy()
    planes[:], right[:] = 0.0, 0.0
    for axis in range(6):
        told = max(values[axis, axis] - noise, 0.0)
        if told == 0.0:
            continue
        along = 0.0
        for i in range(6):
            along += vectors[i, axis] * old[i]
        for i in range(6):
            right[i] += vectors[i, axis] * along * told / values[axis, axis]
            for j in range(i + 1):
                planes[i, j] += vectors[i, axis] * told * vectors[j, axis]


@routine
def _turn(pose, turn, shift, centre):
    """Turn a pose about a centre by a rotation vector (3,), and shift it, in place."""
    angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    a = math.sin(angle) / angle if angle > 1e-12 else 1.0
    b = (1.0 - math.cos(angle)) / (angle * angle) if angle > 1e-6 else 0.5
    old = pose.copy()
    for column in range(4):
        v = np.empty(3)
        for i in range(3):
            v[i] = old[i, column] - (centre[i] if column == 3 else 0.0)
        dot = turn[0] * v[0] + turn[1] * v[1] + turn[2] * v[2]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            cross = turn[j] * v[k] - turn[k] * v[j]
            pose[i, column] = math.cos(angle) * v[i] + a * cross + b * turn[i] * dot
            if column == 3:
                pose[i, 3] += centre[i] + shift[i]


@kernel
def _refine(start, stop, poses, probes, field, middle, radius, reaches, steps, information, residuals):
    matrix, lower, inverse = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6))
    right, along, solution, centre = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(3)
    for p in range(start, stop):
        pose, reach = poses[p], reaches[0]
        for step in range(steps[0] + steps[1]):
            light = step >= steps[0]
            centre[0], centre[1], centre[2] = move(pose, middle)
            told, sums = information[p], residuals[p]
            _equations(pose, probes, field, centre, radius, reach, light, told, sums, matrix, right)
            factorize(matrix, lower, inverse)
            explain(inverse, right, along)
            solve(inverse, along, solution)
            _turn(pose, solution[:3] / radius, solution[3:], centre)
            largest = 0.0
            for i in range(6):
                largest = max(largest, abs(solution[i]))
            if light and largest < _SETTLED * reach:
                break
            reach = max(_SHRINK * reach, reaches[1])


def refine(
    poses: np.ndarray, probes: Probes, field: Field, reaches: tuple[float, float], steps: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move poses to where edges and planes agree best, each on its own.

    Parameters
    ----------
    poses : (P, 4, 4) float64
    probes : Probes
    field : Field
    reaches : (float, float)
        Within which matches are looked for, at first and in the end.
    steps : (int, int)
        With edges at their full weight, and then with light ones.

    Returns
    -------
    (P, 4, 4) float64
        The poses.
    (P, 2, 6, 6) float64
        What planes tell of them, and edges, as one weighs them: of the turn about the moved middle of the probes
        (rotation vector times `radius_of`), then of the shift, per unit variance of a distance.
    (P, 4) float64
        Weight of the planes' residuals, the weighted sum of their squares, and the same of the edges.
    """
    moved, information = np.array(poses, np.float64), np.zeros((len(poses), 2, 6, 6))
    residuals = np.zeros((len(poses), 4))
    middle, radius = middle_of(probes), radius_of(probes)
    reach, whole = np.array(reaches, np.float64), np.array(steps, np.int64)
    run_slices(_refine, len(moved), moved, probes, field, middle, radius, reach, whole, information, residuals, size=1)
    lower = np.tril(information)
    return moved, lower + np.tril(information, -1).transpose(0, 1, 3, 2), residuals


def middle_of(probes: Probes) -> np.ndarray:
    """Return the middle (3,) about which poses are turned."""
    return probes.surface.mean(axis=0)


def radius_of(probes: Probes) -> float:
    """Return the distance from the middle at which turns are measured as arcs."""
    return float(np.sqrt(((probes.surface - middle_of(probes)) ** 2).sum(axis=1).mean()))
