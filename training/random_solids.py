"""Random solids to train on, of thirteen families, stretched and sheared, alone or several in one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from edgel import synth
from edgel.synth import EdgeCurve, Solid

ASSEMBLIES = 0.12  # share of the solids that are several bodies
WARPED = 0.35  # share of the bodies that are stretched and sheared


def solid(rng: np.random.Generator) -> Solid:
    """Make a solid."""
    while True:
        try:
            made = _assembly(rng) if rng.random() < ASSEMBLIES else _single(rng)
            if np.isfinite(made.area):
                return made
        except ValueError:  # cells that touch along an edge only are no surface
            continue


def _single(rng: np.random.Generator) -> Solid:
    body = list(_SHARES)[rng.choice(len(_SHARES), p=np.array(list(_SHARES.values())) / 100)](rng)
    if not np.isfinite(body.area):
        raise ValueError("solid: a side of no length")
    return _warped(body, _matrix(rng)) if rng.random() < WARPED else body


def _matrix(rng: np.random.Generator) -> np.ndarray:
    """Stretch and shear: right angles become any."""
    matrix = np.diag(log_uniform(rng, 0.5, 1.6, 3)) + np.triu(rng.uniform(-0.9, 0.9, (3, 3)), 1)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return turn @ matrix @ turn.T


def _warped(body: Solid, matrix: np.ndarray, shift: Sequence[float] | np.ndarray = (0, 0, 0)) -> Solid:
    """Map a solid; the determinant has to be positive."""
    back = np.linalg.inv(matrix)

    def turned(normals: np.ndarray) -> np.ndarray:
        moved = normals @ back
        return moved / np.linalg.norm(moved, axis=-1, keepdims=True)

    def curves(those: tuple[EdgeCurve, ...]) -> tuple[EdgeCurve, ...]:
        return tuple(
            replace(c, points=c.points @ matrix.T + shift, normals=None if c.normals is None else turned(c.normals))
            for c in those
        )

    return replace(
        body,
        vertices=body.vertices @ matrix.T + shift,
        normals=turned(body.normals),
        creases=curves(body.creases),
        boundaries=curves(body.boundaries),
    )


def _assembly(rng: np.random.Generator) -> Solid:
    """Several bodies that touch, nearly touch or run into each other, faces hidden inside too, as in many CAD files."""
    parts = [_single(rng)]
    for _ in range(rng.integers(1, 5)):
        body, base = _single(rng), parts[0].vertices
        scale = rng.uniform(0.15, 0.7) * np.ptp(base, axis=0).max() / np.ptp(body.vertices, axis=0).max()
        low, high = scale * body.vertices.min(axis=0), scale * body.vertices.max(axis=0)
        shift = rng.uniform(base.min(axis=0) - low, np.maximum(base.max(axis=0) - high, base.min(axis=0) - low + 1e-6))
        axis = rng.integers(3)
        gap = rng.choice([0.0, rng.uniform(0.2, 2.0), -rng.uniform(0.5, 4.0)])
        shift[axis] = base[:, axis].max() - low[axis] + gap
        parts.append(_warped(body, scale * np.eye(3), shift))
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.cumsum([0, *(part.face.max() + 1 for part in parts)])
    return Solid(
        name="assembly",
        vertices=np.concatenate([part.vertices for part in parts]),
        triangles=np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=False)]),
        face=np.concatenate([part.face + start for part, start in zip(parts, faces, strict=False)]),
        normals=np.concatenate([part.normals for part in parts]),
        creases=tuple(curve for part in parts for curve in part.creases),
        boundaries=tuple(curve for part in parts for curve in part.boundaries),
        spacing=min(part.spacing for part in parts),
    )


def log_uniform(rng: np.random.Generator, low: float, high: float, *size: int) -> np.ndarray:
    """Draw so that every doubling is as likely as the next."""
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


def _ticks(rng: np.random.Generator, count: int, low: float, high: float) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(log_uniform(rng, low, high, count))])


def _cells(rng: np.random.Generator) -> Solid:
    shape = rng.integers(1, 5, 3)
    filled = rng.random(shape) < rng.uniform(0.4, 1)
    if not filled.any():
        raise ValueError("filled: nothing")
    low = log_uniform(rng, 0.6, 6, 1)[0]
    return synth.blocks("cells", filled, *(_ticks(rng, n, low, low * 8) for n in shape), spacing=0.8)


def _plate_with_cells(rng: np.random.Generator) -> Solid:
    shape = (*rng.integers(3, 9, 2), 3)
    filled = rng.random(shape) < rng.uniform(0.2, 0.5)
    filled[:, :, 0] = True
    filled[:, :, 2] &= filled[:, :, 1]
    return synth.blocks("plate_with_cells", filled, *(_ticks(rng, n, 0.7, 12) for n in shape), spacing=0.8)


def _frustum(rng: np.random.Generator) -> Solid:
    bottom, top = rng.uniform(12, 45, 2)
    return synth.frustum(sides=int(rng.integers(3, 12)), bottom=bottom, top=top, height=rng.uniform(5, 60))


def _ridges(rng: np.random.Generator) -> Solid:
    count = int(rng.integers(3, 16))
    x = np.cumsum(rng.uniform(2, 14, count))
    z = np.cumsum(rng.standard_normal(count) * rng.uniform(1, 12))
    profile = np.column_stack([x, z - z.min()])
    return synth.ridge("ridges", profile, width=rng.uniform(15, 60), base=rng.uniform(2, 20), spacing=0.8)


def _turned(rng: np.random.Generator) -> Solid:
    count = int(rng.integers(1, 6))
    z = np.concatenate([[0], np.cumsum(rng.uniform(1, 15, count))])
    outer = rng.uniform(10, 35, count + 1) if rng.random() < 0.7 else np.full(count + 1, rng.uniform(10, 35))
    if rng.random() < 0.4:  # steps
        z, outer = np.repeat(z, 2)[1:-1], np.repeat(outer[:-1], 2)
    inner = rng.uniform(0.3, 0.9) * float(min(outer)) if rng.random() < 0.5 else 0.0
    profile = [(inner, float(z[0])), *zip(outer.tolist(), z.tolist(), strict=True), (inner, float(z[-1]))]
    return synth.lathe(profile, fillets=_fillets(rng, len(profile)))


def _prism(rng: np.random.Generator) -> Solid:
    count = int(rng.integers(3, 9))
    angle = np.sort((np.arange(count) + rng.uniform(-0.35, 0.35, count)) * 2 * np.pi / count)
    radius = rng.uniform(10, 35)
    corners = np.column_stack([radius * np.cos(angle), rng.uniform(0.3, 1) * radius * np.sin(angle)])
    return synth.prism(corners.tolist(), height=float(log_uniform(rng, 1, 40, 1)[0]), fillets=_fillets(rng, count))


def _fillets(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.where(rng.random(count) < rng.choice([0.0, 0.5, 0.8, 1.0]), log_uniform(rng, 1, 7, count), 0)


def _rounded_box(rng: np.random.Generator) -> Solid:
    """A box all of whose edges are rounded, or its upper half alone on a sharp-edged bottom."""
    half = log_uniform(rng, 3, 25, 3)
    radius = float(log_uniform(rng, 0.8, 8, 1)[0])
    radius = min(radius, 0.9 * float(half.min()))
    core = half - radius
    cut = rng.random() < 0.5
    swing = radius * np.tan(np.linspace(0, np.pi / 4, 9))
    ticks = [np.concatenate([-c - swing[::-1], c + swing]) for c in core]
    patches = []
    for axis in range(3):
        for sign in (-1, 1):
            others = [(axis + 1) % 3, (axis + 2) % 3][::sign]
            u, v = np.meshgrid(
                *(np.maximum(ticks[o], 0) if cut and o == 2 else ticks[o] for o in others), indexing="ij"
            )
            if cut and axis == 2 and sign < 0:
                continue
            grid = np.empty((*u.shape, 3))
            grid[..., axis], grid[..., others[0]], grid[..., others[1]] = sign * half[axis], u, v
            inner = np.clip(grid, -core, core)
            if cut:
                inner[..., 2] = np.maximum(inner[..., 2], 0)
            out = grid - inner
            normals = out / np.linalg.norm(out, axis=-1, keepdims=True)
            patches.append((inner + radius * normals, normals))
    if cut:
        patches += [
            _under(points) for points, _ in patches if np.ptp(points[..., 2]) > 0 and (points[..., 2] == 0).any()
        ]
    return synth.from_patches("rounded_box", patches, spacing=0.8)


def _under(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The part of the bottom, z = 0, between the middle and a wall's lower rim."""
    rim = points[:, 0] if (points[:, 0, 2] == 0).all() else points[0]
    if not (rim[:, 2] == 0).all():
        rim = points[:, -1] if (points[:, -1, 2] == 0).all() else points[-1]
    strip = np.stack([rim, np.zeros_like(rim)], axis=1)
    outward = np.cross(strip[1, 0] - strip[0, 0], strip[0, 1] - strip[0, 0])[2]
    strip = strip if outward < 0 else strip[:, ::-1]
    return strip, np.broadcast_to([0.0, 0.0, -1.0], strip.shape)


