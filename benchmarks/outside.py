"""Convexity of creases on closed solids with ``orient="outward"``, and the bias of the position on rims of holes."""

from __future__ import annotations

from typing import Any

import numpy as np
import scenes
from accuracy import MIN_TURN

import edgel
from edgel import metrics, synth
from edgel.edges import EdgeKind

REACH = 1.5  # spacings: a crease point farther from every true crease is false, and counted elsewhere
CLOSED = ("frustum", "stepped_block", "cube_fractal", "wedge_fan", "thin_plate", "gear")
NOISES = (0, 0.1, 0.3)
RADII = (3.6, 7.0, 14.0)
SEEDS = 4


def convexity() -> list[dict[str, Any]]:
    """Of which share of the true creases found it is told whether they are convex, and of which share rightly."""
    rows = []
    for shape in CLOSED:
        for noise in NOISES:
            scene = scenes.load(f"{shape}/blue_noise/n{noise:g}/o0")
            found = edgel.detect(scene.cloud, kinds=EdgeKind.CREASE, orient="outward")
            true = scene.edges.take(np.nan_to_num(scene.edges.dihedral) >= MIN_TURN)
            nearest = metrics.nearest(found.position, true.positions)
            here = nearest.distances[:, 0] < REACH * scene.spacing
            convex, wanted = found.convex[here], true.convex[nearest.points[here, 0]]
            told = convex != 0
            right = float(np.mean(convex[told] == wanted[told])) if told.any() else float("nan")
            rows.append({"shape": shape, "noise": noise, "told": float(np.mean(told)), "right": right})
    return rows


def rims() -> list[dict[str, Any]]:
    """Mean and spread of how far positions on rims of holes lie inside (negative) or outside, and over what is stated."""
    rows = []
    for radius in RADII:
        for noise in NOISES:
            away, stated = [], []
            for seed in range(SEEDS):
                solid = synth.lathe([(radius, 0), (radius + 14, 0), (radius + 14, 12), (radius, 12)], spacing=1.0)
                scene = synth.sample(solid, pattern="blue_noise", spacing=1.0, noise=noise, seed=seed)
                found = edgel.detect(scene.cloud, kinds=EdgeKind.CREASE)
                off = np.hypot(found.position[:, 0], found.position[:, 1]) - radius
                rim = np.abs(off) < REACH
                away.append(off[rim])
                stated.append(found.position_std[rim])
            off, std = np.concatenate(away), np.concatenate(stated)
            figures = {"bias": float(off.mean()), "spread": float(off.std()), "stated": float(np.nanmedian(std))}
            rows.append({"radius": radius, "noise": noise} | figures)
    return rows
