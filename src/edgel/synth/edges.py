"""True edges of a part as finely sampled curves, and the exact nearest edge of any point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edgel._kernels.parallel import kernel, routine, run_slices
from edgel.cloud import as_cloud

EDGE_KINDS = ("boundary", "crease")
_CHORD = 0.05  # mm, of `line` and `arc`; on a radius of 57 mm the polyline is then within 6e-6 mm of the curve
_LEAF = 8  # segments in a leaf of the search tree


@dataclass(frozen=True, eq=False)
class EdgeCurve:
    """One true edge, sampled as a polyline.

    Attributes
    ----------
    kind : str
        ``"boundary"``: the surface ends; ``"crease"``: two faces meet.
    points : (P, 3) float64
        Points on the edge, in order along it, mm: the true edge runs straight from one to the next, or nearly so.
    normals : (P, 2, 3) float64 or None
        Unit normals of the two faces that meet in a crease; None for a boundary.
    name : str
        What the edge is called on this part, ``"rim"``; empty where there is nothing to tell apart.

    Examples
    --------
    >>> import numpy as np
    >>> from edgel import synth
    >>> seam = synth.tee().creases[0]
    >>> [round(float(degrees), 3) for degrees in np.degrees(seam.dihedral[[0, -1]])]  # fades at the top
    [0.0, 90.0]
    """

    kind: str
    points: np.ndarray
    normals: np.ndarray | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if self.kind not in EDGE_KINDS:
            raise ValueError(f"kind: expected one of {EDGE_KINDS}, got {self.kind!r}")
        if self.points.ndim != 2 or self.points.shape[1] != 3 or len(self.points) < 2:
            raise ValueError(f"points: expected (P, 3) with P of 2 or more, got {self.points.shape}")
        if (self.kind == "crease") != (self.normals is not None):
            raise ValueError(f"normals: a crease has them and a boundary does not, got kind {self.kind!r}")
        if self.normals is not None and self.normals.shape != (len(self.points), 2, 3):
            raise ValueError(f"normals: expected {(len(self.points), 2, 3)}, got {self.normals.shape}")

    @property
    def length(self) -> float:
        """Length of the curve, mm."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    @cached_property
    def dihedral(self) -> np.ndarray:
        """Angle between the normals of the two faces at each point, (P,), radians: 0 is smooth; NaN where no crease."""
        if self.normals is None:
            return np.full(len(self.points), np.nan)
        # Half the chord is the sine of half the angle: accurate near 0, where the arc cosine is not.
        return 2 * np.arcsin(np.linalg.norm(self.normals[:, 0] - self.normals[:, 1], axis=1) / 2)


@dataclass(frozen=True, eq=False)
class NearestEdge:
    """The nearest true edge of each point.

    Attributes
    ----------
    distance : (N,) float64
        Distance in 3D, mm.
    curve : (N,) int64
        Which curve it is; the first of those equally near.
    foot : (N, 3) float64
        The nearest point on it, mm.
    dihedral : (N,) float64
        Dihedral angle there, radians; NaN where the curve is not a crease.
    """

    distance: np.ndarray
    curve: np.ndarray
    foot: np.ndarray
    dihedral: np.ndarray


def line(start: Sequence[float], end: Sequence[float]) -> np.ndarray:
    """Sample the straight line between two points (3,), mm; returns (P, 3)."""
    first, last = np.asarray(start, float), np.asarray(end, float)
    steps = max(1, int(np.ceil(np.linalg.norm(last - first) / _CHORD)))
    return first + np.linspace(0, 1, steps + 1)[:, None] * (last - first)


def arc(centre: Sequence[float], u: Sequence[float], v: Sequence[float], start: float, stop: float) -> np.ndarray:
    """Sample the ellipse ``centre + u cos(t) + v sin(t)`` for t from `start` to `stop`.

    Parameters
    ----------
    centre : (3,)
        mm.
    u, v : (3,)
        The half axes, at right angles, mm; of one length in a circle.
    start, stop : float
        Radians.

    Returns
    -------
    (P, 3) float64
    """
    a, b = np.asarray(u, float), np.asarray(v, float)
    speed = max(np.linalg.norm(a), np.linalg.norm(b))
    t = np.linspace(start, stop, max(2, int(np.ceil(abs(stop - start) * speed / _CHORD)) + 1))[:, None]
    return np.asarray(centre, float) + a * np.cos(t) + b * np.sin(t)