def _blended(rng: np.random.Generator) -> Solid:
    """A block with a wavy top of planes, most of their edges rounded."""
    count = int(rng.integers(2, 9))
    x = np.cumsum(rng.uniform(5, 16, count))
    top = np.column_stack([x, np.cumsum(rng.standard_normal(count) * rng.uniform(1, 9))])
    top[:, 1] += rng.uniform(3, 20) - top[:, 1].min()
    width = rng.uniform(10, 50)
    corners = [(x[0], 0.0), (x[-1], 0.0), *map(tuple, top[::-1].tolist())]
    radii = np.concatenate(
        [[0, 0], np.where(rng.random(count) < rng.choice([0.5, 0.9, 1.0]), log_uniform(rng, 0.8, 7, count), 0)]
    )
    pieces = synth.round_corners(np.asarray(corners), radii, closed=True, spacing=0.8)
    steps = np.unique(np.concatenate([points[:, 0] for points, _ in pieces]))  # the bottom shares the walls' corners
    pieces[0] = (np.column_stack([steps, np.zeros_like(steps)]), np.tile([0.0, -1.0], (len(steps), 1)))
    patches = []
    for points, out in pieces:
        line, normals = (np.column_stack([part[:, 0], np.zeros(len(part)), part[:, 1]]) for part in (points, out))
        back = line + (0, width, 0)
        patches.append((np.stack([back, line], axis=1), np.stack([normals, normals], axis=1)))
        if points[:, 1].max() > 0 and (np.diff(points[:, 0]) < 0).all():
            for rim, side in ((line, -1), (back, 1)):
                wall = np.stack([rim, rim * (1, 1, 0)], axis=1)[::-side]
                patches.append((wall, np.broadcast_to([0.0, side, 0.0], wall.shape)))
    return synth.from_patches("blended", patches, spacing=0.8)


