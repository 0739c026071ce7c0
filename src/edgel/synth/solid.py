"""Solid: a closed or open surface as a fine mesh whose faces, normals and edges are known exactly."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edgel.synth.edges import EdgeCurve

MIN_TURN = np.radians(1.0)
"""Where two faces turn by less than this, radians, their seam is no crease."""
_WELD = 1e-6  # mm; corners of patches nearer than this are one vertex


@dataclass(frozen=True, eq=False)
class Solid:
    """A surface with known faces and edges; made by the functions of `edgel.synth`.

    Attributes
    ----------
    name : str
    vertices : (V, 3) float64
        mm.
    triangles : (T, 3) int64
        Rows of `vertices`, counterclockwise seen from outside (for an open surface: from the side of its normals).
    face : (T,) int64
        Which smooth face each triangle is part of.
    normals : (T, 3, 3) float64
        True unit normals of that face at the triangle's three corners.
    creases : tuple of EdgeCurve
        Where two faces meet and the surface turns by more than `MIN_TURN`. The first normal is that of the face to the
        left of the curve, seen from outside. Sampled at the mesh's vertices: a straight crease may have two points.
    boundaries : tuple of EdgeCurve
        Where an open surface ends; the surface lies to their left. Empty for a closed one.
    spacing : float
        The point spacing the mesh is meant for, mm: its chords are off the surface by less than 1 % of it.
    """

    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    face: np.ndarray
    normals: np.ndarray
    creases: tuple[EdgeCurve, ...]
    boundaries: tuple[EdgeCurve, ...]
    spacing: float

    @property
    def edges(self) -> tuple[EdgeCurve, ...]:
        """Creases, then boundaries."""
        return (*self.creases, *self.boundaries)

    @property
    def corners(self) -> np.ndarray:
        """Corners of the triangles, (T, 3, 3), mm."""
        return self.vertices[self.triangles]

    @property
    def areas(self) -> np.ndarray:
        """Area of each triangle, (T,), mm^2."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2

    @property
    def area(self) -> float:
        """Area of the surface, mm^2."""
        return float(self.areas.sum())

    @property
    def volume(self) -> float:
        """Volume enclosed, mm^3, by the divergence theorem; means nothing for an open surface."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return float((a * np.cross(b, c)).sum() / 6)

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, mm."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))


def make_solid(name: str, corners: np.ndarray, face: np.ndarray, normals: np.ndarray, *, spacing: float) -> Solid:
    """Join triangles to a solid and find its edges.

    Parameters
    ----------
    corners : (T, 3, 3) float64
        Counterclockwise seen from outside, mm. Neighbours must share whole edges, to within 1e-6 mm.
    face : (T,) int
        Smooth face of each triangle: no crease is looked for within one.
    normals : (T, 3, 3) float64
        True unit normals at the corners.
    spacing : float
        See `Solid.spacing`.

    Raises
    ------
    ValueError
        If an edge belongs to more than two triangles, or two that share it disagree about outside.
    """
    vertices, triangles = _weld(np.asarray(corners, np.float64))
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)  # poles leave triangles with no area
    triangles, face, normals = triangles[whole], np.asarray(face, np.int64)[whole], normals[whole]
    creases, boundaries = _find_curves(vertices, triangles, face, normals)
    return Solid(name, vertices, triangles, face, normals, creases, boundaries, float(spacing))


def from_polygons(
    name: str, vertices: Sequence | np.ndarray, polygons: Sequence[Sequence[int]], *, spacing: float
) -> Solid:
    """Make a polyhedron of its vertices (V, 3), mm, and convex plane polygons, counterclockwise seen from outside."""
    points = np.asarray(vertices, np.float64)
    triples = [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)]
    face = np.repeat(np.arange(len(polygons)), [len(p) - 2 for p in polygons])
    corners = points[np.array(triples)]
    return make_solid(name, corners, face, flat_normals(corners), spacing=spacing)


def from_patches(name: str, patches: Sequence[tuple[np.ndarray, np.ndarray]], *, spacing: float) -> Solid:
    """Join patches to a solid: each a grid of points and one of their unit normals, both (M, N, 3), is one face.

    The first axis of a grid, then the second, then outwards is right-handed. Neighbours must share whole edges.
    """
    corners = [grid_triangles(points) for points, _ in patches]
    normals = [grid_triangles(normal) for _, normal in patches]
    face = np.repeat(np.arange(len(patches)), [len(part) for part in corners])
    return make_solid(name, np.concatenate(corners), face, np.concatenate(normals), spacing=spacing)


def flat_normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals of plane triangles (T, 3, 3), repeated for each corner, (T, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.repeat((normal / np.where(length > 0, length, 1))[:, None], 3, axis=1)


def grid_triangles(values: np.ndarray) -> np.ndarray:
    """Split a grid (M, N, ...) of corner values into triangles (2 (M - 1) (N - 1), 3, ...), row by row."""
    a, b, c, d = values[:-1, :-1], values[1:, :-1], values[1:, 1:], values[:-1, 1:]
    pairs = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2)
    return pairs.reshape(-1, 3, *values.shape[2:])


def unit(vectors: np.ndarray) -> np.ndarray:
    """Scale vectors (..., 3) to length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def is_convex(normals: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """Whether a crease is convex, (P,) bool, from normals (P, 2, 3), left face first, and tangents (P, 3)."""
    into_left = np.cross(normals[:, 0], tangents)
    return (into_left * normals[:, 1]).sum(axis=1) < 0


def _weld(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give corners at one place one vertex: vertices (V, 3) and triangles (T, 3)."""
    flat = corners.reshape(-1, 3)
    # Rounding with an odd offset: coordinates made of halves and thirds would fall on the limit between two cells.
    keys = np.floor(flat / _WELD + 0.377).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return flat[first], inverse.reshape(-1, 3)


def _find_curves(
    vertices: np.ndarray, triangles: np.ndarray, face: np.ndarray, normals: np.ndarray
) -> tuple[tuple[EdgeCurve, ...], tuple[EdgeCurve, ...]]:
    """Return the creases and the boundaries of a welded mesh."""
    begin, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    at_begin, at_end = normals.reshape(-1, 3), np.roll(normals, -1, axis=1).reshape(-1, 3)
    owner = np.repeat(face, 3)
    key = np.minimum(begin, end) * len(vertices) + np.maximum(begin, end)
    order = np.lexsort((owner, key))
    _, start, count = np.unique(key[order], return_index=True, return_counts=True)
    if (count > 2).any():
        where = vertices[begin[order[start[count > 2][0]]]]
        raise ValueError(f"corners: an edge at {where} belongs to more than two triangles")
    left, right = order[start[count == 2]], order[start[count == 2] + 1]
    if (begin[left] != end[right]).any():
        where = vertices[begin[left[begin[left] != end[right]][0]]]
        raise ValueError(f"corners: two triangles at {where} disagree about the outside")
    seam = owner[left] != owner[right]
    left, right = left[seam], right[seam]
    pairs = np.stack([np.stack([at_begin[left], at_end[right]], 1), np.stack([at_end[left], at_begin[right]], 1)], 1)
    half_chord = np.linalg.norm(pairs[:, :, 0] - pairs[:, :, 1], axis=2).max(axis=1) / 2
    turns = 2 * np.arcsin(np.minimum(half_chord, 1)) > MIN_TURN
    left, right, pairs = left[turns], right[turns], pairs[turns]
    creases = []
    for chain in _chains(begin[left], end[left], np.stack([owner[left], owner[right]], 1)):
        rows = vertices[np.append(begin[left[chain]], end[left[chain[-1]]])]
        creases.append(EdgeCurve("crease", rows, np.concatenate([pairs[chain, 0], pairs[chain[-1:], 1]])))
    rim = order[start[count == 1]]
    boundaries = []
    for chain in _chains(begin[rim], end[rim], np.stack([owner[rim], owner[rim]], 1)):
        rows = vertices[np.append(begin[rim[chain]], end[rim[chain[-1]]])]
        boundaries.append(EdgeCurve("boundary", rows))
    return tuple(creases), tuple(boundaries)


def _chains(begin: np.ndarray, end: np.ndarray, group: np.ndarray) -> list[np.ndarray]:
    """Link directed segments of one group head to tail; returns the segments of each chain in order."""
    by_start: dict[tuple[int, ...], list[int]] = defaultdict(list)
    ends = set()
    for i, (a, b, g) in enumerate(zip(begin.tolist(), end.tolist(), group.tolist(), strict=True)):
        by_start[(*g, a)].append(i)
        ends.add((*g, b))
    used = np.zeros(len(begin), bool)
    heads = [i for key, rows in by_start.items() if key not in ends for i in rows]
    chains = []
    for head in [*heads, *range(len(begin))]:  # what is left after the open chains are loops
        chain = []
        i: int | None = head
        while i is not None and not used[i]:
            used[i] = True
            chain.append(i)
            following = by_start.get((*group[i].tolist(), int(end[i])), [])
            i = next((j for j in following if not used[j]), None)
        if chain:
            chains.append(np.array(chain))
    return chains
