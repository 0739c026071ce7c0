"""Lines that go smoothly over into arcs: both end where they touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.curves import _fit
from edgel.curves._circle import RADIUS
from edgel.curves._corners import REACH, Nodes
from edgel.curves._gather import on_shapes
from edgel.curves._strands import Strands, along_of_all, past

_TOUCHING = 0.35  # spacings: a line that passes the centre at the radius, but for so much, touches the circle
_ALONG = 0.1  # sine of the angle between a line and the plane of an arc that it touches
_AROUND = 8  # ends about each that are tried


def touch(strands: Strands) -> tuple[Strands, np.ndarray]:
    """Move ends of lines and arcs that touch to where they do, and tell which ends (N, 2) those are.

    Near there both run side by side, and where their ends were found says little: an end a spacing too far along an arc
    of three turns by 20 degrees.
    """
    radius = strands.shape[:, RADIUS]
    flat = np.flatnonzero(np.repeat(~strands.closed & ~strands.is_run, 2))
    if len(flat) < 2:
        return strands, np.zeros((len(strands), 2), bool)
    places = on_shapes(strands.shape[flat // 2], strands.along.ravel()[flat])
    near = knn(build_index(places), places, min(_AROUND, len(flat)))
    one, two = np.repeat(np.arange(len(flat)), near.points.shape[1]), near.points.ravel()
    kept = (radius[flat[one] // 2] == 0) & (radius[flat[two] // 2] > 0)
    one, two = one[kept], two[kept]
    a, b = flat[one], flat[two]
    line, arc = strands.shape[a // 2], strands.shape[b // 2]
    direction, h = line[:, 9:12], strands.spacing[a // 2]
    offset = arc[:, :3] - line[:, :3]
    along = np.einsum("ij,ij->i", offset, direction)
    foot = line[:, :3] + along[:, None] * direction
    touching = np.abs(np.linalg.norm(arc[:, :3] - foot, axis=1) - arc[:, RADIUS]) < _TOUCHING * h
    touching &= np.abs(np.einsum("ij,ij->i", direction, arc[:, 9:12])) < _ALONG
    far = np.maximum(*(np.linalg.norm(places[end] - foot, axis=1) for end in (one, two)))
    touching &= far < REACH * h
    a, b, foot, along, far, arc = (part[touching] for part in (a, b, foot, along, far, arc))
    moved, taken = strands.along.copy(), np.zeros(2 * len(strands), bool)
    low = strands.along[b // 2, b % 2] - np.pi * arc[:, RADIUS]
    on_arc = past(along_of_all(arc, foot), low, arc)
    for k in np.lexsort((*foot.T, far)).tolist():  # the nearest first, each end once
        if not (taken[a[k]] or taken[b[k]]):
            taken[[a[k], b[k]]] = True
            moved[a[k] // 2, a[k] % 2], moved[b[k] // 2, b[k] % 2] = along[k], on_arc[k]
    good = (moved[:, 0] < moved[:, 1])[:, None]
    return replace(strands, along=np.where(good, moved, strands.along)), taken.reshape(-1, 2) & good


def with_joints(strands: Strands, nodes: Nodes, touching: np.ndarray) -> Nodes:
    """Say of nodes at which ends that touch meet how sure they are: as the arc is, which says where along the line.

    The planes of both leave that open.
    """
    ends = touching & (nodes.of_end >= 0) & (strands.shape[:, RADIUS] > 0)[:, None]
    std = nodes.std.copy()
    std[nodes.of_end[ends]] = np.repeat(strands.fit[:, _fit.POSITION_STD, None], 2, axis=1)[ends]
    return replace(nodes, std=np.fmin(std, nodes.std))
