"""Examples to train on, each drawn from a seed: shapes, sizes, patterns, views, noise and outliers."""

from __future__ import annotations

import landscapes
import numpy as np
import random_scenes
import reliefs
from random_scenes import Example

RELIEFS, LANDSCAPES = 0.1, 0.12  # share of the examples


def example(seed: int) -> Example:
    """Make the example of a seed."""
    rng, drawn = _draw(seed)
    kind = reliefs if drawn < RELIEFS else landscapes if drawn < RELIEFS + LANDSCAPES else random_scenes
    return kind.make(rng)


def is_landscape(seed: int) -> bool:
    """Say whether the example of a seed is a landscape."""
    return RELIEFS <= _draw(seed)[1] < RELIEFS + LANDSCAPES


def _draw(seed: int) -> tuple[np.random.Generator, float]:
    rng = np.random.default_rng([seed, 20261125])
    return rng, rng.random()
