"""Lines turned so that they meet at right angles in plan, where they nearly do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._kernels.union_find import join
from edgel.curves._curves import CurveKind, Curves

_FREE = 1e-6  # weight of where a node was, over that of a line through it
_ROUNDS, _STRAY = 5, np.radians(4)  # of the robust mean of directions
_STEEP = 0.9  # of a direction's rise: lines as steep have no direction in plan


def right_angles(curves: Curves, within: float) -> Curves:
    """Turn lines in plan to the main direction of their neighbours, or across it, where they nearly lie so.

    For outlines of buildings. The lines that are joined by nodes are one group; its main direction is their robust
    mean, the longer the surer, right angles counted as none. A line turns about its middle, heights stay, and nodes
    move to where the turned lines meet. Arcs, circles and polylines stay; lengths become those of the turned lines,
    other measures stay.

    Parameters
    ----------
    curves : Curves
    within : float
        Lines that are off by more stay, in radians.

    Raises
    ------
    ValueError
        If that is no angle between 0 and 45 degrees.
    """
    if not 0 < within <= np.pi / 4:
        raise ValueError(f"within: expected an angle above 0 and up to 45 degrees (in radians), got {within}")
    rise = np.abs(curves.direction[:, 2])
    lines = np.flatnonzero((curves.kind == CurveKind.LINE) & (rise < _STEEP))
    ends = np.stack([curves.start[lines], curves.start[lines + 1] - 1], axis=1)
    first, last = curves.vertices[ends[:, 0]], curves.vertices[ends[:, 1]]
    middle, way = 0.5 * (first + last), last - first
    plan = np.hypot(way[:, 0], way[:, 1])
    angle = np.arctan2(way[:, 1], way[:, 0])
    group = _groups(curves.nodes[lines], len(curves.node_position))
    weight, off = plan**3, np.zeros(len(plan))  # the variance of a direction goes down with the third power
    for _ in range(_ROUNDS):
        sure = weight / (1.0 + (off / _STRAY) ** 2)
        x, y = np.bincount(group, sure * np.cos(4 * angle)), np.bincount(group, sure * np.sin(4 * angle))
        off = angle - 0.25 * np.arctan2(y, x)[group]
        off -= 0.5 * np.pi * np.round(off / (0.5 * np.pi))
    angle = np.where(np.abs(off) <= within, angle - off, angle)
    turned = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    position = _meeting_places(curves, lines, middle[:, :2], turned)
    vertices = curves.vertices.copy()
    for end, sign in ((0, -0.5), (1, 0.5)):
        node = curves.nodes[lines, end]
        free = middle[:, :2] + sign * plan[:, None] * turned
        vertices[ends[:, end], :2] = np.where(node[:, None] >= 0, position[node], free)
    length = curves.length.copy()
    way = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    length[lines] = np.linalg.norm(way, axis=1)
    direction = curves.direction.copy()
    direction[lines] = way / np.maximum(length[lines, None], 1e-300)
    nodes = curves.node_position.copy()
    nodes[:, :2] = position[: len(nodes)]
    return replace(curves, vertices=vertices, length=length, direction=direction, node_position=nodes)


def _groups(nodes: np.ndarray, count: int) -> np.ndarray:
    """Number the groups of lines (L,) that share nodes (L, 2) of `count`."""
    line, end = np.nonzero(nodes >= 0)
    return join(len(nodes) + count, line, len(nodes) + nodes[line, end])[: len(nodes)]


def _meeting_places(curves: Curves, lines: np.ndarray, middle: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Return where the lines of each node meet in plan, (M + 1, 2), by least squares; the last stands for no node."""
    count = len(curves.node_position)
    old = np.concatenate([curves.node_position[:, :2], np.zeros((1, 2))])
    across = np.stack([-way[:, 1], way[:, 0]], axis=1)
    square = np.einsum("li,lj->lij", across, across)
    matrix = np.tile(_FREE * np.eye(2), (count + 1, 1, 1))
    side = np.zeros_like(old)  # of how far nodes move: coordinates of maps are long
    # What else ends at a node holds it where it is.
    others = np.setdiff1d(np.arange(len(curves)), lines)
    held = curves.nodes[others].ravel()
    np.add.at(matrix, held, np.eye(2))
    for end in (0, 1):
        node = curves.nodes[lines, end]
        np.add.at(matrix, node, square)
        np.add.at(side, node, np.einsum("lij,lj->li", square, middle - old[node]))
    return old + np.linalg.solve(matrix, side[..., None])[..., 0]
