"""Measured shapes become curves: intervals, corners, ends at corners, and what is known of each."""

from __future__ import annotations

import numpy as np

from edgel.curves import _fit
from edgel.curves._circle import RADIUS
from edgel.curves._corners import Ends, meet
from edgel.curves._curves import Curves
from edgel.curves._extent import extents
from edgel.curves._gather import on_shapes
from edgel.curves._points import EdgePoints
from edgel.curves._shapes import Shapes
from edgel.edges import Edges

_SHORT = 2.5  # spacings: a shorter curve that meets nothing is none
_SHORTEST = 1.0


def assemble(shapes: Shapes, xyz: np.ndarray, points: EdgePoints, edges: Edges, origin: np.ndarray, crs: str | None) -> Curves:
    """Make curves of shapes."""
    position = shapes.smoothed.position
    ext = extents(shapes.measured, xyz, shapes.rows, position, shapes.measured.ranges, shapes.spacing)
    S = ext.shape
    shape, fit, spacing = shapes.measured.shape[S], shapes.measured.fit[S], shapes.spacing[S]
    runs = [r for r in shapes.runs if points.strength[r].mean()>.38 and points.strength[r].max()>.5 and len(r)>=4]
    ends = _ends(shape, fit, ext.ends, ext.closed, spacing)
    nodes = meet(ends, shape, spacing)
    alongs = ext.ends.copy()
    for e in (0, 1):
        k = np.flatnonzero(nodes.of_end[:, e] >= 0)
        p = nodes.position[nodes.of_end[k, e]]
        a = _along(shape[k], p)
        around = 2 * np.pi * shape[k, RADIUS]
        with np.errstate(invalid="ignore", divide="ignore"):
            a = np.where(around > 0, a + around * np.round((alongs[k, e] - a) / np.where(around > 0, around, 1)), a)
        alongs[k, e] = a
    length = alongs[:, 1] - alongs[:, 0]
    total = np.array([points.strength[shapes.rows[0][shapes.rows[1][k]:shapes.rows[1][k+1]]].sum() for k in S])
    number = np.array([shapes.rows[1][k+1]-shapes.rows[1][k] for k in S])
    alllen = np.bincount(S, (ext.ends[:,1]-ext.ends[:,0])/spacing, minlength=len(shapes.spacing))[S]
    evid = total/np.maximum(alllen,1)
    strong = (evid > .33) & (total/number > .3)
    keep = strong & ((length > _SHORT * spacing) | ((nodes.of_end >= 0).any(axis=1) & (length > _SHORTEST * spacing)))
    return dict(shape=shape, fit=fit, alongs=alongs, closed=ext.closed, spacing=spacing, nodes=nodes, keep=keep, runs=runs, position=position, origin=origin, sidx=S, rows=[points.rows[shapes.rows[0][shapes.rows[1][k]:shapes.rows[1][k+1]]] for k in S], runrows=[points.rows[r] for r in runs])


def _along(shape, p):
    d = p - shape[:, :3]
    x, y, z = (np.einsum("ij,ij->i", d, shape[:, 3 + 3 * k : 6 + 3 * k]) for k in range(3))
    return np.where(shape[:, RADIUS] == 0, z, shape[:, RADIUS] * np.arctan2(y, x))


def _ends(shape, fit, alongs, closed, spacing) -> Ends:
    n = len(shape)
    place, tangent = np.empty((n, 2, 3)), np.empty((n, 2, 3))
    normals, std = np.zeros((n, 2, 2, 3)), np.ones((n, 2, 2))
    R = shape[:, RADIUS]
    line = R == 0
    m = fit[:, _fit.NORMALS : _fit.NORMALS + 4].reshape(n, 2, 2)
    inward = fit[:, _fit.INWARD : _fit.INWARD + 4].reshape(n, 2, 2)
    missing = (m == 0).all(axis=2)
    other = np.stack([inward[:, 1], inward[:, 0]], axis=1)
    m = np.where(missing[..., None], other, m)
    for e, sign in ((0, -1), (1, 1)):
        place[:, e] = on_shapes(shape, alongs[:, e])
        t = alongs[:, e] / np.where(line, 1, R)
        u, v, w = shape[:, 3:6], shape[:, 6:9], shape[:, 9:12]
        radial = np.cos(t)[:, None] * u + np.sin(t)[:, None] * v
        tang = np.cos(t)[:, None] * v - np.sin(t)[:, None] * u
        tangent[:, e] = sign * np.where(line[:, None], w, tang)
        a = np.where(line[:, None], u, radial)
        b = np.where(line[:, None], v, w)
        normals[:, e] = m[..., :1] * a[:, None] + m[..., 1:] * b[:, None]
        off = np.where(line, np.abs(alongs[:, e]) * fit[:, _fit.TURN_STD], fit[:, _fit.POSITION_STD])
        std[:, e] = np.sqrt(np.where(line[:, None], fit[:, _fit.OFFSETS : _fit.OFFSETS + 2], 0) ** 2 + off[:, None] ** 2 + (0.02 * spacing[:, None]) ** 2)
    std = np.where(np.isfinite(std), std, 0.3 * spacing[:, None, None])
    return Ends(place, tangent, normals, std, ~closed)