def _thin(rng: np.random.Generator) -> Solid:
    thin, grows = rng.uniform(0.6, 3), rng.uniform(1, 4)
    return synth.thin_plate(length=rng.uniform(40, 140), width=rng.uniform(30, 80), thin=thin, thick=thin * grows)


def _gear(rng: np.random.Generator) -> Solid:
    root = rng.uniform(20, 34)
    rim, bore, thick = rng.uniform(3, 12), rng.uniform(5, 15), rng.uniform(3, 30)
    return synth.gear(teeth=int(rng.integers(6, 24)), root=root, tip=root + rim, bore=bore, thick=thick)


def _fractal(rng: np.random.Generator) -> Solid:
    return synth.cube_fractal(side=rng.uniform(30, 50))


def _bezier(rng: np.random.Generator) -> Solid:
    return synth.bezier_ridge(side=rng.uniform(60, 140))


def _smooth(rng: np.random.Generator) -> Solid:
    kind = int(rng.integers(4))
    if kind == 0:
        return synth.sphere(radius=rng.uniform(6, 40))
    if kind == 1:
        return synth.torus(radius=rng.uniform(20, 40), tube=rng.uniform(4, 14))
    if kind == 2:
        return synth.plane(side=rng.uniform(40, 150))
    return synth.wavy_sheet(side=rng.uniform(90, 150), amplitude=rng.uniform(1, 6))


_SHARES = {
    _cells: 11,
    _plate_with_cells: 11,
    _turned: 17,
    _prism: 14,
    _rounded_box: 9,
    _blended: 9,
    _ridges: 8,
    _frustum: 3,
    _thin: 5,
    _gear: 3,
    _fractal: 2,
    _bezier: 3,
    _smooth: 5,
}
"""Percent of each family."""
