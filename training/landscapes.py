"""Landscapes to train on, as seen from the air: ground, roofs, boxes on them, walls that few beams reach, and trees.

Roofs meet in creases, end in steps of height, and are sampled along lines in strips that overlap. Leaves have no edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from random_scenes import MIN_TURN, OWN, Example
from random_solids import log_uniform

from edgel import metrics
from edgel.synth import poisson_disc

FINE = 0.125  # spacings between the places at which heights are compared
STEP, NO_STEP = 1.5, 0.5  # spacings of height: from this on the surface ends there; below this it goes on
GROWTH = 1.5  # spacings around trees within which the ground's holes count neither way
DISC = 0.752  # see edgel.synth.sample


def make(rng: np.random.Generator) -> Example:
    """Make a landscape with a spacing of 1."""
    side = float(np.sqrt(log_uniform(rng, 4000, 14000)))
    land = _Land(rng, side)
    trees = [_Tree(rng, side) for _ in range(rng.integers(0, 9))]
    plane = _beams(rng, side)
    strip = rng.uniform(-0.15, 0.15, 3)  # of height, by which flights disagree
    places = np.column_stack([plane[:, :2], land.height(plane[:, :2])])
    cover = np.zeros(len(places), bool)
    shaded = np.zeros(len(places), bool)
    for tree in trees:
        near = np.hypot(*(plane[:, :2] - tree.centre).T)
        shaded |= near < tree.radius + GROWTH
        cover |= (near < tree.radius) & (rng.random(len(plane)) < tree.density)
    leaves = [tree.leaves(rng, land) for tree in trees]
    edges = land.edges()
    walls, hidden = edges.walls(rng)
    surface = places[~cover]
    true, counts = _labels(surface, edges, hidden, side, land)
    counts &= ~shaded[~cover] | true.any(axis=1)
    xyz = np.concatenate([surface, walls, *leaves])
    rest = len(xyz) - len(surface)
    true = np.concatenate([true, np.zeros((rest, 2), bool)])
    of_leaves = np.arange(rest) >= len(walls)
    counts = np.concatenate([counts, of_leaves])
    noise = rng.choice([0.0, rng.uniform(0, 0.1), rng.uniform(0.1, 0.4)], p=[0.2, 0.5, 0.3])
    shift = np.zeros(len(xyz))
    shift[: len(surface)] = strip[plane[~cover, 2].astype(int)]
    moved = xyz + noise * rng.standard_normal(xyz.shape) + shift[:, None] * [0, 0, 1]
    return Example(moved, true, counts, 1.0)


def _beams(rng: np.random.Generator, side: float) -> np.ndarray:
    """Where beams meet the plane, and the strip that each belongs to, (N, 3): one in a square of 1 in all."""
    if rng.random() < 0.3:
        tried = rng.uniform(0, side, (int(14 * side**2), 2))
        kept = tried[poisson_disc(np.column_stack([tried, np.zeros(len(tried))]), DISC)]
        return np.column_stack([kept, np.zeros(len(kept))])
    strips = rng.integers(1, 4)
    parts = []
    for strip in range(strips):
        between = np.sqrt(strips * log_uniform(rng, 0.7, 4))
        along = strips / between
        turn, jitter = rng.uniform(0, np.pi), rng.uniform(0, 0.3)
        half = side * 0.75
        u, v = np.meshgrid(np.arange(-half, half, along), np.arange(-half, half, between))
        v = v + rng.uniform(0, between) + rng.uniform(0, 1) * (u % along)
        flat = np.column_stack([u.ravel(), v.ravel()]) + jitter * min(along, between) * rng.standard_normal((u.size, 2))
        flat = flat @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]] + side / 2
        inside = ((flat >= 0) & (flat <= side)).all(axis=1)
        parts.append(np.column_stack([flat[inside], np.full(inside.sum(), strip)]))
    return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class _House:
    """A roof over a turned rectangle: flat, of one slope, gabled, hipped or saw-toothed."""

    centre: np.ndarray
    half: np.ndarray
    turn: float
    height: float
    slope: float
    kind: int
    period: float

    def roof(self, plane: np.ndarray) -> np.ndarray:
        """Height of the roof (N,); -inf beside it."""
        x, y = (plane - self.centre).T
        u, v = x * np.cos(self.turn) + y * np.sin(self.turn), y * np.cos(self.turn) - x * np.sin(self.turn)
        a, b = self.half
        tooth = np.abs((u / self.period) % 2 - 1) * self.period
        rise = (np.zeros_like(u), u + a, b - np.abs(v), np.minimum(b - np.abs(v), a - np.abs(u)), tooth)[self.kind]
        return np.where((np.abs(u) <= a) & (np.abs(v) <= b), self.height + self.slope * rise, -np.inf)


class _Land:
    """Heights over the plane: the highest of the ground and all roofs."""

    def __init__(self, rng: np.random.Generator, side: float) -> None:
        self.side = side
        self.tilt = rng.uniform(-0.15, 0.15, 2)
        self.wave, self.phase = rng.standard_normal((2, 3)) * 6 / side, rng.uniform(0, 2 * np.pi, 3)
        self.swell = rng.uniform(0, 0.02) * side
        self.houses: list[_House] = []
        for _ in range(rng.integers(1, 9)):
            self._build(rng, log_uniform(rng, 8, 45, 2), log_uniform(rng, 4, 40))
        for _ in range(rng.integers(0, 7)):  # chimneys, dormers, cars
            self._build(rng, log_uniform(rng, 2.5, 10, 2), rng.uniform(2, 8))

    def _build(self, rng: np.random.Generator, size: np.ndarray, above: float) -> None:
        centre = rng.uniform(0, self.side, 2)
        base = self.height(centre[None])[0]
        turn = rng.uniform(0, np.pi) if not self.houses or rng.random() < 0.5 else self.houses[-1].turn
        slope, period = np.tan(np.radians(rng.uniform(8, 55))), log_uniform(rng, 5, 20)
        self.houses.append(_House(centre, size / 2, turn, base + above, slope, int(rng.integers(5)), period))

    def height(self, plane: np.ndarray) -> np.ndarray:
        ground = plane @ self.tilt + self.swell * np.sin(plane @ self.wave + self.phase).sum(axis=1)
        return np.max([ground, *(house.roof(plane) for house in self.houses)], axis=0)

    def edges(self) -> _LandEdges:
        """Compare each place of a fine grid with those beyond the edges of its cell."""
        axis = np.arange(FINE / 2, self.side, FINE)
        z = self.height(np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)).reshape(len(axis), -1)
        parts = []
        for turned in (False, True):
            h = z.T if turned else z
            # Planes on both sides, each from two places of its own, continued to the middle between the inner ones.
            before, after = h[1:-2] - h[:-3], h[3:] - h[2:-1]
            low, high = h[1:-2] + before / 2, h[2:-1] - after / 2
            beside = np.gradient(h, axis=1)
            first = np.stack([before, beside[:-3], np.full_like(before, FINE)], axis=-1)
            second = np.stack([after, beside[3:], np.full_like(after, FINE)], axis=-1)
            cosine = (first * second).sum(-1) / np.linalg.norm(first, axis=-1) / np.linalg.norm(second, axis=-1)
            found = (np.abs(high - low) > NO_STEP) | (cosine < np.cos(MIN_TURN / 2))
            i, j = np.nonzero(found)
            at = np.column_stack([(i + 2) * FINE, axis[j]])
            facing = np.column_stack([np.sign(low - high)[i, j], np.zeros(len(i))])
            parts.append(
                _LandEdges(
                    at[:, ::-1] if turned else at,
                    np.minimum(low, high)[i, j],
                    np.maximum(low, high)[i, j],
                    np.arccos(np.clip(cosine[i, j], -1, 1)),
                    facing[:, ::-1] if turned else facing,
                )
            )
        return _LandEdges(
            *(np.concatenate(columns) for columns in zip(*(vars(p).values() for p in parts), strict=True))
        )


@dataclass(frozen=True, eq=False)
class _LandEdges:
    """Where heights step or slopes change.

    Attributes
    ----------
    at : (E, 2) float64
    low, high : (E,) float64
        Heights on both sides.
    turn : (E,) float64
        Angle between them.
    facing : (E, 2) float64
        Direction in which a step goes down.
    """

    at: np.ndarray
    low: np.ndarray
    high: np.ndarray
    turn: np.ndarray
    facing: np.ndarray

    @property
    def step(self) -> np.ndarray:
        return self.high - self.low

    def walls(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Points on walls (M, 3) that a slanted beam reaches, and which steps have such a wall, (E,) bool."""
        beam, density = rng.uniform(0, 2 * np.pi), rng.choice([0.0, rng.uniform(0.02, 0.5)])
        seen = (self.facing @ [np.cos(beam), np.sin(beam)] > 0) & (self.step > STEP) & (density > 0)
        # Steps aslant are met by both passes over the grid, so that each counts for its share of the wall.
        which = np.repeat(np.arange(len(self.at)), rng.poisson(np.where(seen, density * self.step * FINE, 0)))
        z = self.low[which] + rng.random(len(which)) * self.step[which]
        return np.column_stack([self.at[which], z]), seen


