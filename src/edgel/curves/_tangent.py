"""Lines that go smoothly over into arcs: their joints are where they touch, and no corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel.curves._circle import RADIUS
from edgel.curves._corners import REACH, Nodes
from edgel.curves._strands import Strands

_TOUCHING = 0.35  # spacings: a line that passes the centre at the radius, but for so much, touches the circle
_ALONG = 0.1  # sine of the angle between a line and the plane of an arc that it touches


def touch(strands: Strands, nodes: Nodes) -> Nodes:
    """Move nodes of a line and an arc that touch to where they do.

    Near there both run side by side, and where their ends were found says little: an end a spacing too far along an arc
    of three turns by 20 degrees.
    """
    ends = np.argwhere(nodes.of_end >= 0)
    of = nodes.of_end[ends[:, 0], ends[:, 1]]
    order = np.argsort(of, kind="stable")
    counts = np.bincount(of, minlength=len(nodes.position))
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
    pairs = np.flatnonzero(counts == 2)
    a, b = (ends[order[first[pairs] + k], 0] for k in (0, 1))
    radius = strands.shape[:, RADIUS]
    line, arc = np.where(radius[a] == 0, a, b), np.where(radius[a] == 0, b, a)
    kept = (radius[line] == 0) & (radius[arc] > 0)
    pairs, line, arc = pairs[kept], line[kept], arc[kept]
    shape, round_ = strands.shape[line], strands.shape[arc]
    direction = shape[:, 9:12]
    offset = round_[:, :3] - shape[:, :3]
    foot = shape[:, :3] + np.einsum("ij,ij->i", offset, direction)[:, None] * direction
    distance = np.linalg.norm(round_[:, :3] - foot, axis=1)
    h = strands.spacing[line]
    touching = np.abs(distance - round_[:, RADIUS]) < _TOUCHING * h
    touching &= np.abs(np.einsum("ij,ij->i", direction, round_[:, 9:12])) < _ALONG
    touching &= np.linalg.norm(foot - nodes.position[pairs], axis=1) < REACH * h
    position, is_corner = nodes.position.copy(), nodes.is_corner.copy()
    position[pairs[touching]], is_corner[pairs[touching]] = foot[touching], False
    return replace(nodes, position=position, is_corner=is_corner)
