"""Many clouds at once: the answers of one by one, failures by number; and probabilities of every point."""

import functools

import numpy as np
import pytest

import edgel


def roof(ridge: float, seed: int = 0) -> np.ndarray:
    x, y = np.random.default_rng(seed).uniform(0, 20, (2, 900))
    return np.column_stack([x, y, -abs(x - ridge)])


def same(one: edgel.Edges, other: edgel.Edges) -> bool:
    names = ("index", "kind", "strength", "position", "normals", "angle")
    return all(np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True) for name in names)


@pytest.mark.parametrize("threads", ["1", "3"])
def test_many_are_found_as_one_by_one(monkeypatch, threads):
    monkeypatch.setenv("EDGEL_NUM_THREADS", threads)
    clouds = [roof(8 + number / 4, number) for number in range(8)]
    found = edgel.detect_many(cloud for cloud in clouds)
    assert len(found) == len(clouds)
    assert found.failures == {}
    for cloud, edges in zip(clouds, found.edges, strict=True):
        assert edges is not None
        assert len(edges) > 0
        assert same(edges, edgel.detect(cloud))


def test_one_that_fails_stops_no_other():
    clouds = [roof(9), np.zeros((2, 3)), roof(10), "no cloud"]
    found = edgel.detect_many(clouds)
    assert [edges is None for edges in found.edges] == [False, True, False, True]
    assert list(found.failures) == [1, 3]
    assert "at least 3 points" in str(found.failures[1])


def test_what_is_asked_of_each_can_be_told():
    found = edgel.detect_many([roof(9)], find=functools.partial(edgel.detect, kinds="crease")).edges[0]
    assert found is not None
    assert set(found.kind) == {edgel.EdgeKind.CREASE}


def test_what_the_iterable_raises_is_raised():
    def clouds():
        yield roof(9)
        raise OSError("no more files")

    with pytest.raises(OSError, match="no more files"):
        edgel.detect_many(clouds())


def test_probabilities_are_of_every_point_and_below_any_threshold():
    xyz = np.concatenate([roof(9, 1), [[np.nan, 0, 0]]])
    found = edgel.probabilities(xyz)
    assert found.shape == (901, 2)
    assert np.isnan(found[-1]).all()
    assert ((found[:-1] >= 0) & (found[:-1] <= 1)).all()
    crease, boundary = found[:-1].T
    assert np.abs(xyz[np.argsort(crease)[-9:], 0] - 9).max() < 0.7
    rim = np.abs(xyz[:-1, :2] - 10).max(axis=1)
    assert rim[np.argsort(boundary)[-20:]].min() > 9
    # Those whose strength is below one half are told apart, too.
    faint = np.setdiff1d(np.arange(900), edgel.detect(xyz, method="surface").index)
    assert len(np.unique(crease[faint])) > 20


def test_probabilities_do_not_depend_on_the_order():
    xyz = roof(9, 2)
    order = np.random.default_rng(3).permutation(len(xyz))
    np.testing.assert_array_equal(edgel.probabilities(xyz[order]), edgel.probabilities(xyz)[order])
