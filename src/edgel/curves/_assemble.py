"""Strands become curves: they meet at corners, end there, and what is known of each is written down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel.curves import _fit
from edgel.curves._circle import RADIUS, locals_of
from edgel.curves._corners import Nodes, corners_of_shapes, meet, without_passed, without_unsure
from edgel.curves._curves import CurveKind, Curves
from edgel.curves._gather import on_shapes
from edgel.curves._loops import find_loops
from edgel.curves._measure import noise_of
from edgel.curves._points import EdgePoints
from edgel.curves._strands import Strands, along_of_all, ends_of, past
from edgel.curves._tangent import touch, with_joints
from edgel.curves._through import meet_through
from edgel.edges import EdgeKind, Edges

_SHORT, _SHORTEST = 2.5, 1.0
"""Spacings: shorter curves that meet nothing are none, and shorter ones altogether."""
_CHORD = 0.01  # spacings: so far are the chords of an arc off it, at most
_FREE_END = 0.5  # spacings: standard deviation of where a curve ends that meets nothing
_HELD = 0.005  # spacings: so near a corner an arc is held to it
_ORDER = (EdgeKind.CREASE, EdgeKind.BOUNDARY, EdgeKind.OCCLUDING, EdgeKind.COLOR, EdgeKind.IMAGE)


def assemble(strands: Strands, points: EdgePoints, edges: Edges, origin: np.ndarray, crs: str | None) -> Curves:
    """Make curves of strands."""
    strands, touching = touch(strands)
    nodes = with_joints(strands, meet(ends_of(strands), strands.shape, strands.spacing), touching)
    noise = noise_of(strands, strands.spacing)
    nodes, through = meet_through(strands, without_unsure(nodes, noise, strands.spacing))
    nodes = without_passed(nodes, through, strands.shape, points.position, noise, strands.spacing)
    nodes = corners_of_shapes(nodes, through, strands.is_run)
    strands = end_at_nodes(strands, nodes)
    kept = np.flatnonzero(_long_enough(strands, nodes))
    number = np.full(len(strands), -1)
    number[kept] = np.arange(len(kept))
    through = np.stack([through[:, 0], number[through[:, 1]]], axis=1)
    strands, nodes = strands.take(kept), replace(nodes, of_end=nodes.of_end[kept])
    nodes, through = _without_lonely(nodes, through[through[:, 1] >= 0])
    vertices, start = _vertices(strands, nodes)
    kinds = _kinds_of(strands)
    edge = _majority(strands, points.kind)
    loop, is_hole = find_loops(strands, nodes, vertices, start, edge, points)
    radius = np.where(kinds >= CurveKind.ARC, strands.shape[:, RADIUS], np.nan)
    radius[kinds == CurveKind.POLYLINE] = np.nan
    length = _lengths(vertices, start)
    is_arc = np.isfinite(radius)
    length[is_arc] = (strands.along[:, 1] - strands.along[:, 0])[is_arc]
    return Curves(
        kind=kinds,
        edge=edge,
        vertices=vertices + origin,
        start=start,
        rows=points.rows[strands.rows[0]],
        row_start=strands.rows[1],
        closed=strands.closed,
        length=length,
        length_std=_length_std(strands, nodes, radius),
        position_std=_position_std(strands, points, edges),
        centre=np.where(is_arc[:, None], strands.shape[:, :3] + origin, np.nan),
        direction=_directions(strands, vertices, start, kinds),
        direction_std=strands.fit[:, _fit.TURN_STD],
        radius=radius,
        radius_std=np.where(is_arc, strands.fit[:, _fit.RADIUS_STD], np.nan),
        **_angles(strands, points, edges),
        convex=_convex(strands, points),
        measured=strands.fit[:, _fit.STATE] == _fit.MEASURED,
        nodes=nodes.of_end,
        node_position=nodes.position + origin,
        node_std=nodes.std,
        is_corner=nodes.is_corner,
        through=through,
        loop=loop,
        is_hole=is_hole,
        spacing=strands.spacing,
        crs=crs,
    )


def end_at_nodes(strands: Strands, nodes: Nodes) -> Strands:
    """Let strands with shapes end at their nodes; arcs are fitted again so that they pass through them."""
    shape, along = strands.shape.copy(), strands.along.copy()
    covariance = strands.covariance.copy()
    for _ in range(2):  # a step is linear
        for end in (0, 1):
            arcs = np.flatnonzero((nodes.of_end[:, end] >= 0) & (shape[:, RADIUS] > 0) & ~strands.closed)
            places = nodes.position[nodes.of_end[arcs, end]]
            shape[arcs], covariance[arcs] = _held(shape[arcs], covariance[arcs], places, strands.spacing[arcs])
    for end in (0, 1):
        ending = np.flatnonzero((nodes.of_end[:, end] >= 0) & ~strands.is_run)
        at = along_of_all(shape[ending], nodes.position[nodes.of_end[ending, end]])
        around = 2 * np.pi * shape[ending, RADIUS]
        before = strands.along[ending, end] * np.where(
            around > 0, shape[ending, RADIUS] / np.where(around > 0, strands.shape[ending, RADIUS], 1.0), 1.0
        )
        along[ending, end] = past(at, before - 0.5 * around, shape[ending])
    return replace(strands, shape=shape, along=along, covariance=covariance)


def _held(
    shape: np.ndarray, covariance: np.ndarray, places: np.ndarray, spacing: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return circles (N, 13) moved within their covariance so that they pass through places (N, 3), each its own.

    The update of a Kalman filter: the least change of all unknowns, in their standard deviations, that does it.
    """
    x, y, z = locals_of(shape, places)
    rho = np.hypot(x, y)
    miss = np.stack([rho - shape[:, RADIUS], z], axis=1)
    # How both change with tilt, centre, radius and height.
    change = np.zeros((len(shape), 2, _fit.UNKNOWNS))
    u, v = x / rho, y / rho
    change[:, 0, 0], change[:, 0, 1] = u * z, v * z
    change[:, 0, 2], change[:, 0, 3], change[:, 0, 4] = u, v, 1.0
    change[:, 1, 0], change[:, 1, 1], change[:, 1, 5] = -x, -y, 1.0
    back = covariance @ change.transpose(0, 2, 1)
    held = change @ back + (_HELD * spacing[:, None, None]) ** 2 * np.eye(2)
    gain = back @ np.linalg.inv(held) if len(shape) else back
    # Where the place is farther than the fit allows, the fit is trusted.
    likely = np.einsum("ni,nij,nj->n", miss, np.linalg.inv(held), miss) < 50 if len(shape) else np.zeros(0, bool)
    gain[~likely] = 0.0
    step = np.einsum("nij,nj->ni", gain, miss)
    moved = shape.copy()
    e1, e2, axis = shape[:, 3:6], shape[:, 6:9], shape[:, 9:12]
    moved[:, :3] += step[:, 2:3] * e1 + step[:, 3:4] * e2 + step[:, 5:6] * axis
    moved[:, RADIUS] += step[:, 4]
    tilted = axis + step[:, :1] * e1 + step[:, 1:2] * e2
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    first = e1 - np.einsum("ij,ij->i", e1, tilted)[:, None] * tilted
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    moved[:, 3:6], moved[:, 6:9], moved[:, 9:12] = first, np.cross(tilted, first), tilted
    return moved, covariance - gain @ change @ covariance


