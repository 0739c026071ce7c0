"""Random scenes to train on: shapes, sizes, patterns, views, noise and outliers drawn from a seed. None is a scene of the benchmark."""

from __future__ import annotations

import numpy as np

from edgel import metrics, synth
from edgel.edges import EdgeKind
from edgel.synth import Scene, Solid
from edgel.synth.polyhedra import blocks, ridge

OUTLINE = int(EdgeKind.BOUNDARY | EdgeKind.OCCLUDING | EdgeKind.OCCLUDED)
MIN_TURN = np.radians(25.0)


def scene(seed: int) -> Scene:
    """Make the scene of a seed."""
    rng = np.random.default_rng([seed, 20261123])
    while True:
        try:
            solid = _solid(rng)
            if np.isfinite(solid.area):
                break
        except ValueError:  # cells that touch along an edge only are no surface
            continue
    points = np.exp(rng.uniform(np.log(4000), np.log(22000)))
    noise = [0.0, rng.uniform(0, 0.15), rng.uniform(0.15, 0.5), rng.uniform(0.5, 1.1)][
        rng.choice(4, p=[0.3, 0.2, 0.3, 0.2])
    ]
    degraded = {
        "noise": noise,
        "outliers": [0.0, 0.01, 0.05][rng.choice(3, p=[0.75, 0.15, 0.1])],
        "seed": int(rng.integers(2**31)),
    }
    if rng.random() < 0.35:
        direction = rng.standard_normal(3)
        projection = synth.PROJECTIONS[rng.integers(3)]
        spacing = np.sqrt(solid.area / 2.2 / points)
        return synth.view(
            solid, projection=projection, spacing=spacing, direction=direction, roll=rng.uniform(-3, 3), **degraded
        )
    pattern = rng.choice(synth.PATTERNS, p=[0.17, 0.17, 0.14, 0.14, 0.38])
    return synth.sample(solid, pattern=str(pattern), spacing=np.sqrt(solid.area / points), **degraded)


def labels(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Which finite points are edge points, (M, 2) bool for crease and outline, and which count, (M,) bool.

    A crease point is one whose cell among all points (by where they lie without noise) the crease runs through: it is
    nearest to some stretch of it. So edges are one point thick and without gaps, whatever the pattern.
    """
    rows = np.flatnonzero(np.isfinite(scene.cloud.xyz).all(axis=1))
    true, counts = np.zeros((len(rows), 2), bool), np.ones(len(rows), bool)
    places = scene.noise_free[rows]
    inlier = ~scene.outlier[rows]
    organized = scene.cloud.is_organized
    kinds = [EdgeKind.CREASE] if organized else [EdgeKind.CREASE, EdgeKind.BOUNDARY]
    for kind in kinds:
        edges = scene.edges.take((scene.edges.kind & int(kind)) > 0)
        if len(edges) == 0:
            continue
        strong = np.nan_to_num(edges.dihedral, nan=np.pi) >= MIN_TURN
        here = np.flatnonzero(inlier)
        for wanted, mark in ((True, true[:, int(kind == EdgeKind.BOUNDARY)]), (False, None)):
            at = edges.positions[strong == wanted]
            if len(at) == 0:
                continue
            near = metrics.nearest(at, places[here])
            own = near.distances[:, 0] <= (1.5 if wanted else 3) * scene.spacing
            found = here[near.rows[own, 0]]
            if mark is not None:
                mark[found] = True
            else:
                back = metrics.nearest(places, at).distances[:, 0]
                counts &= ~(back < 1.5 * scene.spacing)
    counts |= true.any(axis=1)
    if organized:
        true[:, 1] = (scene.point_kind[rows] & OUTLINE) > 0
    true[~inlier] = False
    return true, counts


def _solid(rng: np.random.Generator) -> Solid:
    kinds = (_cells, _plate_with_cells, _turned, _prism, _ridges, _frustum, _thin, _gear, _fractal, _bezier, _smooth)
    return kinds[rng.choice(len(kinds), p=_SHARES)](rng)


_SHARES = np.array([12, 12, 22, 18, 9, 4, 6, 4, 3, 4, 6]) / 100


def _spread(rng: np.random.Generator, low: float, high: float, *size: int) -> np.ndarray:
    """Draw so that every doubling is as likely as the next."""
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


def _ticks(rng: np.random.Generator, count: int, low: float, high: float) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(_spread(rng, low, high, count))])


def _cells(rng: np.random.Generator) -> Solid:
    shape = rng.integers(1, 5, 3)
    filled = rng.random(shape) < rng.uniform(0.4, 1)
    if not filled.any():
        raise ValueError("filled: nothing")
    low = _spread(rng, 0.6, 6, 1)[0]
    return blocks("cells", filled, *(_ticks(rng, n, low, low * 8) for n in shape), spacing=0.8)


def _plate_with_cells(rng: np.random.Generator) -> Solid:
    shape = (*rng.integers(3, 9, 2), 3)
    filled = rng.random(shape) < rng.uniform(0.2, 0.5)
    filled[:, :, 0] = True
    filled[:, :, 2] &= filled[:, :, 1]
    return blocks("plate_with_cells", filled, *(_ticks(rng, n, 0.7, 12) for n in shape), spacing=0.8)


def _frustum(rng: np.random.Generator) -> Solid:
    bottom, top = rng.uniform(12, 45, 2)
    return synth.frustum(sides=int(rng.integers(3, 12)), bottom=bottom, top=top, height=rng.uniform(5, 60))


def _ridges(rng: np.random.Generator) -> Solid:
    count = int(rng.integers(3, 16))
    x = np.cumsum(rng.uniform(2, 14, count))
    z = np.cumsum(rng.standard_normal(count) * rng.uniform(1, 12))
    profile = np.column_stack([x, z - z.min()])
    return ridge("ridges", profile, width=rng.uniform(15, 60), base=rng.uniform(2, 20), spacing=0.8)


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
    return synth.prism(corners.tolist(), height=float(_spread(rng, 1, 40, 1)[0]), fillets=_fillets(rng, count))


def _fillets(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.where(rng.random(count) < rng.choice([0.0, 0.5, 0.8, 1.0]), _spread(rng, 1, 7, count), 0)


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
