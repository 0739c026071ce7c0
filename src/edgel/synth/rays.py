"""Where rays meet a mesh first: a tree of boxes, and the test of Moeller & Trumbore.

doi:10.1080/10867651.1997.10487468
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel._neighbors.kdtree import build_index, node_start
from edgel.synth.solid import Solid

_EDGE_SLACK = 1e-9  # in barycentric coordinates: no ray slips through between two triangles


@dataclass(frozen=True, eq=False)
class RayHits:
    """What each ray meets first.

    Attributes
    ----------
    distance : (R,) float64
        Along the ray, in lengths of its direction; infinite for a miss.
    triangle : (R,) int64
        Row of the mesh's triangles; -1 for a miss.
    weights : (R, 3) float64
        Barycentric coordinates of the hit; NaN for a miss.
    """

    distance: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True, eq=False)
class RayTree:
    """Triangles sorted for rays; made by `build_ray_tree`.

    Attributes
    ----------
    order : (T,) int64
        Row of the mesh's triangles of each sorted one.
    corners : (T, 9) float64
        First corner, and the two edges from it.
    boxes : (2 L, 6) float64
        Lower and upper corner of each node: the root is node 1, node i has children 2 i and 2 i + 1, leaves begin at L.
    """

    order: np.ndarray
    corners: np.ndarray
    boxes: np.ndarray

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest x, y, z of all triangles, (2, 3), mm."""
        return self.boxes[1].reshape(2, 3)


def build_ray_tree(solid: Solid) -> RayTree:
    """Sort the triangles of a solid for `cast`."""
    corners = solid.corners
    index = build_index(np.ascontiguousarray(corners.mean(axis=1)))
    order, leaves = index.order, len(index.boxes) // 2
    ordered = corners[order]
    starts = np.array([node_start(leaf, len(order), leaves) for leaf in range(leaves)])
    boxes = np.empty((2 * leaves, 6))
    boxes[leaves:, :3] = np.minimum.reduceat(ordered.min(axis=1), starts)
    boxes[leaves:, 3:] = np.maximum.reduceat(ordered.max(axis=1), starts)
    level = leaves
    while level > 1:
        children = boxes[level : 2 * level]
        level //= 2
        boxes[level : 2 * level, :3] = np.minimum(children[::2, :3], children[1::2, :3])
        boxes[level : 2 * level, 3:] = np.maximum(children[::2, 3:], children[1::2, 3:])
    a, b, c = np.moveaxis(ordered, 1, 0)
    return RayTree(order, np.ascontiguousarray(np.concatenate([a, b - a, c - a], axis=1)), boxes)


def cast(tree: RayTree, origins: np.ndarray, directions: np.ndarray) -> RayHits:
    """Find what rays meet first; both sides of a triangle count.

    Parameters
    ----------
    tree : RayTree
    origins, directions : (R, 3) float64
        mm; directions need not be unit vectors.
    """
    count = len(origins)
    distance, triangle, weights = np.empty(count), np.empty(count, np.int64), np.empty((count, 3))
    rays = np.ascontiguousarray(np.concatenate([origins, directions], axis=1))
    run_slices(_cast, count, rays, tree.corners, tree.boxes, distance, triangle, weights, size=2048)
    triangle = np.where(triangle >= 0, tree.order[triangle], -1)
    return RayHits(distance, triangle, weights)


@routine
def _enters(boxes, node, ray, inverse, nearest):
    """Distance at which a ray enters a box; infinite when it misses it or enters beyond `nearest`."""
    low, high = 0.0, nearest
    for axis in range(3):
        if ray[3 + axis] == 0.0:
            if ray[axis] < boxes[node, axis] or ray[axis] > boxes[node, 3 + axis]:
                return np.inf
            continue
        a = (boxes[node, axis] - ray[axis]) * inverse[axis]
        b = (boxes[node, 3 + axis] - ray[axis]) * inverse[axis]
        low, high = max(low, min(a, b)), min(high, max(a, b))
    # Boxes of plane faces are flat: rounding must not close them.
    return low if low <= high * (1.0 + 1e-12) + 1e-12 else np.inf


@routine
def _meets(t, ray):
    """Distance along a ray to a triangle (9,) and the barycentric coordinates of its second and third corner."""
    px, py, pz = ray[4] * t[8] - ray[5] * t[7], ray[5] * t[6] - ray[3] * t[8], ray[3] * t[7] - ray[4] * t[6]
    det = t[3] * px + t[4] * py + t[5] * pz
    if det == 0.0:
        return np.inf, 0.0, 0.0
    sx, sy, sz = ray[0] - t[0], ray[1] - t[1], ray[2] - t[2]
    u = (sx * px + sy * py + sz * pz) / det
    if u < -_EDGE_SLACK or u > 1.0 + _EDGE_SLACK:
        return np.inf, 0.0, 0.0
    qx, qy, qz = sy * t[5] - sz * t[4], sz * t[3] - sx * t[5], sx * t[4] - sy * t[3]
    v = (ray[3] * qx + ray[4] * qy + ray[5] * qz) / det
    if v < -_EDGE_SLACK or u + v > 1.0 + _EDGE_SLACK:
        return np.inf, 0.0, 0.0
    distance = (t[6] * qx + t[7] * qy + t[8] * qz) / det
    return (distance, u, v) if distance > 0.0 else (np.inf, 0.0, 0.0)


@kernel
def _cast(start, stop, rays, corners, boxes, distance, triangle, weights):
    leaves, count = len(boxes) // 2, len(corners)
    stack, entries, inverse = np.empty(64, np.int64), np.empty(64), np.empty(3)
    for r in range(start, stop):
        ray = rays[r]
        for axis in range(3):
            inverse[axis] = 1.0 / ray[3 + axis] if ray[3 + axis] != 0.0 else 0.0
        best, row, second, third = np.inf, -1, np.nan, np.nan
        stack[0], entries[0], top = 1, _enters(boxes, 1, ray, inverse, np.inf), 1
        while top > 0:
            top -= 1
            node = stack[top]
            if entries[top] == np.inf or entries[top] > best:
                continue
            if node < leaves:
                near, far = 2 * node, 2 * node + 1
                near_at, far_at = _enters(boxes, near, ray, inverse, best), _enters(boxes, far, ray, inverse, best)
                if far_at < near_at:
                    near, far, near_at, far_at = far, near, far_at, near_at
                stack[top], entries[top] = far, far_at
                stack[top + 1], entries[top + 1] = near, near_at
                top += 2
                continue
            for i in range(node_start(node - leaves, count, leaves), node_start(node - leaves + 1, count, leaves)):
                at, u, v = _meets(corners[i], ray)
                if at < best:
                    best, row, second, third = at, i, u, v
        distance[r], triangle[r] = best, row
        weights[r, 0], weights[r, 1], weights[r, 2] = 1.0 - second - third, second, third
