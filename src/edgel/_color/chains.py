"""Thinning and hysteresis among the points of a step."""

from __future__ import annotations

import numpy as np

from edgel._kernels.parallel import kernel
from edgel._kernels.union_find import keep_linked
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.queries import every_point

_NEAREST = 13  # edge points that are looked at, the point itself among them
_REACH = 2.1  # how far apart two linked points are at most, in spacings: a chain may miss one
_ABREAST = 0.75  # two points less than this apart along the edge, in spacings, ...
_BESIDE = 1.5  # ... and less than this across it, lie on the same piece of it: one is enough
_LEVEL = 0.25  # unless they lie level, one behind the other along the edge
_TIE = 1e-6  # in spacings: of two points equally far from the edge rounding must not choose


def non_maximum_suppression(
    xyz: np.ndarray, across: np.ndarray, spacing: np.ndarray, offsets: np.ndarray
) -> np.ndarray:
    """Choose points along edges so that no two lie abreast: those nearest to the edge first.

    Parameters
    ----------
    xyz, across : (M, 3) float64
        Points, and unit vectors across the edge, towards the larger value.
    spacing : (M,) float64
        Distance between points there.
    offsets : (M,) float64
        Where the edge runs, in spacings along `across`. Of two points equally far the one on the larger side stays.

    Returns
    -------
    (M,) bool
    """
    abreast = np.full((len(xyz), _NEAREST - 1), -1, np.int64)
    index = build_index(xyz)
    visit_neighbors(_abreast, every_point(index), index, min(_NEAREST, len(xyz)), index.order, across, spacing, abreast)
    distance = np.round(np.abs(offsets) / _TIE)
    kept = np.zeros(len(xyz), np.bool_)
    _choose(np.lexsort((*xyz.T[::-1], offsets > 0, distance)), abreast, kept)
    return kept


def hysteresis(xyz: np.ndarray, spacing: np.ndarray, strong: np.ndarray) -> np.ndarray:
    """Return a mask (M,) of the points that links join to a strong one."""
    links = np.full((len(xyz), _NEAREST - 1), -1, np.int64)
    index = build_index(xyz)
    visit_neighbors(_link, every_point(index), index, min(_NEAREST, len(xyz)), index.order, spacing, links)
    kept = np.zeros(len(xyz), np.bool_)
    keep_linked(links, strong, kept)
    return kept


@kernel
def _abreast(first, places, squared, queries, targets, xyz, order, across, spacing, abreast):
    for q in range(places.shape[0]):
        row, filled = targets[first + q], 0
        for i in range(places.shape[1]):
            other = order[places[q, i]]
            side = 0.0
            for axis in range(3):
                side += (xyz[axis, places[q, i]] - queries[axis, first + q]) * across[row, axis]
            along = squared[q, i] - side * side
            near = along < (_ABREAST * spacing[row]) ** 2 and abs(side) < _BESIDE * spacing[row]
            if near and other != row and abs(side) > _LEVEL * spacing[row] and filled < abreast.shape[1]:
                abreast[row, filled] = other
                filled += 1


@kernel
def _choose(ranked, abreast, kept):
    for row in ranked:
        kept[row] = True
        for other in abreast[row]:
            if other >= 0 and kept[other]:
                kept[row] = False
                break


@kernel
def _link(first, places, squared, queries, targets, xyz, order, spacing, links):
    for q in range(places.shape[0]):
        row, filled = targets[first + q], 0
        for i in range(places.shape[1]):
            other = order[places[q, i]]
            if other != row and squared[q, i] <= (_REACH * spacing[row]) ** 2 and filled < links.shape[1]:
                links[row, filled] = other
                filled += 1