def _long_enough(strands: Strands, nodes: Nodes) -> np.ndarray:
    length = strands.along[:, 1] - strands.along[:, 0]
    for run in np.flatnonzero(strands.is_run).tolist():
        length[run] = np.linalg.norm(np.diff(strands.path_of(run), axis=0), axis=1).sum()
    meets = (nodes.of_end >= 0).any(axis=1)
    return (length > _SHORT * strands.spacing) | (meets & (length > _SHORTEST * strands.spacing))


def _without_lonely(nodes: Nodes, through: np.ndarray) -> tuple[Nodes, np.ndarray]:
    """Leave out nodes at which fewer than two curves are left."""
    uses = np.bincount(nodes.of_end[nodes.of_end >= 0], minlength=len(nodes.position))
    uses = uses + np.bincount(through[:, 0], minlength=len(nodes.position))
    kept = np.flatnonzero(uses >= 2)
    number = np.full(len(nodes.position) + 1, -1)
    number[kept] = np.arange(len(kept))
    through = np.stack([number[through[:, 0]], through[:, 1]], axis=1)
    parts = (nodes.position[kept], nodes.std[kept], nodes.is_corner[kept], number[nodes.of_end])
    return Nodes(*parts), through[through[:, 0] >= 0]


def _kinds_of(strands: Strands) -> np.ndarray:
    radius = strands.shape[:, RADIUS]
    kind = np.where(radius == 0, CurveKind.LINE, np.where(strands.closed, CurveKind.CIRCLE, CurveKind.ARC))
    return np.where(strands.is_run, CurveKind.POLYLINE, kind).astype(np.uint8)


