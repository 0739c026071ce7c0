"""Meshes as parts: exact creases, and places evenly over the surface."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel.matching._half_edges import HalfEdges, frames_of, join, of_creases

CREASE = np.radians(25.0)
"""Least turn of a crease: facets of a round surface turn by less."""
_WELD = 1e-6  # of the size: corners nearer than this are one
_STEPS = 250  # along the size, between half-edges on an edge
_DARTS = 8  # places drawn for each that is kept
_GOLDEN = np.array([0.8191725134, 0.6710436067, 0.5497004779])  # shares of Roberts' low-discrepancy sequence


def triangles_of(vertices: Any, faces: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of a mesh, and the flat normals at their corners, both (T, 3, 3).

    Raises
    ------
    ValueError
        If they are no mesh: shapes, numbers that are not finite, no triangle with an area.
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"mesh: expected vertices (V, 3) and triangles (T, 3), got {vertices.shape} and {faces.shape}")
    if faces.dtype.kind not in "iu" or (faces.size and not (faces.min() >= 0 and faces.max() < len(vertices))):
        raise ValueError("mesh: triangles have to be rows of the vertices")
    corners = vertices[faces]
    if not np.isfinite(corners).all():
        raise ValueError("mesh: a vertex is not finite; mend the mesh")
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    if not (length > 0).any():
        raise ValueError("mesh: no triangle has an area; mend the mesh")
    kept = length > 0
    return corners[kept], np.repeat((normals[kept] / length[kept, None])[:, None], 3, axis=1)


def creases_of(corners: np.ndarray, normals: np.ndarray) -> HalfEdges:
    """Return the half-edges along the creases of a part, and along its ends where it is open, evenly spaced."""
    low, size = corners.min(axis=(0, 1)), float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    _, vertex = np.unique(np.round((corners.reshape(-1, 3) - low) / (_WELD * size)), axis=0, return_inverse=True)
    vertex = vertex.reshape(-1, 3)
    start, stop = vertex.ravel(), np.roll(vertex, -1, axis=1).ravel()
    key = np.minimum(start, stop) * (vertex.max() + 1) + np.maximum(start, stop)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(first, append=len(key))
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    along = np.roll(corners, -1, axis=1) - corners
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    smooth = (normals + np.roll(normals, -1, axis=1)) / 2  # of the surface in the middle of each side
    a, b = order[first[count == 2]], order[first[count == 2] + 1]
    triangle, side = np.divmod(np.arange(len(key)), 3)
    n1, n2 = (smooth[triangle[k], side[k]] for k in (a, b))
    n1, n2 = (n / np.linalg.norm(n, axis=1, keepdims=True) for n in (n1, n2))
    turn = np.arccos(np.clip((n1 * n2).sum(axis=1), -1, 1))
    kept = turn >= CREASE
    a, b, n1, n2, turn = a[kept], b[kept], n1[kept], n2[kept], turn[kept]
    inwards = corners[triangle[b]].mean(axis=1) - middles[triangle[b], side[b]]
    bend = np.where((inwards * n1).sum(axis=1) < 0, 1, -1)
    outside = np.stack([n1, n2], axis=1) * bend[:, None, None]
    step = size / _STEPS
    places, row = _along(corners[triangle[a], side[a]], along[triangle[a], side[a]], step)
    tangents = along[triangle[a], side[a]]
    tangents = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    found = [of_creases(places, tangents[row], outside[row], turn[row], bend[row])]
    e = order[first[count == 1]]
    if len(e):
        places, row = _along(corners[triangle[e], side[e]], along[triangle[e], side[e]], step)
        outward = smooth[triangle[e], side[e]]
        frames = frames_of(np.cross(flat[triangle[e]], along[triangle[e], side[e]])[row], outward[row])
        found.append(HalfEdges(places, frames, np.full(len(row), np.nan), np.ones(len(row), np.int64)))
    return join(found)


def _along(start: np.ndarray, along: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Places at most a step apart along segments, and the segment of each."""
    count = np.maximum(np.ceil(np.linalg.norm(along, axis=1) / step).astype(np.int64), 1)
    row = np.repeat(np.arange(len(start)), count)
    share = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[row]
    return start[row] + share[:, None] * along[row], row


def spread_over(corners: np.ndarray, normals: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return many more places than `number` evenly over a surface, by area, and its normals there."""
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    total = np.cumsum(areas)
    share = (np.arange(1, _DARTS * number + 1)[:, None] * _GOLDEN) % 1.0
    triangle = np.searchsorted(total, share[:, 0] * total[-1], side="right").clip(max=len(total) - 1)
    root = np.sqrt(share[:, 1])
    weights = np.stack([1 - root, root * (1 - share[:, 2]), root * share[:, 2]], axis=1)
    places = np.einsum("ij,ijk->ik", weights, corners[triangle])
    normal = np.einsum("ij,ijk->ik", weights, normals[triangle])
    return places, normal / np.linalg.norm(normal, axis=1, keepdims=True)
