"""Polyhedra with known edges: everything follows from their polygons. Lengths in millimetres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from edgel.synth.solid import Solid, flat_normals, from_polygons, make_solid

Ticks = Sequence[float] | np.ndarray


def frustum(*, sides: int = 6, bottom: float = 40.0, top: float = 24.0, height: float = 45.0) -> Solid:
    """Make a frustum over a regular polygon of circumradius `bottom`, its base in z = 0: 3 `sides` creases."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low = np.column_stack([bottom * ring, np.zeros(sides)])
    high = np.column_stack([top * ring, np.full(sides, height)])
    walls = [(i, (i + 1) % sides, sides + (i + 1) % sides, sides + i) for i in range(sides)]
    polygons = [tuple(range(sides))[::-1], tuple(range(sides, 2 * sides)), *walls]
    return from_polygons("frustum", np.concatenate([low, high]), polygons, spacing=0.75)


def stepped_block() -> Solid:
    """Make a block of 90 x 60 x 45 mm with three steps and a pocket in the middle one."""
    x, y, z = [0, 30, 38, 52, 60, 90], [0, 14, 46, 60], [0, 15, 22, 30, 45]
    filled = np.ones((5, 3, 4), bool)
    filled[1:4, :, 3] = False
    filled[4, :, 1:] = False
    filled[2, 1, 1:3] = False  # the pocket: 14 x 32 mm, 15 mm deep
    filled[1:4, 1, 2] = False  # and a wider recess of 8 mm around it
    return blocks("stepped_block", filled, x, y, z, spacing=0.8)


def cube_fractal(*, side: float = 40.5) -> Solid:
    """Make a cube with cubes of a third of its side on its faces, and again on theirs."""
    unit, filled = side / 9, np.zeros((17, 17, 17), bool)
    filled[4:13, 4:13, 4:13] = True
    for axis in range(3):
        for sign in (-1, 1):
            _grow(filled, np.array([8, 8, 8]), 9, axis, sign, 2)
    ticks = unit * (np.arange(18) - 8.5)
    return blocks("cube_fractal", filled, ticks, ticks, ticks, spacing=0.75)


def wedge_fan(
    *, angles: Sequence[float] = tuple(range(10, 180, 10)), flank: float = 10.0, width: float = 40.0
) -> Solid:
    """Make a bar with ridges across it whose edges enclose the given angles.

    Parameters
    ----------
    angles : sequence of float
        Dihedral angle inside each ridge, degrees: its edge turns by 180 degrees minus it, its foot by 90 minus half.
    flank : float
        Length of the ridges' sides, mm.
    width : float
        Of the bar, mm.
    """
    profile, x = [(0.0, 0.0)], 0.0
    for angle in angles:
        half = np.radians(angle) / 2
        x += 5.0
        profile += [(x, 0.0), (x + flank * np.sin(half), flank * np.cos(half)), (x + 2 * flank * np.sin(half), 0.0)]
        x = profile[-1][0]
    profile.append((x + 5.0, 0.0))
    return ridge("wedge_fan", profile, width=width, base=4.0, spacing=0.9)


def thin_plate(*, length: float = 140.0, width: float = 80.0, thin: float = 1.2, thick: float = 3.2) -> Solid:
    """Make a plate that grows from 1.5 to 4 times the usual spacing (0.8 mm) in thickness along its length."""
    a, b = thin / 2, thick / 2
    low = [(0, 0, -a), (length, 0, -b), (length, width, -b), (0, width, -a)]
    high = [(0, 0, a), (length, 0, b), (length, width, b), (0, width, a)]
    polygons = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return from_polygons("thin_plate", low + high, polygons, spacing=0.8)


def blocks(name: str, filled: np.ndarray, x: Ticks, y: Ticks, z: Ticks, *, spacing: float) -> Solid:
    """Make the union of the filled cells (A, B, C) bool of a grid with the ticks x (A + 1,), y and z."""
    ticks = [np.asarray(t, np.float64) for t in (x, y, z)]
    padded = np.pad(filled, 1)
    corners, face = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1, 1):
            cells = np.argwhere(filled & ~np.roll(padded, -sign, axis)[1:-1, 1:-1, 1:-1])
            quads = np.empty((len(cells), 4, 3))
            for i, (du, dv) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)][::sign]):
                quads[:, i, axis] = ticks[axis][cells[:, axis] + (sign > 0)]
                quads[:, i, u] = ticks[u][cells[:, u] + du]
                quads[:, i, v] = ticks[v][cells[:, v] + dv]
            corners.append(quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3))
            # One plane is one face: no crease between cells side by side.
            face.append(np.repeat((cells[:, axis] * 2 + (sign > 0)) * 3 + axis, 2))
    triangles = np.concatenate(corners)
    return make_solid(name, triangles, np.concatenate(face), flat_normals(triangles), spacing=spacing)


def ridge(name: str, profile: Sequence, *, width: float, base: float, spacing: float) -> Solid:
    """Extrude a profile z(x), (P, 2) with x ascending, along y from 0 to `width`, down to z = -`base`."""
    xz = np.asarray(profile, np.float64)
    count = len(xz)

    def row(y: float, z: np.ndarray) -> list:
        return np.column_stack([xz[:, 0], np.full(count, y), z]).tolist()

    bottom = np.full(count, -base)
    points = np.array(row(0, xz[:, 1]) + row(width, xz[:, 1]) + row(0, bottom) + row(width, bottom))
    front, back, front_low, back_low = (np.arange(count) + i * count for i in range(4))
    quads, face = [], []
    for i in range(count - 1):
        j = i + 1
        quads += [(front[i], front[j], back[j], back[i]), (front_low[i], back_low[i], back_low[j], front_low[j])]
        quads += [(front_low[i], front_low[j], front[j], front[i]), (back_low[j], back_low[i], back[i], back[j])]
        face += [5 + i, 0, 1, 2]
    quads += [(front_low[0], front[0], back[0], back_low[0]), (front[-1], front_low[-1], back_low[-1], back[-1])]
    face += [3, 4]
    corners = points[np.array(quads)][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3)
    return make_solid(name, corners, np.repeat(face, 2), flat_normals(corners), spacing=spacing)


def _grow(filled: np.ndarray, centre: np.ndarray, side: int, axis: int, sign: int, depth: int) -> None:
    """Fill a cube of a third of `side` on one face of the cube at `centre`, and `depth` - 1 generations on it."""
    small = side // 3
    at = centre.copy()
    at[axis] += sign * (side + small) // 2
    low = at - small // 2
    filled[tuple(slice(a, a + small) for a in low)] = True
    if depth > 1:
        for other in range(3):
            for way in (-1, 1):
                if (other, way) != (axis, -sign):
                    _grow(filled, at, small, other, way, depth - 1)
