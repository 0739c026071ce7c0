"""Curved surfaces with known edges, or with none at all. Lengths in millimetres."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from edgel.synth.solid import Solid, flat_normals, from_patches, grid_triangles, make_solid, unit

_CHORD = 0.003  # of the usual spacing, along each of the two directions of a patch


def sphere(*, radius: float = 25.0) -> Solid:
    """Make a sphere: no edge at all."""
    spacing = radius / 50
    count = arc_steps(radius, 2 * np.pi, spacing)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * (count // 2) + 1), np.linspace(-np.pi / 2, np.pi / 2, count // 2))
    normals = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1).swapaxes(0, 1)
    return from_patches("sphere", [(radius * normals, normals)], spacing=spacing)


def torus(*, radius: float = 30.0, tube: float = 12.0) -> Solid:
    """Make a torus about the z axis: no edge at all."""
    spacing = tube / 20
    u, v = np.meshgrid(
        np.linspace(0, 2 * np.pi, arc_steps(radius + tube, 2 * np.pi, spacing) + 1),
        np.linspace(0, 2 * np.pi, arc_steps(tube, 2 * np.pi, spacing) + 1),
        indexing="ij",
    )
    normals = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1)
    ring = np.stack([np.cos(u), np.sin(u), np.zeros_like(u)], axis=-1)
    return from_patches("torus", [(radius * ring + tube * normals, normals)], spacing=spacing)


def plane(*, side: float = 120.0) -> Solid:
    """Make a square in z = 0: no crease, one boundary."""
    flat = side * np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], float)
    return from_patches("plane", [(flat, np.broadcast_to([0.0, 0.0, 1.0], flat.shape))], spacing=side / 170)


def wavy_sheet(*, side: float = 120.0, amplitude: float = 4.0) -> Solid:
    """Make the sheet z = a sin(2 pi x / 40) cos(2 pi y / 50): no crease, one boundary, least radius about 10 mm."""
    x, y = np.meshgrid(np.linspace(0, side, 301), np.linspace(0, side, 301), indexing="ij")
    k, m = 2 * np.pi / 40, 2 * np.pi / 50
    z = amplitude * np.sin(k * x) * np.cos(m * y)
    slope_x = amplitude * k * np.cos(k * x) * np.cos(m * y)
    slope_y = -amplitude * m * np.sin(k * x) * np.sin(m * y)
    normals = unit(np.stack([-slope_x, -slope_y, np.ones_like(z)], axis=-1))
    return from_patches("wavy_sheet", [(np.stack([x, y, z], axis=-1), normals)], spacing=side / 170)


def bezier_ridge(*, side: float = 120.0) -> Solid:
    """Make two bicubic Bezier patches that meet in a curved crease, turning from about 20 to about 90 degrees.

    A Bezier patch is a NURBS patch with equal weights and no inner knots.
    """
    step = side / 6
    y = np.linspace(0, side, 4)
    seam = np.stack([np.array([0, 0.4, -0.4, 0]) * step, y, np.array([0, 0.5, -0.2, 0.3]) * step], axis=-1)
    fall = np.array([0.18, 0.4, 0.7, 1.0]) * step
    nets = []
    for way in (-1, 1):
        net = np.empty((4, 4, 3))
        net[0] = seam
        for i, (out, drop) in enumerate([(1, 1.0), (2, 1.3), (3, 0.9)], start=1):
            net[i] = np.stack([np.full(4, way * out * step), y, seam[:, 2] - drop * fall], axis=-1)
        net[1, :, 0] += seam[:, 0]
        nets.append(net[::way])  # x ascends along the first axis of both, so that normals point up
    return from_patches("bezier_ridge", [_bezier(net, 161) for net in nets], spacing=side / 170)


def gear(*, teeth: int = 16, root: float = 32.0, tip: float = 40.0, bore: float = 10.0, thick: float = 15.0) -> Solid:
    """Make a spur gear with straight flanks about the z axis, between z = 0 and `thick`."""
    spacing, period = 0.65, 2 * np.pi / teeth
    arcs = [(0.0, 0.45, root, root), (0.45, 0.58, root, tip), (0.58, 0.87, tip, tip), (0.87, 1.0, tip, root)]
    walls, caps, hole, face = [], [], [], []
    for tooth in range(teeth):
        for k, (start, stop, r0, r1) in enumerate(arcs):
            round_part = r0 == r1
            steps = max(2, arc_steps(r0, (stop - start) * period, spacing)) if round_part else 1
            angle = (tooth + np.linspace(start, stop, steps + 1)) * period
            ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
            outer = np.linspace(r0, r1, steps + 1)[:, None] * ring
            corners = grid_triangles(_upright(outer, thick))
            normals = grid_triangles(_upright(ring, 0.0)) if round_part else flat_normals(corners)
            walls.append((corners, normals))
            face.append(np.full(len(corners), 3 + 4 * tooth + k))
            inner = bore * ring
            caps.append(np.stack([outer, inner], axis=1))
            hole.append((grid_triangles(_upright(inner, thick)[:, ::-1]), -grid_triangles(_upright(ring, 0)[:, ::-1])))
    for z, flip in ((0.0, -1), (thick, 1)):
        for strip in caps:
            corners = grid_triangles(np.concatenate([strip, np.full((*strip.shape[:2], 1), z)], axis=2)[:, ::flip])
            walls.append((corners, flat_normals(corners)))
            face.append(np.full(len(corners), int(z > 0)))
    walls += hole
    face += [np.full(len(corners), 2) for corners, _ in hole]
    corners, normals = (np.concatenate(part) for part in zip(*walls, strict=True))
    return make_solid("gear", corners, np.concatenate(face), normals, spacing=spacing)


def cylinder(*, radius: float = 20.0, height: float = 50.0) -> Solid:
    """Make a solid cylinder on z = 0 about the z axis: two round creases."""
    spacing = 0.6
    angle = np.linspace(0, 2 * np.pi, arc_steps(radius, 2 * np.pi, spacing) + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    wall = _upright(radius * ring, height)
    parts = [(grid_triangles(wall), grid_triangles(_upright(ring, 0.0)))]
    for end, flip in ((0, -1), (1, 1)):
        disc = np.stack([wall[:, end], np.broadcast_to([0, 0, end * height], wall[:, end].shape)], axis=1)[:, ::flip]
        corners = grid_triangles(disc)
        parts.append((corners, np.broadcast_to([0.0, 0.0, -1.0 if end == 0 else 1.0], corners.shape)))
    face = np.repeat([0, 1, 2], [len(corners) for corners, _ in parts])
    corners, normals = (np.concatenate(part) for part in zip(*parts, strict=True))
    return make_solid("cylinder", corners, face, normals, spacing=spacing)


def lathe(
    profile: Sequence[tuple[float, float]], *, fillets: Sequence[float] | None = None, spacing: float = 0.8
) -> Solid:
    """Turn a profile about the z axis: a round crease at each of its corners that has no fillet.

    Parameters
    ----------
    profile : sequence of (radius, z)
        Corners in order with the solid on their left, mm; from the axis to the axis, or a closed loop off it (then the
        first corner is not repeated).
    fillets : sequence of float, optional
        Radius, mm, at each corner; 0 is sharp. They must leave something of every side.
    spacing : float
        See `Solid.spacing`.
    """
    corners = np.asarray(profile, np.float64)
    pieces = round_corners(corners, fillets, closed=corners[0, 0] > 0, spacing=spacing)
    angle = np.linspace(0, 2 * np.pi, arc_steps(corners[:, 0].max(), 2 * np.pi, spacing) + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    ring[-1] = ring[0]  # to the last bit, or the seam would be a boundary

    def turned(line: np.ndarray) -> np.ndarray:
        around = line[None, :, :1] * ring[:, None]
        return np.concatenate([around, np.broadcast_to(line[None, :, 1:], (*around.shape[:2], 1))], axis=2)

    return from_patches("lathe", [(turned(points), turned(normals)) for points, normals in pieces], spacing=spacing)


def prism(
    corners: Sequence[tuple[float, float]],
    *,
    height: float,
    fillets: Sequence[float] | None = None,
    spacing: float = 0.8,
) -> Solid:
    """Raise a convex polygon, counterclockwise, from z = 0 to `height`, mm; upright edges may have fillets."""
    pieces = round_corners(np.asarray(corners, np.float64), fillets, closed=True, spacing=spacing)
    parts = []
    for points, normals in pieces:
        wall, out = _upright(points, height), _upright(normals, 0.0)
        parts.append((grid_triangles(wall), grid_triangles(out)))
    outline = np.concatenate([*(points[:-1] for points, _ in pieces), pieces[0][0][:1]])
    middle = outline[:-1].mean(axis=0)
    for z, flip in ((0.0, -1), (height, 1)):
        ends = np.stack([outline, np.broadcast_to(middle, outline.shape)], axis=1)[:, ::flip]
        cap = grid_triangles(np.concatenate([ends, np.full((*ends.shape[:2], 1), z)], axis=2))
        parts.append((cap, np.broadcast_to([0.0, 0.0, float(flip)], cap.shape)))
    face = np.repeat(np.arange(len(parts)), [len(triangles) for triangles, _ in parts])
    triangles, normals = (np.concatenate(part) for part in zip(*parts, strict=True))
    return make_solid("prism", triangles, face, normals, spacing=spacing)


def round_corners(
    corners: np.ndarray, fillets: Sequence[float] | np.ndarray | None, *, closed: bool, spacing: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Round the corners of a plane polyline.

    Parameters
    ----------
    corners : (C, 2) float64
        In order with the inside on their left, mm; of a closed one the first is not repeated.
    fillets : (C,) float, optional
        Radius, mm, at each corner; 0 is sharp.
    closed : bool
    spacing : float
        See `Solid.spacing`.

    Returns
    -------
    list of (points, normals)
        Sides and fillets in order, points (P, 2) and outer unit normals (P, 2) of each.

    Raises
    ------
    ValueError
        If there is not one fillet for each corner, or they leave nothing of a side.
    """
    count = len(corners)
    radii = np.zeros(count) if fillets is None else np.asarray(fillets, np.float64)
    if radii.shape != (count,):
        raise ValueError(f"fillets: expected one for each of {count} corners, got {radii.shape}")
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    arrive, leave = unit(corners - before), unit(after - corners)
    turn = np.arctan2(arrive[:, 0] * leave[:, 1] - arrive[:, 1] * leave[:, 0], (arrive * leave).sum(axis=1))
    if not closed:
        radii = np.where((np.arange(count) == 0) | (np.arange(count) == count - 1), 0, radii)
    trim = radii * np.abs(np.tan(turn / 2))
    starts, stops = corners + trim[:, None] * leave, after - np.roll(trim, -1)[:, None] * leave
    if (((stops - starts) * leave).sum(axis=1)[: count if closed else -1] <= 0).any():
        raise ValueError("fillets: they leave nothing of a side")
    pieces = []
    for i in range(count if closed else count - 1):
        if radii[i] > 0:
            out = np.array([arrive[i, 1], -arrive[i, 0]])
            centre = corners[i] - trim[i] * arrive[i] - np.sign(turn[i]) * radii[i] * out
            swing = np.linspace(0, turn[i], max(4, arc_steps(radii[i], abs(turn[i]), spacing)) + 1)[:, None]
            normals = np.cos(swing) * out + np.sin(swing) * np.array([-out[1], out[0]])
            points = centre + np.sign(turn[i]) * radii[i] * normals
            points[0], points[-1] = corners[i] - trim[i] * arrive[i], starts[i]
            pieces.append((points, normals))
        pieces.append((np.stack([starts[i], stops[i]]), np.tile([leave[i, 1], -leave[i, 0]], (2, 1))))
    return pieces


