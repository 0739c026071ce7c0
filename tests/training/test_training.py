"""What training takes from a cloud is what detection computes of it, and a seed decides its examples."""

import numpy as np
import pytest
from training_examples import example, is_landscape

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.scan_lines import scan_line_stretch
from edgel._surface import classify, cloud_statistics, screen
from edgel._surface.features import LEAF, NUM_EVIDENCE, NUM_SCREEN, POINT
from edgel._surface.forest import evaluate, load_forests
from edgel._surface.smoothing import smoothed
from edgel._surface.training import add_context, blend, screen_cloud, screening_features


@pytest.fixture(scope="module", params=[0, 1, 13])  # a whole surface, a view, a relief
def made(request):
    return example(request.param)


def test_an_example_says_of_each_point_what_it_is(made):
    assert made.xyz.shape == (len(made.labels), 3)
    assert np.isfinite(made.xyz).all()
    assert made.labels.shape == (len(made.counts), 2)
    assert 0 < made.labels.any(axis=1).mean() < 0.5
    assert made.counts.mean() > 0.5
    assert made.spacing > 0


def test_the_seed_decides():
    one, same, other = (example(seed) for seed in (3, 3, 4))
    assert one.xyz.tobytes() == same.xyz.tobytes()
    assert one.labels.tobytes() == same.labels.tobytes()
    assert not np.array_equal(one.xyz, other.xyz)


def test_blended_forests_have_the_mean_of_both_logits():
    forests = load_forests()
    rows = np.random.default_rng(0).random((500, len(POINT)), np.float32)
    one, other = forests["crease"], forests["outline"]
    p, q, both = (evaluate(forest, rows) for forest in (one, other, blend(one, other, 0.25)))
    inner = (np.minimum(p, q) > 1e-9) & (np.maximum(p, q) < 1 - 1e-9)
    assert inner.mean() > 0.5
    p, q, both = (np.log(each[inner] / (1 - each[inner])) for each in (p, q, both))
    np.testing.assert_allclose(both, 0.75 * p + 0.25 * q, atol=1e-5)


def test_an_eighth_of_the_examples_are_landscapes():
    landscapes = [seed for seed in range(400) if is_landscape(seed)]
    assert 35 <= len(landscapes) <= 65
    made = example(landscapes[0])
    assert made.spacing == 1.0
    assert np.ptp(made.xyz[:, :2]) > np.ptp(made.xyz[:, 2])


def test_screening_features_are_in_the_layouts(made):
    asked = np.random.default_rng(0).random(len(made.xyz)) < 0.1
    found = screening_features(made.xyz, asked)
    assert found.features.shape == (asked.sum(), NUM_SCREEN)
    assert np.array_equal(np.sort(found.points), np.flatnonzero(asked))
    assert found.leaves.shape == (found.leaf.max() + 1, len(LEAF))
    index = smoothed(build_index(made.xyz))
    values = cloud_statistics(index, scan_line_stretch(index)).features
    for rows, layout in ((found.features, POINT), (found.leaves, LEAF)):
        np.testing.assert_array_equal(rows[:, layout.block("cloud")], np.broadcast_to(values, (len(rows), 8)))
    np.testing.assert_array_equal(np.bincount(found.leaf), found.leaves[:, LEAF.column("leaf.count")])


def test_the_screening_is_that_of_detection(made):
    forests = load_forests()
    index = smoothed(build_index(made.xyz))
    stretch = scan_line_stretch(index)
    wanted = screen(index, cloud_statistics(index, stretch), stretch=stretch).probability
    np.testing.assert_array_equal(screen_cloud(made.xyz, forests).probability[index.order], wanted)
    # Where the leaves let a point through, the forest says of its features what the screening says.
    found = screening_features(made.xyz, np.ones(len(made.xyz), bool))
    let_through = wanted > 0
    said = evaluate(forests["screen"], found.features[let_through])
    np.testing.assert_allclose(said, wanted[let_through], atol=1e-6)


def test_evidence_and_context_are_those_of_detection(made):
    forests = load_forests()
    index = smoothed(build_index(made.xyz))
    stretch = scan_line_stretch(index)
    screening = screen(index, cloud_statistics(index, stretch), stretch=stretch)
    wanted = classify(index, screening)
    asked = np.zeros(len(made.xyz), bool)
    asked[wanted.points] = True
    points, evidence = screen_cloud(made.xyz, forests).gather_evidence(asked)
    assert evidence.features.shape == (len(points), NUM_EVIDENCE)
    crease, outline = (evaluate(forests[f"first {kind}"], evidence.features) for kind in ("crease", "outline"))
    rows = add_context(index.by_point(), points, evidence, crease, outline)
    assert rows.shape == (len(points), len(POINT))
    order = np.argsort(points)
    np.testing.assert_array_equal(points[order], wanted.points)
    np.testing.assert_array_equal(evaluate(forests["crease"], rows)[order], wanted.crease)
    np.testing.assert_array_equal(evaluate(forests["outline"], rows)[order], wanted.outline)
