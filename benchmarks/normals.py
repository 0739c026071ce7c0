"""How right normals of all points are, edgel's and rivals', on scenes whose true normals are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import scenes
from accuracy import MIN_TURN
from rivals import NORMALS

from edgel import metrics
from edgel.edges import EdgeKind

SCENES = ("flange/blue_noise/n0/o0", "flange/blue_noise/n0.1/o0", "flange/blue_noise/n0.3/o0", "flange/pinhole/n0/o0")
NEAR = 1.5  # spacings from a crease within which a plane fit mixes two faces


def run(k: int = 16) -> list[dict[str, Any]]:
    """Median and 95th percentile of the angle to the true normal, degrees, away from creases and beside them."""
    rows = []
    for name in SCENES:
        scene = scenes.load(name)
        known = np.flatnonzero(np.isfinite(scene.normals).all(axis=1) & np.isfinite(scene.cloud.xyz).all(axis=1))
        crease = (scene.edges.kind == int(EdgeKind.CREASE)) & (scene.edges.dihedral >= MIN_TURN)
        apart = metrics.nearest(scene.noise_free[known], scene.edges.positions[crease]).distances[:, 0]
        beside = apart <= NEAR * scene.spacing
        for rival in NORMALS:
            if rival.missing() is not None:
                continue
            normals, _ = rival.run(scene.cloud.xyz[known], k)
            errors = np.degrees(metrics.line_angles(normals, scene.normals[known]))
            row: dict[str, Any] = {"scene": name, "method": rival.name}
            for where, chosen in (("away", ~beside), ("beside", beside)):
                spread = metrics.spread(errors[chosen])
                row |= {f"{where} median": spread.median, f"{where} 95 %": spread.p95}
            rows.append(row)
    return rows