def nearest_edge(points: object, curves: Sequence[EdgeCurve]) -> NearestEdge:
    """Find the nearest of the curves for each point, exactly.

    Parameters
    ----------
    points : (N, 3) array_like or anything that carries it
        Finite coordinates, mm.
    curves : sequence of EdgeCurve
        At least one.

    Raises
    ------
    ValueError
        If there are no curves, or a coordinate is NaN or infinite.

    Examples
    --------
    >>> from edgel import synth
    >>> edges = synth.tee().edges
    >>> found = synth.nearest_edge([[0.0, -60.0, 0.0]], edges)
    >>> edges[found.curve[0]].name, round(float(found.distance[0]), 6)
    ('outline', 2.85)
    """
    if not curves:
        raise ValueError("curves: expected at least one edge, got none")
    xyz = np.ascontiguousarray(as_cloud(points).xyz)
    if not np.isfinite(xyz).all():
        raise ValueError("points: expected finite coordinates, got NaN or inf; leave those points out")
    begin = np.concatenate([curve.points[:-1] for curve in curves])
    end = np.concatenate([curve.points[1:] for curve in curves])
    segment, fraction = np.empty(len(xyz), np.int64), np.empty(len(xyz))
    run_slices(_nearest_segments, len(xyz), xyz, begin, end, _box_tree(begin, end), segment, fraction)
    foot = begin[segment] + fraction[:, None] * (end[segment] - begin[segment])
    first = np.concatenate([curve.dihedral[:-1] for curve in curves])
    last = np.concatenate([curve.dihedral[1:] for curve in curves])
    owner = np.repeat(np.arange(len(curves)), [len(curve.points) - 1 for curve in curves])
    return NearestEdge(
        distance=np.linalg.norm(xyz - foot, axis=1),
        curve=owner[segment],
        foot=foot,
        dihedral=first[segment] + fraction * (last[segment] - first[segment]),
    )


def _box_tree(begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Bounding boxes (2 L, 6) of runs of segments: root in row 1, children of i in 2 i and 2 i + 1, leaves from L."""
    starts = np.arange(0, len(begin), _LEAF)
    leaves = 1 << (len(starts) - 1).bit_length()
    tree = np.full((2 * leaves, 6), np.inf)
    tree[:, 3:] = -np.inf
    tree[leaves : leaves + len(starts), :3] = np.minimum.reduceat(np.minimum(begin, end), starts)
    tree[leaves : leaves + len(starts), 3:] = np.maximum.reduceat(np.maximum(begin, end), starts)
    while leaves > 1:
        children = tree[leaves : 2 * leaves]
        leaves //= 2
        tree[leaves : 2 * leaves, :3] = np.minimum(children[::2, :3], children[1::2, :3])
        tree[leaves : 2 * leaves, 3:] = np.maximum(children[::2, 3:], children[1::2, 3:])
    return tree


@routine
def _box_distance2(tree, node, x, y, z):
    dx = max(tree[node, 0] - x, 0.0, x - tree[node, 3])
    dy = max(tree[node, 1] - y, 0.0, y - tree[node, 4])
    dz = max(tree[node, 2] - z, 0.0, z - tree[node, 5])
    return dx * dx + dy * dy + dz * dz


@routine
def _foot(begin, end, i, x, y, z):
    """Squared distance to segment i, and where along it (0 to 1) the foot lies."""
    ex, ey, ez = end[i, 0] - begin[i, 0], end[i, 1] - begin[i, 1], end[i, 2] - begin[i, 2]
    px, py, pz = x - begin[i, 0], y - begin[i, 1], z - begin[i, 2]
    square = ex * ex + ey * ey + ez * ez
    t = (ex * px + ey * py + ez * pz) / square if square > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    dx, dy, dz = px - t * ex, py - t * ey, pz - t * ez
    return dx * dx + dy * dy + dz * dz, t


@kernel
def _nearest_segments(start, stop, xyz, begin, end, tree, segment, fraction):
    leaves = len(tree) // 2
    stack = np.empty(64, np.int64)
    guess = 0
    for p in range(start, stop):
        x, y, z = xyz[p, 0], xyz[p, 1], xyz[p, 2]
        # Scans go row by row: the edge of the point before bounds the search for this one.
        best, where = _foot(begin, end, guess, x, y, z)
        stack[0] = 1
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            # The slack keeps rounding from hiding an equally near segment, so the order of points cannot matter.
            if _box_distance2(tree, node, x, y, z) > best * (1.0 + 1e-12) + 1e-24:
                continue
            if node < leaves:
                stack[top] = 2 * node + 1
                stack[top + 1] = 2 * node
                top += 2
                continue
            for i in range((node - leaves) * _LEAF, min((node - leaves + 1) * _LEAF, len(begin))):
                d2, t = _foot(begin, end, i, x, y, z)
                if d2 < best or (d2 == best and i < guess):
                    best, where, guess = d2, t, i
        segment[p] = guess
        fraction[p] = where
