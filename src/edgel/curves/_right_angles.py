"""Lines turned so that they meet at right angles in plan, where they nearly do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._kernels.union_find import join
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.curves._curves import CurveKind, Curves

_FREE = 1e-6  # weight of where a node was, over that of a line through it
_NEIGHBORS, _REACH = 32, 20.0  # lines that tell a main direction; spacings within which they lie
_JOINED = 5.0  # weight of lines that nodes join with the one that is turned, over that of others as long
_ALIKE = np.radians(2)  # main directions of lines that nodes join: nearer ones are one
_ROUNDS, _STRAY = 5, np.radians(4)  # of the robust mean of directions
_STEEP = 0.9  # of a direction's rise: lines as steep have no direction in plan


def right_angles(curves: Curves, within: float) -> Curves:
    """Turn lines in plan to the main direction of their neighbours, or across it, where they nearly lie so.

    For outlines of buildings. The main direction is the one that most of the lines within 20 spacings agree on, the
    longer the surer and those that nodes join with the line before others, right angles counted as none: eaves of a few
    points are turned by what walls and ridges beside them say. A line turns about its middle, heights stay, and nodes
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
    joined = _joined(curves.nodes[lines], plan)
    main = _main_directions(middle, plan, angle, join(len(lines), *joined), curves.spacing[lines])
    off = _quarter(angle - _shared(main, plan, joined))
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


def _main_directions(
    middle: np.ndarray, plan: np.ndarray, angle: np.ndarray, group: np.ndarray, spacing: np.ndarray
) -> np.ndarray:
    """Return the main direction beside each of some lines (L,), by their middles (L, 3), lengths and angles in plan.

    The neighbour's direction that the others agree with most, then the robust mean about it: a mean of all would lie
    between two buildings that stand askew.
    """
    if not len(plan):
        return angle
    places = middle - middle.mean(axis=0)
    near = knn(build_index(places), places, min(_NEIGHBORS, len(plan)))
    apart = near.distances - 0.5 * plan[near.points]
    rows = np.arange(len(plan))
    joined = (group[near.points] == group[:, None]) & (near.points != rows[:, None])
    weight = np.where(apart < _REACH * spacing[:, None], np.where(joined, _JOINED, 1.0) * plan[near.points] ** 2, 0.0)
    theirs = angle[near.points]
    agreeing = np.stack([_mean(theirs, weight, theirs[:, k])[1] for k in range(theirs.shape[1])], axis=1)
    main = theirs[rows, agreeing.argmax(axis=1)]
    for _ in range(_ROUNDS):
        main, _ = _mean(theirs, weight, main)
    return main


def _mean(angle: np.ndarray, weight: np.ndarray, main: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean (L,) of angles (L, K) about main directions (L,), less of those farther off, and their weight."""
    off = _quarter(angle - main[:, None])
    weight = weight / (1.0 + (off / _STRAY) ** 2)
    total = weight.sum(axis=1)
    return main + (weight * off).sum(axis=1) / total, total


def _quarter(angle: np.ndarray) -> np.ndarray:
    """Return angles less whole right angles, within 45 degrees of zero."""
    return angle - 0.5 * np.pi * np.round(angle / (0.5 * np.pi))


def _joined(nodes: np.ndarray, plan: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of lines (L,) that share a node, of (L, 2): each with the longest there."""
    line, end = np.nonzero(nodes >= 0)
    node = nodes[line, end]
    order = np.lexsort((line, -plan[line], node))
    first = order[np.searchsorted(node[order], node)]
    return line, line[first]


def _shared(main: np.ndarray, plan: np.ndarray, joined: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the main directions of lines (L,): those that nodes join share one where theirs nearly agree."""
    line, other = joined
    alike = np.abs(_quarter(main[line] - main[other])) < _ALIKE
    group = join(len(main), line[alike], other[alike])
    first = main[np.unique(group, return_index=True)[1]][group]
    off = _quarter(main - first)
    weight = plan**2
    return first + (np.bincount(group, weight * off) / np.bincount(group, weight))[group]


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
