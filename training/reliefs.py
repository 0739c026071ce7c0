"""Reliefs to train on: free-form surfaces with steps, ridges and grooves that are rounded more or less.

What counts as an edge on a free-form surface is a line along which it bends far more than around it. Where it is
rounded over several spacings no single row of points is the edge, so a band is.
"""

from __future__ import annotations

import numpy as np
from random_scenes import Example

from edgel.synth import poisson_disc

SMOOTH = 0.25  # share of the reliefs that have no edge at all
LEAST_TURN = np.radians(18.0)
SALIENT = 2.5  # times the bend of the ground: what bends less is not asked for
BAND, OPEN = 0.3, 0.7  # of half the rounding's width: the edge's band; and up to where it is left open what is edge
DISC = 0.752  # see edgel.synth.sample


def make(rng: np.random.Generator) -> Example:
    """Make a relief with a spacing of 1."""
    side = np.sqrt(np.exp(rng.uniform(np.log(4000), np.log(14000))))
    ground = _Ground(rng, side)
    curves = [] if rng.random() < SMOOTH else [_Curve(rng, side, ground.bend) for _ in range(rng.integers(1, 7))]
    plane = rng.uniform(0, side, (int(14 * side**2), 2))
    z = ground.height(plane)
    true, open_ = np.zeros(len(plane), bool), np.zeros(len(plane), bool)
    near = np.zeros(len(plane), bool)
    for curve in curves:
        height, edge, between, beside = curve.carve(plane)
        z += height
        true, open_, near = true | edge, open_ | between, near | beside
    places = np.column_stack([plane, z])
    if len(curves) and rng.random() < 0.4:  # finer where there is more to see
        fine = rng.uniform(0.4, 0.7)
        apart = np.flatnonzero(~near)
        kept = np.concatenate(
            [np.flatnonzero(near)[poisson_disc(places[near], fine * DISC)], apart[poisson_disc(places[apart], DISC)]]
        )
    else:
        kept = np.flatnonzero(poisson_disc(places, DISC))
    places, true, open_ = places[kept], true[kept], open_[kept]
    rim = np.minimum(places[:, :2], side - places[:, :2]).min(axis=1)
    labels = np.column_stack([true, rim < 0.45])
    counts = (~open_ | true) & ~((rim >= 0.45) & (rim < 1.2))
    noise = rng.choice([0.0, rng.uniform(0, 0.1), rng.uniform(0.1, 0.4)], p=[0.7, 0.2, 0.1])
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return Example((places + noise * rng.standard_normal(places.shape)) @ turn.T, labels, counts, 1.0)


class _Ground:
    """A sum of waves, nowhere quite flat: on exact planes, a rounded edge is a designer's fillet, and no edge."""

    def __init__(self, rng: np.random.Generator, side: float) -> None:
        count = rng.integers(1, 5)
        length = rng.uniform(0.35, 2.0, count) * side
        angle, self.phase = rng.uniform(0, 2 * np.pi, (2, count))
        self.wave = 2 * np.pi / length * np.stack([np.cos(angle), np.sin(angle)])
        self.amplitude = rng.uniform(0.02, 0.12, count) * length * rng.choice([0.4, 0.7, 1.0])
        self.bend = float((self.amplitude * (2 * np.pi / length) ** 2).sum())  # per spacing

    def height(self, plane: np.ndarray) -> np.ndarray:
        return (self.amplitude * np.sin(plane @ self.wave + self.phase)).sum(axis=1)


class _Curve:
    """A profile along a closed or an open curve: slopes that change at knots, each rounded alike."""

    def __init__(self, rng: np.random.Generator, side: float, bend: float) -> None:
        self.closed = rng.random() < 0.5
        self.centre = rng.uniform(0.15, 0.85, 2) * side
        self.radius = rng.uniform(0.08, 0.35) * side
        self.order, self.phase, self.wobble = rng.integers(1, 5), rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.35)
        self.angle, self.length = rng.uniform(0, np.pi), rng.uniform(0.3, 1.5) * side
        self.round = float(np.exp(rng.uniform(np.log(0.15), np.log(6))))
        gaps = np.exp(rng.uniform(np.log(1.5), np.log(12), rng.integers(1, 5))) + 0.8 * self.round
        self.knots = np.concatenate([[0.0], np.cumsum(gaps)]) - gaps.sum() / 2
        slopes = np.tan(np.radians(rng.uniform(12, 62, len(gaps))) * rng.choice([-1, 1], len(gaps)))
        self.slopes = np.concatenate([[0.0], slopes, [0.0]])
        turn = np.abs(np.diff(np.arctan(self.slopes)))
        self.sharp = (turn > LEAST_TURN) & (turn / (2 * max(self.round, 0.5)) > SALIENT * bend)

    def carve(self, plane: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Height (N,) that the profile adds; which points are edge, which neither, and which near, (N,) bool each."""
        away = self._distance(plane)
        height = np.zeros(len(plane))
        edge, between = np.zeros(len(plane), bool), np.zeros(len(plane), bool)
        for knot, change, before, after, sharp in zip(
            self.knots, np.diff(self.slopes), self.slopes[:-1], self.slopes[1:], self.sharp, strict=True
        ):
            x = (away - knot) / self.round
            height += change * self.round * np.where(x < -1, 0, np.where(x > 1, x, (np.clip(x, -1, 1) + 1) ** 2 / 4))
            along = np.abs(away - knot) * np.sqrt(1 + ((before + after) / 2) ** 2)
            band = max(0.5, min(BAND * self.round, 1.3))
            edge |= (along <= band) & sharp
            between |= along <= max(band if sharp else 0.8, OPEN * self.round)
        return height, edge, between, (away > self.knots[0] - 4) & (away < self.knots[-1] + 4)

    def _distance(self, plane: np.ndarray) -> np.ndarray:
        """Signed distance from the curve, to first order."""
        x, y = (plane - self.centre).T
        if self.closed:
            theta, out = np.arctan2(y, x), np.hypot(x, y)
            radius = self.radius * (1 + self.wobble * np.sin(self.order * theta + self.phase))
            slope = (
                self.radius * self.wobble * self.order * np.cos(self.order * theta + self.phase) / np.maximum(radius, 1)
            )
            return (out - radius) / np.sqrt(1 + slope**2)
        u, v = x * np.cos(self.angle) + y * np.sin(self.angle), y * np.cos(self.angle) - x * np.sin(self.angle)
        k = 2 * np.pi / self.length
        swing = self.wobble * self.length / 4
        return (v - swing * np.sin(k * u + self.phase)) / np.sqrt(1 + (swing * k * np.cos(k * u + self.phase)) ** 2)
