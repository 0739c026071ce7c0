"""Thin walls that a crop has cut have no creases there, and what a part has stays."""

import numpy as np

import edgel
from edgel import EdgeKind, synth
from edgel._neighbors.kdtree import build_index
from edgel.matching._cut_walls import without_cut_walls


def test_both_walls_of_a_cut_plate_are_no_crease():
    """Two sheets 2.2 spacings apart without anything between their ends, and a cube beside them."""
    rng = np.random.default_rng(0)
    parts = []
    for height in (0.0, 2.2):
        sheet = np.c_[rng.uniform(0, 1, (12_000, 2)) * [50, 40], np.full(12_000, height)]
        parts.append(sheet[synth.poisson_disc(sheet, 0.752)])
    cube, axis = rng.uniform(-1, 1, (20_000, 3)), rng.integers(3, size=20_000)
    rows = np.arange(len(cube))
    cube[rows, axis] = np.sign(cube[rows, axis])
    cube = 9 * cube
    parts.append(cube[synth.poisson_disc(cube, 0.752)] + [90, 20, 0])
    places = np.concatenate(parts)
    places += rng.normal(0, 0.1, places.shape)
    edges = edgel.detect(places, orient="outward")
    left = without_cut_walls(edges, places, build_index(places), 1.0)

    def count(found):
        crease = (found.kind & EdgeKind.CREASE) > 0
        return np.bincount(found.position[crease, 0] > 60, minlength=2)

    before, after = count(edges), count(left)
    assert before[0] > 150
    assert after[0] < 0.5 * before[0]
    assert after[1] > 0.9 * before[1]