def _bezier(net: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and unit normals (count, count, 3) of the bicubic patch over a net of control points (4, 4, 3)."""
    t = np.linspace(0, 1, count)[:, None]
    basis = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    quadratic: Callable[[np.ndarray], np.ndarray] = lambda s: np.concatenate(  # noqa: E731
        [(1 - s) ** 2, 2 * s * (1 - s), s**2], axis=1
    )
    points = np.einsum("ui,vj,ijk->uvk", basis, basis, net)
    along_u = np.einsum("ui,vj,ijk->uvk", quadratic(t), basis, np.diff(net, axis=0))
    along_v = np.einsum("ui,vj,ijk->uvk", basis, quadratic(t), np.diff(net, axis=1))
    return points, unit(np.cross(along_u, along_v))


def _upright(ring: np.ndarray, height: float) -> np.ndarray:
    """Stand a plane curve (P, 2) up to a wall (P, 2, 3) from z = 0 to `height`."""
    low = np.column_stack([ring, np.zeros(len(ring))])
    return np.stack([low, low + (0, 0, height)], axis=1)


def arc_steps(radius: float, angle: float, spacing: float) -> int:
    """Count the chords that stay near enough to an arc: the sagitta of a chord over the angle a is r a^2 / 8."""
    return int(np.ceil(angle / np.sqrt(8 * _CHORD * spacing / radius)))
