"""Curves that end on another one, between its ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel.curves._corners import PRIOR, REACH, Nodes
from edgel.curves._strands import Strands, ends_of, places_on, planes_at

_AROUND = 12
_ALIKE = 0.64  # cosine between tangents: more alike, one curve goes over into the other
_ASIDE = 0.5  # spacings: farther from the other curve is no end on it


def meet_through(strands: Strands, nodes: Nodes) -> tuple[Nodes, np.ndarray]:
    """Let ends that met no other end meet the curves that pass by, where all faces have a place in common.

    Returns the nodes and those added, and which curves (T, 2) pass through which: node and strand.
    """
    ends = ends_of(strands)
    shaped = np.flatnonzero(~strands.is_run)
    free = np.flatnonzero(((nodes.of_end < 0) & ends.is_open[:, None]).ravel())
    if not len(free) or not len(shaped):
        return nodes, np.empty((0, 2), np.int64)
    places, owner, along = places_on(strands, shaped)
    curve, end = free // 2, free % 2
    at = ends.place[curve, end]
    near = knn(build_index(places), at, min(_AROUND, len(places)))
    other = (owner[near.points] != curve[:, None]) & (near.distances < REACH * strands.spacing[curve, None])
    pick = near.points[np.arange(len(free)), np.argmax(other, axis=1)]
    usable = other.any(axis=1)
    curve, end, at, pick = curve[usable], end[usable], at[usable], pick[usable]
    there, tangent, normals, std = planes_at(strands, owner[pick], along[pick])
    own = ends.normals[curve, end], ends.std[curve, end]
    position, spread, asides = _solve((at, *own), (there, normals, std), strands.spacing[curve])
    h = strands.spacing[curve]
    cosine = np.abs((ends.tangent[curve, end] * tangent).sum(axis=1))
    away = position - at
    aside = np.linalg.norm(
        away - (away * ends.tangent[curve, end]).sum(axis=1)[:, None] * ends.tangent[curve, end], axis=1
    )
    good = (np.linalg.norm(away, axis=1) < REACH * h) & (aside < _ASIDE * h) & (asides < _ASIDE * h) & (cosine < _ALIKE)
    of_end = nodes.of_end.copy()
    of_end[curve[good], end[good]] = len(nodes.position) + np.arange(good.sum())
    joined = replace(
        nodes,
        position=np.concatenate([nodes.position, position[good]]),
        std=np.concatenate([nodes.std, spread[good]]),
        is_corner=np.concatenate([nodes.is_corner, np.ones(good.sum(), bool)]),
        of_end=of_end,
    )
    return joined, np.stack([len(nodes.position) + np.arange(good.sum()), owner[pick[good]]], axis=1)


def _solve(
    own: tuple[np.ndarray, ...], other: tuple[np.ndarray, ...], spacing: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where the planes of two curves meet, how sure that is, and how far it is from the other curve's."""
    prior = 1 / (PRIOR * spacing) ** 2
    matrix = prior[:, None, None] * np.eye(3)
    side = prior[:, None] * own[0]
    for place, normals, std in (own, other):
        square = np.einsum("nki,nkj->nij", normals / std[..., None] ** 2, normals)
        matrix, side = matrix + square, side + np.einsum("nij,nj->ni", square, place)
    inverse = np.linalg.inv(matrix)
    position = np.einsum("nij,nj->ni", inverse, side)
    off = np.einsum("nki,ni->nk", other[1], position - other[0])
    return position, np.sqrt(np.trace(inverse, axis1=1, axis2=2)), np.linalg.norm(off, axis=1)
