"""The instrument itself: the truth scores 1, nothing scores 0, and what lies between scores what arithmetic says."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree

from edgel import EdgeKind, metrics

LINE = np.c_[np.arange(100.0), np.zeros((100, 2))]  # an edge of 100 points, one spacing apart


def test_the_truth_scores_one():
    labels = np.random.default_rng(0).random(1000) < 0.1
    scores = metrics.score_labels(labels, labels)
    assert (scores.precision, scores.recall, scores.f1, scores.mcc, scores.iou) == (1, 1, 1, 1, 1)
    assert scores.false_per_thousand == 0
    assert metrics.match(LINE, LINE, 0.0).f1 == 1
    assert metrics.distances(LINE, LINE) == metrics.Distances(0, 0, 0)


def test_nothing_scores_zero():
    labels = np.random.default_rng(0).random(1000) < 0.1
    scores = metrics.score_labels(np.zeros(1000, bool), labels)
    assert (scores.precision, scores.recall, scores.f1, scores.mcc, scores.iou) == (0, 0, 0, 0, 0)
    for predicted, truth in ((LINE[:0], LINE), (LINE, LINE[:0]), (LINE[:0], LINE[:0])):
        found = metrics.match(predicted, truth, 1.0)
        assert (found.precision, found.recall, found.f1) == (0, 0, 0)
        assert metrics.distances(predicted, truth).chamfer == math.inf


@pytest.mark.parametrize(("tolerance", "expected"), [(0.5, 0.0), (0.999, 0.0), (1.0, 1.0), (1.5, 1.0)])
def test_a_shift_across_the_edge_by_one_spacing(tolerance, expected):
    shifted = LINE + [0, 1, 0]
    found = metrics.match(shifted, LINE, tolerance)
    assert (found.precision, found.recall, found.f1) == (expected, expected, expected)
    assert metrics.distances(shifted, LINE) == metrics.Distances(chamfer=2, hausdorff=1, mean_hausdorff=1)


def test_a_shift_along_the_edge_by_one_spacing():
    shifted = LINE + [1, 0, 0]  # 99 of 100 fall on true points
    found = metrics.match(shifted, LINE, 0.0)
    assert (found.precision, found.recall) == (0.99, 0.99)
    assert metrics.distances(shifted, LINE) == metrics.Distances(chamfer=0.02, hausdorff=1, mean_hausdorff=0.01)


def test_thickening_lowers_precision_at_zero_tolerance_only():
    grid = np.stack(np.meshgrid(np.arange(100.0), np.arange(9.0), [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    truth = grid[:, 1] == 4
    thick = np.abs(grid[:, 1] - 4) <= 1
    scores = metrics.score_labels(thick, truth)
    assert (scores.precision, scores.recall, scores.iou) == (1 / 3, 1, 1 / 3)
    assert scores.f1 == pytest.approx(0.5)
    assert scores.false_per_thousand == 1000 * 200 / 800
    assert metrics.match(grid[thick], grid[truth], 0.5).precision == 1 / 3
    assert metrics.match(grid[thick], grid[truth], 1.0).precision == 1


def test_ignored_points_count_neither_way():
    truth = np.array([1, 1, 0, 0, 2, 2])
    scores = metrics.score_labels(np.array([True, False, True, False, True, False]), truth)
    assert (scores.tp, scores.fp, scores.fn, scores.tn) == (1, 1, 1, 1)


@given(st.integers(0, 2**32 - 1))
def test_formulas_are_those_of_the_textbook(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 200))
    truth, predicted = rng.random(n) < rng.random(), rng.random(n) < rng.random()
    scores = metrics.score_labels(predicted, truth)
    assert scores.tp + scores.fp + scores.fn + scores.tn == n
    if truth.any() and predicted.any():
        p, r = truth[predicted].mean(), predicted[truth].mean()
        assert scores.precision == pytest.approx(p)
        assert scores.recall == pytest.approx(r)
        assert scores.f1 == pytest.approx(2 * p * r / (p + r) if p + r else 0)
        assert scores.iou == pytest.approx((truth & predicted).sum() / (truth | predicted).sum())
    if 0 < truth.sum() < n and 0 < predicted.sum() < n:
        assert scores.mcc == pytest.approx(np.corrcoef(truth, predicted)[0, 1], abs=1e-9)


@given(st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_distances_are_those_of_scipy(seed, tolerance):
    rng = np.random.default_rng(seed)
    a, b = rng.random((int(rng.integers(1, 50)), 3)), rng.random((int(rng.integers(1, 50)), 3))
    ab, ba = KDTree(b).query(a)[0], KDTree(a).query(b)[0]
    found = metrics.distances(a, b)
    assert found.chamfer == pytest.approx(ab.mean() + ba.mean())
    assert found.hausdorff == pytest.approx(max(ab.max(), ba.max()))
    assert found.mean_hausdorff == pytest.approx(max(ab.mean(), ba.mean()))
    matched = metrics.match(a, b, tolerance)
    assert matched.precision == pytest.approx((ab <= tolerance).mean())
    assert matched.recall == pytest.approx((ba <= tolerance).mean())


def test_angles_between_lines_and_faces():
    x, y, z = np.eye(3)
    tilted = np.array([math.cos(0.1), math.sin(0.1), 0])
    np.testing.assert_allclose(
        metrics.line_angles(np.array([x, x, x]), np.array([-x, y, tilted])), [0, math.pi / 2, 0.1]
    )
    truth = np.array([[x, y]] * 3)
    predicted = np.array([[x, y], [-y, tilted], [z, [np.nan] * 3]])
    errors = metrics.face_angles(predicted, truth)
    np.testing.assert_allclose(errors[0], [0, 0])
    np.testing.assert_allclose(errors[1], [0.1, 0])
    assert np.isnan(errors[2]).any()


def test_spread_of_errors():
    found = metrics.spread(np.r_[np.arange(101.0), np.nan])
    assert (found.median, found.p95) == (50, 95)
    assert math.isnan(metrics.spread(np.empty(0)).median)


def test_confusion_of_kinds():
    b, c = int(EdgeKind.BOUNDARY), int(EdgeKind.CREASE)
    truth = np.array([0, b, b, c, b | c, c, 0], np.uint8)
    predicted = np.array([0, b, c, c, c, 0, b], np.uint8)
    kinds = [0, *map(int, EdgeKind)]
    table = metrics.kind_confusion(predicted, truth)
    at = {k: kinds.index(k) for k in (0, b, c)}
    assert table[at[0], at[0]] == 1
    assert table[at[b], at[b]] == 1
    assert table[at[b], at[c]] == 1  # called a crease; the point that is both is no confusion
    assert table[at[c], at[c]] == 2
    assert table[at[c], at[0]] == 1
    assert table[at[0], at[b]] == 1


def test_labels_of_another_shape_are_refused():
    with pytest.raises(ValueError, match="predicted"):
        metrics.score_labels(np.zeros(3, bool), np.zeros(4, bool))
