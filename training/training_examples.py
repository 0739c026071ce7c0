"""Examples to train on, each drawn from a seed: shapes, sizes, patterns, views, noise and outliers."""

from __future__ import annotations

import numpy as np
import random_scenes
import reliefs
from random_scenes import Example

RELIEFS = 0.1  # share of the examples


def example(seed: int) -> Example:
    """Make the example of a seed."""
    rng = np.random.default_rng([seed, 20261125])
    return reliefs.make(rng) if rng.random() < RELIEFS else random_scenes.make(rng)
