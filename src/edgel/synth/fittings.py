"""The two pipe fittings of the published method's experiment, to ASME B16.9 DN 100: their outside, the upper half."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel.synth.curved import arc_steps
from edgel.synth.edges import EdgeCurve, arc, line
from edgel.synth.solid import Solid, from_patches

SPACING = 0.2
"""About the spacing of the published scans, mm, which the meshes are meant for."""


def tee(*, outside_diameter: float = 114.3, centre_to_end: float = 105.0) -> Solid:
    """Make the upper half of an equal tee: the run along x, the branch towards +y, the axes in z = 0, meeting at 0.

    The two pipes meet in a concave seam without a fillet, ``y = |x|``, ``z = sqrt(r^2 - x^2)``, whose dihedral angle
    ``arccos(1 - x^2 / r^2)`` grows from 0 at the top (x = y = 0) to 90 degrees at the side. Its curves are named "rim"
    (an open end), "outline" (z = 0, where the whole tee turns away from a viewer above) and "seam".

    Parameters
    ----------
    outside_diameter : float
        Of all three ends, mm.
    centre_to_end : float
        Of run and branch, mm; more than the outside radius.

    Raises
    ------
    ValueError
        If a length is not positive, or the pipes do not fit together.

    Examples
    --------
    >>> from edgel import synth
    >>> solid = synth.tee()
    >>> [edge.name for edge in solid.edges].count("seam")
    2
    """
    r, end = _radius(outside_diameter), centre_to_end
    if not (np.isfinite(end) and end > r):
        raise ValueError(f"centre_to_end: expected more than the outside radius {r}, got {end}")
    across, height = _half_circle(r)
    # The run is ruled along x, from its ends to its middle or, where the branch sits, to the seam at |x| = y.
    outer, middle, seam = np.full_like(across, end), np.maximum(across, 0), np.abs(across)
    run = [_ruled(-middle, -outer, across, height), _ruled(outer, middle, across, height)]
    branch = _ruled(seam, outer, across, height)[..., [1, 0, 2]]
    patches = [*((points, points * (0, 1, 1) / r) for points in run), (branch, branch * (1, 0, 1) / r)]
    x, y, z = (r, 0.0, 0.0), (0.0, r, 0.0), (0.0, 0.0, r)
    corners = [(-r, end), (-r, r), (-end, r), (-end, -r), (end, -r), (end, r), (r, r), (r, end)]
    outline = [line((*corners[i], 0.0), (*corners[i + 1], 0.0)) for i in (0, 1, 3, 5, 6)]
    return replace(
        from_patches("tee", patches, spacing=SPACING),
        creases=(_seam(r, -1), _seam(r, 1)),
        boundaries=(
            EdgeCurve("boundary", arc((-end, 0.0, 0.0), y, z, 0.0, np.pi), name="rim"),
            EdgeCurve("boundary", arc((end, 0.0, 0.0), y, z, np.pi, 0.0), name="rim"),
            EdgeCurve("boundary", arc((0.0, end, 0.0), x, z, 0.0, np.pi), name="rim"),
            *(EdgeCurve("boundary", points, name="outline") for points in outline),
        ),
    )


def elbow(*, outside_diameter: float = 114.3, bend_radius: float = 152.4) -> Solid:
    """Make the upper half of a 90 degree elbow: its bend about the origin, x, y > 0, its axis in z = 0.

    Its curves are named "rim" (an open end) and "outline" (z = 0, where the whole elbow turns away from a viewer
    above).

    Parameters
    ----------
    outside_diameter : float
        Of both ends, mm.
    bend_radius : float
        From the centre of the bend to the axis, which is also centre to end, mm; more than the outside radius.

    Raises
    ------
    ValueError
        If a length is not positive, or the bend is tighter than the pipe is thick.

    Examples
    --------
    >>> from edgel import synth
    >>> solid = synth.elbow()
    >>> solid.vertices.max(axis=0).round(6).tolist()
    [209.55, 209.55, 57.15]
    """
    r, bend = _radius(outside_diameter), bend_radius
    if not (np.isfinite(bend) and bend > r):
        raise ValueError(f"bend_radius: expected more than the outside radius {r}, got {bend}")
    across, height = _half_circle(r)
    turn = np.linspace(0, np.pi / 2, arc_steps(bend + r, np.pi / 2, SPACING) + 1)
    ray = np.column_stack([np.cos(turn), np.sin(turn)])
    ray[-1] = 0.0, 1.0

    def swept(distance: np.ndarray) -> np.ndarray:
        level = np.broadcast_to(height[:, None, None], (len(height), len(turn), 1))
        return np.concatenate([distance[:, None, None] * ray, level], axis=2)

    origin, z, inner, outer = (0.0, 0.0, 0.0), (0.0, 0.0, r), bend - r, bend + r
    circles = [(inner, np.pi / 2, 0.0), (outer, 0.0, np.pi / 2)]
    outline = [arc(origin, (radius, 0, 0), (0, radius, 0), start, stop) for radius, start, stop in circles]
    return replace(
        from_patches("elbow", [(swept(bend + across), swept(across) / r)], spacing=SPACING),
        boundaries=(
            EdgeCurve("boundary", arc((bend, 0.0, 0.0), (r, 0.0, 0.0), z, np.pi, 0.0), name="rim"),
            EdgeCurve("boundary", arc((0.0, bend, 0.0), (0.0, r, 0.0), z, 0.0, np.pi), name="rim"),
            *(EdgeCurve("boundary", points, name="outline") for points in outline),
        ),
    )


def _half_circle(r: float) -> tuple[np.ndarray, np.ndarray]:
    """Places across a pipe, from -r to r, and their heights over its axis, 0 at both ends."""
    steps = arc_steps(r, np.pi / 2, SPACING)
    angle = np.linspace(-np.pi / 2, np.pi / 2, 2 * steps + 1)
    across, height = r * np.sin(angle), r * np.cos(angle)
    across[steps], height[0], height[-1] = 0.0, 0.0, 0.0
    return across, height


def _ruled(start: np.ndarray, stop: np.ndarray, across: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Straight lines along x on a pipe, from one x (M,) to another: a grid (M, 2, 3)."""
    return np.stack([np.column_stack([x, across, height]) for x in (start, stop)], axis=1)


def _seam(r: float, side: int) -> EdgeCurve:
    """Make the seam of the tee at x < 0 (side -1) or x > 0 (side 1), from the top down."""
    points = arc((0.0, 0.0, 0.0), (0.0, 0.0, r), (side * r, r, 0.0), 0.0, np.pi / 2)
    run, branch = points * (0, 1, 1) / r, points * (1, 0, 1) / r
    return EdgeCurve("crease", points, np.stack([run, branch][::-side], axis=1), name="seam")


def _radius(outside_diameter: float) -> float:
    if not (np.isfinite(outside_diameter) and outside_diameter > 0):
        raise ValueError(f"outside_diameter: expected a length above 0, got {outside_diameter}")
    return outside_diameter / 2