class _Tree:
    """Leaves all through a crown, or only over it."""

    def __init__(self, rng: np.random.Generator, side: float) -> None:
        self.centre = rng.uniform(0, side, 2)
        self.radius = log_uniform(rng, 2, 20)
        self.tall = self.radius * rng.uniform(0.4, 2)
        self.trunk = rng.choice([0.0, rng.uniform(0, 20)])
        self.density = rng.uniform(0.2, 1)  # share of the beams that it stops
        self.returns = rng.uniform(0.7, 2.5)
        self.deep = rng.choice([rng.uniform(0.02, 0.2), rng.uniform(0.3, 1)])  # share of the crown that beams reach
        self.lumps = rng.uniform(0, 0.4)

    def leaves(self, rng: np.random.Generator, land: _Land) -> np.ndarray:
        """Places of the leaves that beams meet, (M, 3)."""
        count = rng.poisson(np.pi * self.radius**2 * self.density * self.returns)
        turn, away = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.random(count))
        flat = self.centre + (self.radius * away * np.stack([np.cos(turn), np.sin(turn)])).T
        inside = ((flat >= 0) & (flat <= land.side)).all(axis=1)
        dome = np.sqrt(1 - away**2) * (1 + self.lumps * np.sin(3 * flat[:, 0]) * np.sin(3 * flat[:, 1] + 1))
        z = land.height(self.centre[None])[0] + self.trunk + self.tall * dome * (1 - self.deep * rng.random(count))
        return np.column_stack([flat, z])[inside]


