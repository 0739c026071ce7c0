"""Where neighbours are asked for, and the arrays of tree and queries that kernels take."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index


class TreeArrays(NamedTuple):
    """The arrays of a `NeighborIndex`, as kernels take them: the coordinates of each axis by themselves."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    order: np.ndarray
    boxes: np.ndarray
    blocks: np.ndarray


class QueryArrays(NamedTuple):
    """The arrays of `Queries`, as kernels take them."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    targets: np.ndarray


@dataclass(frozen=True, eq=False)
class Queries:
    """Where neighbours are asked for, in an order in which consecutive ones lie together.

    Attributes
    ----------
    xyz : (3, M) or (6, M) float64
        Coordinates, one axis a row; below them, where neighbours are wanted in a metric of each query's own, its
        stretch: see `edgel._neighbors.stretched`.
    targets : (M,) int64
        Where the results of each query go: a permutation.
    places : (M,) int64 or None
        Which places of the index they are, where they are some.
    """

    xyz: np.ndarray
    targets: np.ndarray
    places: np.ndarray | None = None

    @property
    def are_stretched(self) -> bool:
        """Whether queries have metrics of their own."""
        return len(self.xyz) > 3

    def __len__(self) -> int:
        return len(self.targets)

    @property
    def arrays(self) -> QueryArrays:
        """The arrays that kernels take."""
        x, y, z = self.xyz[:3]
        return QueryArrays(x, y, z, self.targets)


def tree_of(index: NeighborIndex) -> TreeArrays:
    """Return the arrays of an index."""
    x, y, z = index.xyz
    return TreeArrays(x, y, z, index.order, index.boxes, index.blocks)


def every_point(index: NeighborIndex) -> Queries:
    """Ask at every point of an index; the results are in the order of the points."""
    return Queries(index.xyz, index.order)


def every_place(index: NeighborIndex, stretch: np.ndarray | None = None) -> Queries:
    """Ask at every point of an index, with its stretch (3, N) where there is one; the results are in places' order."""
    xyz = index.xyz if stretch is None else np.concatenate([index.xyz, stretch])
    places = np.arange(len(index))
    return Queries(xyz, places, places)


def at_places(
    index: NeighborIndex, places: np.ndarray, targets: np.ndarray | None = None, stretch: np.ndarray | None = None
) -> Queries:
    """Ask at some places (M,) of an index, ascending, which lie in its order already; no tree of their own is needed.

    The results are in the order of the places, unless `targets` (M,) says where each goes. Takes the stretch (3, N) at
    every place, where there is one.
    """
    xyz = index.xyz.take(places, axis=1)
    if stretch is not None:
        xyz = np.concatenate([xyz, stretch.take(places, axis=1)])
    return Queries(xyz, np.arange(len(places)) if targets is None else targets, places)


def at_points(index: NeighborIndex, points: np.ndarray, stretch: np.ndarray | None = None) -> Queries:
    """Ask at some points (M,) of an index, each once; the results are in their order.

    Takes the stretch (3, N) at every place, where there is one.
    """
    number = np.full(len(index), -1)
    number[points] = np.arange(len(points))
    targets = number[index.order]
    places = np.flatnonzero(targets >= 0)
    return at_places(index, places, targets[places], stretch)


def anywhere(xyz: np.ndarray) -> Queries:
    """Ask at any positions (M, 3), which are sorted by a tree of their own; the results are in the order given."""
    return every_point(build_index(xyz))
