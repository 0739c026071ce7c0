"""A structured-light scanner that looks down on a part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edgel.cloud import Cloud
from edgel.synth.edges import NearestEdge, nearest_edge
from edgel.synth.part import Part

_SURPLUS = 1.01  # rays that hit, for each point wanted; the rest are the scanner's dropouts
_JITTER = 0.1  # greatest shift of a ray from its place in the grid, in pitches


@dataclass(frozen=True, eq=False)
class Scan:
    """A simulated scan with its truth. The edges are found when first asked for.

    Attributes
    ----------
    cloud : Cloud
        The points (N, 3), mm, row by row: y ascending, within a row x ascending. The viewer is infinitely far up +Z.
    part : Part
        What was scanned.
    z : (N,) float64
        Height of the surface without the noise, mm.
    normals : (N, 3) float64
        True outward unit normal of the surface there.
    pitch : float
        Distance between neighbouring rays, mm.
    noise : float
        Standard deviation of the noise in z, mm.
    seed : int
        What the random numbers began with.

    Examples
    --------
    >>> from edgel import synth
    >>> scan = synth.scan(synth.tee(), num_points=5000)
    >>> on_seam = (scan.edge_kind == "crease") & (scan.edge_distance < scan.pitch)
    >>> len(scan.cloud), bool(on_seam.any())
    (5000, True)
    """

    cloud: Cloud
    part: Part
    z: np.ndarray
    normals: np.ndarray
    pitch: float
    noise: float
    seed: int

    @property
    def hits(self) -> np.ndarray:
        """Where the rays met the surface, without the noise, (N, 3), mm."""
        return np.column_stack([self.cloud.xyz[:, :2], self.z])

    @cached_property
    def nearest(self) -> NearestEdge:
        """The nearest true edge of each noise-free hit: curve, foot, distance, dihedral."""
        return nearest_edge(self.hits, self.part.edges)

    @cached_property
    def nearest_seen(self) -> NearestEdge:
        """The same as the viewer sees it, in x and y alone: distances are those in the projection, feet have z = 0."""
        flat = [replace(edge, points=edge.points * (1.0, 1.0, 0.0)) for edge in self.part.edges]
        return nearest_edge(self.cloud.xyz * (1.0, 1.0, 0.0), flat)

    @property
    def edge_distance(self) -> np.ndarray:
        """Distance in 3D from the noise-free hit to the nearest true edge, (N,), mm.

        At a silhouette the surface is steep: a ray that passes it by d hits about ``sqrt(2 r d)`` away from it, many
        pitches. To mark the points along a silhouette take ``nearest_seen.distance``.
        """
        return self.nearest.distance

    @property
    def edge_dihedral(self) -> np.ndarray:
        """Dihedral angle at the nearest point of that edge, (N,), radians; NaN where it is not a crease."""
        return self.nearest.dihedral

    @cached_property
    def edge_kind(self) -> np.ndarray:
        """Kind of that edge, (N,) str: ``"boundary"``, ``"occluding"`` or ``"crease"``."""
        return np.array([edge.kind for edge in self.part.edges])[self.nearest.curve]


def scan(
    part: Part, *, num_points: int | None = None, pitch: float | None = None, noise: float = 0.02, seed: int = 0
) -> Scan:
    """Scan a part from above: parallel rays along -Z on a square grid, each shifted by up to a tenth of the pitch.

    Parameters
    ----------
    part : Part
    num_points : int, optional
        Exact number of points: surplus ones drop out at random. By default the part's own number, or with `pitch`
        every ray that hits.
    pitch : float, optional
        Distance between neighbouring rays, mm. By default what gives 1 % more hits than points wanted.
    noise : float
        Standard deviation of the Gaussian noise added to z, mm.
    seed : int
        Same seed, same bytes.

    Raises
    ------
    ValueError
        If a number is out of range, or with this pitch fewer rays hit than points are wanted.

    Examples
    --------
    >>> from edgel import synth
    >>> synth.scan(synth.elbow(), num_points=1000, noise=0.0).cloud
    Cloud(1,000 points, unorganized; attributes: none)
    """
    if num_points is not None and num_points < 1:
        raise ValueError(f"num_points: expected 1 or more, got {num_points}")
    if pitch is not None and not (np.isfinite(pitch) and pitch > 0):
        raise ValueError(f"pitch: expected a length above 0, got {pitch}")
    if not (np.isfinite(noise) and noise >= 0):
        raise ValueError(f"noise: expected a length of 0 or more, got {noise}")
    rng = np.random.default_rng(seed)
    if pitch is not None:
        xyz, normals = _cast(part, pitch, rng)
        if len(xyz) < (num_points or 1):
            raise ValueError(f"pitch: {pitch} gives {len(xyz)} hits of the {num_points or 1} wanted; make it smaller")
    else:
        num_points = num_points or part.num_points
        pitch = float(np.sqrt(_seen_area(part) / (num_points * _SURPLUS)))
        while len((found := _cast(part, pitch, rng))[0]) < num_points:
            pitch *= 0.99
        xyz, normals = found
    if num_points is not None:
        kept = np.sort(rng.choice(len(xyz), num_points, replace=False, shuffle=False))
        xyz, normals = xyz[kept], normals[kept]
    z = xyz[:, 2].copy()
    xyz[:, 2] += rng.normal(0.0, noise, len(xyz))
    return Scan(Cloud(xyz), part, z, normals, pitch, noise, seed)


def _cast(part: Part, pitch: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals, row by row, where the rays of one jittered grid hit."""
    low, high = part.bounds
    columns, rows = np.ceil((high - low) / pitch).astype(int) + 2
    # The grid begins anywhere within a cell, so that it is never aligned with the part by chance.
    first_x, first_y = low - pitch * (0.5 + rng.random(2))
    dx, dy = rng.uniform(-_JITTER * pitch, _JITTER * pitch, (2, rows, columns))
    x = first_x + pitch * np.arange(columns) + dx
    y = first_y + pitch * np.arange(rows)[:, None] + dy
    hits = part.look(x, y)
    hit = hits.surface >= 0
    return np.column_stack([x[hit], y[hit], hits.z[hit]]), hits.normals[hit]


def _seen_area(part: Part, cells: int = 400) -> float:
    """Area of the part seen from above, mm^2, by counting the cells of a regular grid."""
    low, high = part.bounds
    step = (high - low) / cells
    centres = np.arange(cells) + 0.5
    x, y = np.meshgrid(low[0] + step[0] * centres, low[1] + step[1] * centres)
    return float(np.isfinite(part.height(x, y)).mean() * np.prod(high - low))