def _vertices(strands: Strands, nodes: Nodes) -> tuple[np.ndarray, np.ndarray]:
    """Return the places along all strands, and where each strand's begin."""
    is_run, radius = strands.is_run, np.nan_to_num(strands.shape[:, RADIUS])
    low, span = strands.along[:, 0], strands.along[:, 1] - strands.along[:, 0]
    meets = nodes.of_end >= 0
    curved = radius > 0
    round_ = np.where(curved, radius, 1.0)
    turn = 2 * np.arccos(np.maximum(1 - _CHORD * strands.spacing / round_, 0.5))
    steps = np.where(curved, np.maximum(np.ceil(span / round_ / turn), 2), 1).astype(np.int64)
    counts = np.where(is_run, np.diff(strands.rows[1]) + strands.closed + meets.sum(axis=1), steps + 1)
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    owner = np.repeat(np.arange(len(strands)), counts)
    at = (np.arange(len(owner)) - start[owner]) / steps[owner]
    vertices = on_shapes(strands.shape[owner], low[owner] + at * span[owner])
    vertices[start[1:][strands.closed] - 1] = vertices[start[:-1][strands.closed]]
    for run in np.flatnonzero(is_run).tolist():
        path = strands.path_of(run)
        before, after = (nodes.position[nodes.of_end[run, end : end + 1][meets[run, end : end + 1]]] for end in (0, 1))
        vertices[start[run] : start[run + 1]] = np.concatenate([before, path, path[: int(strands.closed[run])], after])
    # Lines run from node to node; arcs were fitted again to pass through theirs, and are not bent.
    for end, place in ((0, start[:-1]), (1, start[1:] - 1)):
        lines = meets[:, end] & ~is_run & ~curved
        vertices[place[lines]] = nodes.position[nodes.of_end[lines, end]]
    return vertices, start


def _lengths(vertices: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the lengths of paths, given where each begins among all places."""
    step = np.linalg.norm(np.diff(vertices, axis=0, append=vertices[-1:]), axis=1)
    step[start[1:] - 1] = 0.0
    return np.add.reduceat(step, start[:-1]) if len(step) else np.empty(0)


def _directions(strands: Strands, vertices: np.ndarray, start: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """Return directions of lines, from their beginning to their end, and axes of circles and arcs."""
    direction = np.where(strands.is_run[:, None], np.nan, strands.shape[:, 9:12])
    lines = np.flatnonzero(kinds == CurveKind.LINE)
    away = vertices[start[lines + 1] - 1] - vertices[start[lines]]
    direction[lines] = away / np.linalg.norm(away, axis=1, keepdims=True)
    return direction


def _majority(strands: Strands, kind: np.ndarray) -> np.ndarray:
    """Return the kind of most edge points of each strand."""
    rows, start = strands.rows
    strand = np.repeat(np.arange(len(strands)), np.diff(start))
    counts = [np.bincount(strand, (kind[rows] & int(flag)) > 0, len(strands)) for flag in _ORDER]
    return np.array([int(flag) for flag in _ORDER], np.uint8)[np.argmax(counts, axis=0)]


def _convex(strands: Strands, points: EdgePoints) -> np.ndarray:
    rows, start = strands.rows
    strand = np.repeat(np.arange(len(strands)), np.diff(start))
    return np.sign(np.bincount(strand, points.convex[rows], len(strands))).astype(np.int8)


def _angles(strands: Strands, points: EdgePoints, edges: Edges) -> dict[str, np.ndarray]:
    """Return the turn of the faces along each strand, measured on them, or of its edge points."""
    inward = strands.fit[:, _fit.INWARD : _fit.INWARD + 4].reshape(-1, 2, 2)
    between = np.arccos(np.clip((inward[:, 0] * inward[:, 1]).sum(axis=1), -1, 1))
    measured = strands.fit[:, _fit.STATE] == _fit.MEASURED
    angle = np.where(measured, np.pi - between, np.nan)
    std = np.where(measured, strands.fit[:, _fit.ANGLE_STD], np.nan)
    for k in np.flatnonzero(strands.is_run):
        own = edges.angle[points.rows[strands.rows[0][strands.rows[1][k] : strands.rows[1][k + 1]]]]
        own = own[np.isfinite(own)]
        if len(own):
            angle[k] = np.median(own)
            std[k] = 1.2533 * 1.4826 * np.median(np.abs(own - angle[k])) / np.sqrt(len(own))
    return {"angle": angle, "angle_std": std}


def _length_std(strands: Strands, nodes: Nodes, radius: np.ndarray) -> np.ndarray:
    """Return how sure lengths are: by where curves end, and of arcs by the radius."""
    at = np.where(nodes.of_end >= 0, np.append(nodes.std, 0.0)[nodes.of_end], _FREE_END * strands.spacing[:, None])
    square = (at**2).sum(axis=1)
    with np.errstate(invalid="ignore"):
        turn = (strands.along[:, 1] - strands.along[:, 0]) / radius
        arc = (turn * strands.fit[:, _fit.RADIUS_STD]) ** 2
    return np.sqrt(np.where(strands.closed, 0.0, square) + np.where(np.isfinite(radius), arc, 0.0))


def _position_std(strands: Strands, points: EdgePoints, edges: Edges) -> np.ndarray:
    std = strands.fit[:, _fit.POSITION_STD].copy()
    for k in np.flatnonzero(strands.is_run):
        own = edges.position_std[points.rows[strands.rows[0][strands.rows[1][k] : strands.rows[1][k + 1]]]]
        std[k] = np.sqrt(np.mean(own[np.isfinite(own)] ** 2)) if np.isfinite(own).any() else np.nan
    return std
