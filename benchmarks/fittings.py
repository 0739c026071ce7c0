"""The paper's two parts, scanned with as many points as there."""

from __future__ import annotations

from edgel import synth
from edgel.synth import Scene, Solid

NUM_POINTS = {"tee": 647_984, "elbow": 520_915}


def scan(solid: Solid) -> Scene:
    """Scan the tee or the elbow."""
    return synth.scan(solid, num_points=NUM_POINTS[solid.name])