def _labels(
    xyz: np.ndarray, edges: _LandEdges, walled: np.ndarray, side: float, land: _Land
) -> tuple[np.ndarray, np.ndarray]:
    """Which points of the surface lie on creases and where it ends, (N, 2) bool, and which count, (N,) bool."""
    true, counts = np.zeros((len(xyz), 2), bool), np.ones(len(xyz), bool)
    step = edges.step > STEP
    crease = (edges.step < NO_STEP) & (edges.turn > MIN_TURN)
    rim = np.arange(0, side, 0.25)
    along = np.concatenate(
        [
            np.column_stack(pair)
            for fixed in (np.full_like(rim, 0.0), np.full_like(rim, side))
            for pair in ((rim, fixed), (fixed, rim))
        ]
    )
    low, high = (np.column_stack([edges.at, z]) for z in (edges.low, edges.high))
    ends = np.concatenate([high[step], low[step & ~walled], np.column_stack([along, land.height(along)])])
    for column, positions in enumerate((high[crease], ends)):
        if len(positions):
            near = metrics.nearest(positions, xyz)
            true[near.points[near.distances[:, 0] <= OWN, 0], column] = True
    vague = np.concatenate([high[~step & ~crease], low[~step & ~crease], low[step & walled]])
    if len(vague):
        counts &= metrics.nearest(xyz, vague).distances[:, 0] >= OWN
    return true, counts | true.any(axis=1)
