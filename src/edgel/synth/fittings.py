"""The two pipe fittings of the published method's experiment, to ASME B16.9 DN 100."""

from __future__ import annotations

import numpy as np

from edgel.synth.edges import EdgeCurve, arc, line
from edgel.synth.part import Part
from edgel.synth.surfaces import Bend, Pipe


def tee(*, outside_diameter: float = 114.3, wall: float = 6.02, centre_to_end: float = 105.0) -> Part:
    """Make an equal tee lying flat: the run along x, the branch towards +y, the axes in z = 0, crossing at the origin.

    The two pipes meet in a concave seam without a fillet, ``y = |x|``, ``z = sqrt(r^2 - x^2)``, whose dihedral angle
    ``arccos(1 - x^2 / r^2)`` grows from 0 at the top (x = y = 0) to 90 degrees at the side. The ends are edge-on.

    Parameters
    ----------
    outside_diameter, wall : float
        Of all three ends, mm. The wall is not seen from above.
    centre_to_end : float
        Of run and branch, mm; more than the outside radius.

    Raises
    ------
    ValueError
        If a length is not positive, or the parts do not fit together.

    Examples
    --------
    >>> from edgel import synth
    >>> part = synth.tee()
    >>> part.num_points, [edge.kind for edge in part.edges].count("crease")
    (647984, 2)
    """
    r, end = outside_diameter / 2, centre_to_end
    _check_pipe(outside_diameter, wall)
    if not (np.isfinite(end) and end > r):
        raise ValueError(f"centre_to_end: expected more than the outside radius {r}, got {end}")
    z, x, y = (0.0, 0.0, r), (r, 0.0, 0.0), (0.0, r, 0.0)
    return Part(
        name="tee",
        surfaces=(Pipe((-end, 0.0), (end, 0.0), r), Pipe((0.0, 0.0), (0.0, end), r)),
        edges=(
            EdgeCurve("boundary", arc((-end, 0.0, 0.0), y, z, 0.0, np.pi)),
            EdgeCurve("boundary", arc((end, 0.0, 0.0), y, z, 0.0, np.pi)),
            EdgeCurve("boundary", arc((0.0, end, 0.0), x, z, 0.0, np.pi)),
            EdgeCurve("occluding", line((-end, -r, 0.0), (end, -r, 0.0))),
            EdgeCurve("occluding", line((-end, r, 0.0), (-r, r, 0.0))),
            EdgeCurve("occluding", line((r, r, 0.0), (end, r, 0.0))),
            EdgeCurve("occluding", line((-r, r, 0.0), (-r, end, 0.0))),
            EdgeCurve("occluding", line((r, r, 0.0), (r, end, 0.0))),
            _seam(r, -1),
            _seam(r, 1),
        ),
        num_points=647_984,
        dimensions={"outside_diameter": outside_diameter, "wall": wall, "centre_to_end": centre_to_end},
    )


def elbow(*, outside_diameter: float = 114.3, wall: float = 6.02, bend_radius: float = 152.4) -> Part:
    """Make a 90 degree elbow lying flat: its bend about the origin through the quadrant x, y > 0, its axis in z = 0.

    Parameters
    ----------
    outside_diameter, wall : float
        Of both ends, mm. The wall is not seen from above.
    bend_radius : float
        From the centre of the bend to the axis, which is also centre to end, mm; more than the outside radius.

    Raises
    ------
    ValueError
        If a length is not positive, or the bend is tighter than the pipe is thick.

    Examples
    --------
    >>> from edgel import synth
    >>> part = synth.elbow()
    >>> part.num_points, part.bounds.tolist()
    (520915, [[0.0, 0.0], [209.55, 209.55]])
    """
    r, bend = outside_diameter / 2, bend_radius
    _check_pipe(outside_diameter, wall)
    if not (np.isfinite(bend) and bend > r):
        raise ValueError(f"bend_radius: expected more than the outside radius {r}, got {bend}")
    origin, z = (0.0, 0.0, 0.0), (0.0, 0.0, r)
    inner, outer = bend - r, bend + r
    return Part(
        name="elbow",
        surfaces=(Bend((0.0, 0.0), bend, r, 0.0, np.pi / 2),),
        edges=(
            EdgeCurve("boundary", arc((bend, 0.0, 0.0), (r, 0.0, 0.0), z, 0.0, np.pi)),
            EdgeCurve("boundary", arc((0.0, bend, 0.0), (0.0, r, 0.0), z, 0.0, np.pi)),
            EdgeCurve("occluding", arc(origin, (inner, 0.0, 0.0), (0.0, inner, 0.0), 0.0, np.pi / 2)),
            EdgeCurve("occluding", arc(origin, (outer, 0.0, 0.0), (0.0, outer, 0.0), 0.0, np.pi / 2)),
        ),
        num_points=520_915,
        dimensions={"outside_diameter": outside_diameter, "wall": wall, "bend_radius": bend_radius},
    )


def _seam(r: float, side: int) -> EdgeCurve:
    """Make the seam of the tee at x < 0 (side -1) or x > 0 (side 1), from the top down."""
    points = arc((0.0, 0.0, 0.0), (0.0, 0.0, r), (side * r, r, 0.0), 0.0, np.pi / 2)
    normals = np.stack([points * (0, 1, 1), points * (1, 0, 1)], axis=1) / r
    return EdgeCurve("crease", points, normals)


def _check_pipe(outside_diameter: float, wall: float) -> None:
    if not (np.isfinite(outside_diameter) and outside_diameter > 0):
        raise ValueError(f"outside_diameter: expected a length above 0, got {outside_diameter}")
    if not 0 < wall < outside_diameter / 2:
        raise ValueError(f"wall: expected a length between 0 and the radius {outside_diameter / 2}, got {wall}")
