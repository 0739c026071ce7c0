"""Where the line is drawn between edges and none."""

import numpy as np
import pytest

from edgel._neighbors.kdtree import build_index
from edgel._surface.line import EVEN, STRONG, SURE, VAGUE, even_probability, histogram, strength_of, strengths


def chances(sharpness, rng):
    return 1 / (1 + np.exp(-sharpness * rng.normal(-2, 2, 3000)))


@pytest.mark.parametrize("sharpness", [0.5, 1, 4])
def test_one_half_is_where_the_expected_f1_is_greatest(sharpness):
    chance = chances(sharpness, np.random.default_rng(0))
    scores = [2 * chance[chance >= t].sum() / ((chance >= t).sum() + chance.sum()) for t in chance]
    even = even_probability(histogram(chance))
    assert even == pytest.approx(np.clip(chance[np.argmax(scores)], *EVEN), abs=0.011)
    assert strength_of(np.array([0, even, 1]), even) == pytest.approx([0, 0.5, 1])


def test_a_cloud_without_edges_has_none():
    points = np.random.default_rng(0).random((10, 3))
    assert (strengths(build_index(points), np.arange(10), np.full(10, 0.05)) < 0.5).all()


def naive(xyz, points, probability):
    """Which points lie above the line, word by word."""
    even = even_probability(histogram(probability))
    chance = dict(zip(points.tolist(), probability.tolist(), strict=True))
    near = {p: np.argsort(((xyz - xyz[p]) ** 2).sum(axis=1), kind="stable")[:9].tolist() for p in chance}
    on = {p for p in chance if chance[p] >= even}
    chains, left = [], set(on)
    while left:
        chain, ahead = set(), {left.pop()}
        while ahead:
            p = ahead.pop()
            chain.add(p)
            linked = {q for q in left if q in near[p] or p in near[q]}
            left -= linked
            ahead |= linked
        chains.append(chain)
    chained = {p for chain in chains if any(chance[q] >= STRONG for q in chain) for p in chain}
    share = min(max((even - VAGUE[0]) / (VAGUE[1] - VAGUE[0]), 0), 1)
    thick = {p for p in chained if chance[p] >= even + share * (SURE - even)}
    likeliest = {p for p in chained if chance[p] >= max(chance.get(q, 0) for q in near[p])}
    return {p for p in chance if chance[p] >= SURE} | thick | likeliest


@pytest.mark.parametrize("sharpness", [0.35, 0.45, 0.7])
def test_faint_points_count_along_an_edge(sharpness):
    rng = np.random.default_rng(int(100 * sharpness))
    xyz, points = rng.random((1200, 3)) * [1, 1, 0.02], np.sort(rng.permutation(1200)[:900])
    probability = 0.62 / (1 + np.exp(-sharpness * rng.normal(-2, 6, 900)))
    assert EVEN[0] <= even_probability(histogram(probability)) < SURE
    found = strengths(build_index(xyz), points, probability)
    assert set(points[found >= 0.5].tolist()) == naive(xyz, points, probability)
    sure = probability >= SURE
    assert 0 < sure.sum() < (found >= 0.5).sum() < (probability >= even_probability(histogram(probability))).sum()


def test_where_edges_are_plain_each_point_stands_for_itself():
    rng = np.random.default_rng(3)
    chance = chances(8, rng)
    index = build_index(rng.random((3000, 3)))
    assert even_probability(histogram(chance)) >= SURE
    np.testing.assert_array_equal(
        strengths(index, np.arange(3000), chance), strength_of(chance, even_probability(histogram(chance)))
    )
