"""Verification: how far a pose is confirmed by edges and surface, and what speaks against it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel.matching._grid import Grid, build_grid, find_cell
from edgel.matching._half_edges import MIN_FACING, HalfEdges
from edgel.matching._sight import Sight, look

_FRAME_COSINE = math.cos(math.radians(20.0))
_NORMAL_COSINE = math.cos(math.radians(30.0))
TURN = 0.22  # radians by which the two sides of one edge may differ
OUTLINE = 0.6  # weight of an outline's match: only one face is seen, and where a view ends is no edge
EDGE, SURFACE, THROUGH, MISSING, VISIBLE, NOTHING = range(6)
"""Columns of `confirm`."""
_EDGES = 1.5  # weight of the edges' share against the surface's
_MISSING = 2.5  # weight of creases where the other surface is seen to be smooth
_THROUGH = 6.0  # and of surface that the sensor looked through: a true pose has next to none
_NOTHING = 3.0  # and of surface that faces the sensor where it looked and got nothing


class Probes(NamedTuple):
    """What of one cloud is looked for in the other: half-edges and places on the surface, with weights."""

    places: np.ndarray
    frames: np.ndarray
    turn: np.ndarray
    bend: np.ndarray
    weights: np.ndarray
    surface: np.ndarray
    normals: np.ndarray
    surface_weights: np.ndarray


class Field(NamedTuple):
    """Where it is looked for: half-edges and surface of the other cloud, on grids, and what its sensor saw."""

    places: np.ndarray
    frames: np.ndarray
    turn: np.ndarray
    bend: np.ndarray
    grid: Grid
    surface: np.ndarray
    normals: np.ndarray
    smooth: np.ndarray
    surface_grid: Grid
    sight: Sight


def probes_of(
    half: HalfEdges, weights: np.ndarray, surface: np.ndarray, normals: np.ndarray, shares: np.ndarray
) -> Probes:
    """Make the arrays of a `Probes`."""
    turn = np.nan_to_num(half.turn, nan=-1.0)
    return Probes(half.places, half.frames, turn, half.bend, weights, surface, normals, shares)


def field_of(
    half: HalfEdges,
    surface: np.ndarray,
    normals: np.ndarray,
    smooth: np.ndarray,
    sight: Sight,
    reach: float,
    surface_reach: float,
) -> Field:
    """Make a field that finds edges and surface within their reach."""
    turn, grid = np.nan_to_num(half.turn, nan=-1.0), build_grid(half.places, reach)
    surface_grid = build_grid(surface, surface_reach)
    return Field(half.places, half.frames, turn, half.bend, grid, surface, normals, smooth, surface_grid, sight)


@kernel
def find_edge(field, pose, x, y, z, frame, turn, bend, tolerance):
    """Find the half-edge that best fits one of the other cloud, moved to a place; returns the fit, 0 to 1, and its row.

    Only the distance across the edge counts, along it within the grid's reach.
    """
    slot = find_cell(field.grid, x, y, z)
    best, found, turned = 0.0, -1, False
    d0 = d1 = d2 = m0 = m1 = m2 = 0.0
    for member in range(field.grid.first[slot], field.grid.last[slot]):
        e = field.grid.members[member]
        ox, oy, oz = x - field.places[e, 0], y - field.places[e, 1], z - field.places[e, 2]
        along = ox * field.frames[e, 2, 0] + oy * field.frames[e, 2, 1] + oz * field.frames[e, 2, 2]
        across = ox * ox + oy * oy + oz * oz - along * along
        if across >= tolerance * tolerance or abs(along) > field.grid.cell:
            continue
        both = turn >= 0.0 and field.turn[e] >= 0.0
        if both and (abs(turn - field.turn[e]) > TURN or bend * field.bend[e] < 0):
            continue
        if not both and (bend < 0 or field.bend[e] < 0):
            continue
        if not turned:
            d0, d1, d2 = turned_by(pose, frame[0])
            m0, m1, m2 = turned_by(pose, frame[1])
            turned = True
        if m0 * field.frames[e, 1, 0] + m1 * field.frames[e, 1, 1] + m2 * field.frames[e, 1, 2] < _FRAME_COSINE:
            continue
        if d0 * field.frames[e, 0, 0] + d1 * field.frames[e, 0, 1] + d2 * field.frames[e, 0, 2] < _FRAME_COSINE:
            continue
        fit = (1.0 if both else OUTLINE) * (1.0 - across / (tolerance * tolerance))
        if fit > best:
            best, found = fit, e
    return best, found


@kernel
def find_surface(field, x, y, z, n0, n1, n2, tolerance):
    """Find the nearest place of the surface whose normal is alike; returns its row, or -1, and how far off it is."""
    slot = find_cell(field.surface_grid, x, y, z)
    nearest, found, offset = field.surface_grid.cell * field.surface_grid.cell, -1, np.inf
    for member in range(field.surface_grid.first[slot], field.surface_grid.last[slot]):
        s = field.surface_grid.members[member]
        ox, oy, oz = x - field.surface[s, 0], y - field.surface[s, 1], z - field.surface[s, 2]
        squared = ox * ox + oy * oy + oz * oz
        if squared >= nearest:
            continue
        if n0 * field.normals[s, 0] + n1 * field.normals[s, 1] + n2 * field.normals[s, 2] < _NORMAL_COSINE:
            continue
        away = ox * field.normals[s, 0] + oy * field.normals[s, 1] + oz * field.normals[s, 2]
        if abs(away) > tolerance:
            continue
        nearest, found, offset = squared, s, away
    return found, offset


@kernel
def turned_by(pose, vector):
    """Turn a vector (3,) by the rotation of a pose (4, 4)."""
    x, y, z = vector[0], vector[1], vector[2]
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@kernel
def move(pose, place):
    """Move a place (3,) by a pose (4, 4)."""
    x, y, z = turned_by(pose, place)
    return x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]


@kernel
def _confirm(start, stop, poses, probes, field, tolerance, columns):
    has_sight = len(field.sight.near) > 1
    for p in range(start, stop):
        pose = poses[p]
        edge, missing, weight = 0.0, 0.0, 0.0
        for e in range(len(probes.weights)):
            x, y, z = move(pose, probes.places[e])
            w = probes.weights[e]
            weight += w
            fit, _ = find_edge(field, pose, x, y, z, probes.frames[e], probes.turn[e], probes.bend[e], tolerance)
            edge += w * fit
            if fit == 0.0 and probes.turn[e] >= 0.0:
                n0, n1, n2 = turned_by(pose, probes.frames[e, 1])
                bend = probes.bend[e]  # the normal of the surface itself
                found, _ = find_surface(field, x, y, z, bend * n0, bend * n1, bend * n2, tolerance)
                if found >= 0 and field.smooth[found]:
                    missing += w
        surface, through, visible, nothing, share = 0.0, 0.0, 0.0, 0.0, 0.0
        for s in range(len(probes.surface_weights)):
            x, y, z = move(pose, probes.surface[s])
            n0, n1, n2 = turned_by(pose, probes.normals[s])
            w = probes.surface_weights[s]
            share += w
            found, offset = find_surface(field, x, y, z, n0, n1, n2, tolerance)
            if found >= 0:
                surface += w * (1.0 - (offset / tolerance) ** 2)
                visible += w
                continue
            seen = look(field.sight, x, y, z, 1.5 * tolerance)
            if seen < 0:
                through += w
            if seen <= 0 or not has_sight:
                visible += w
            if seen == 3 and _faces(field.sight.eye, x, y, z, n0, n1, n2):
                nothing += w
        columns[p, 0] = edge / weight if weight > 0.0 else 0.0
        columns[p, 1], columns[p, 2] = surface / share, through / share
        columns[p, 3] = missing / weight if weight > 0.0 else 0.0
        columns[p, 4], columns[p, 5] = visible / share, nothing / share


@kernel
def _faces(eye, x, y, z, n0, n1, n2):
    """Tell whether a surface at a place faces a sensor's, by `MIN_FACING`."""
    dx, dy, dz = eye[0] - x, eye[1] - y, eye[2] - z
    return n0 * dx + n1 * dy + n2 * dz > MIN_FACING * math.sqrt(dx * dx + dy * dy + dz * dz)


def confirm(poses: np.ndarray, probes: Probes, field: Field, tolerance: float) -> np.ndarray:
    """Look how far poses (P, 4, 4) are confirmed.

    Returns
    -------
    (P, 6) float64
        Shares, 0 to 1, by columns: `EDGE` of the edges found, `SURFACE` of the surface found, both by how near;
        `THROUGH` of the surface through which the other sensor looked; `MISSING` of the creases where the other surface
        is smooth; `VISIBLE` of the surface where the other sensor, if there is one, saw something no nearer; `NOTHING`
        of the surface that faces the other sensor, which looked there and got nothing.
    """
    columns = np.empty((len(poses), 6))
    run_slices(_confirm, len(poses), np.ascontiguousarray(poses), probes, field, tolerance, columns, size=16)
    return columns


def scores_of(columns: np.ndarray) -> np.ndarray:
    """Weigh what speaks for poses (P, 6) against what speaks against them, (P,): at most 1."""
    for_it = _EDGES * columns[:, EDGE] + columns[:, SURFACE]
    against = _THROUGH * columns[:, THROUGH] + _MISSING * columns[:, MISSING] + _NOTHING * columns[:, NOTHING]
    return (for_it - against) / (1 + _EDGES)
