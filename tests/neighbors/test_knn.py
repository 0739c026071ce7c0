import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial import KDTree

from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import at_places, at_points, every_place, every_point

# Few different coordinates, so that ties and duplicates are the rule.
LATTICE = arrays(np.float64, st.tuples(st.integers(1, 60), st.just(3)), elements=st.integers(-3, 3).map(float))


def cloud(kind, n=3000, seed=0):
    rng = np.random.default_rng(seed)
    if kind == "uniform":
        return rng.random((n, 3))
    if kind == "surface":
        xy = rng.random((n, 2)) * 10
        return np.c_[xy, np.sin(xy).sum(axis=1)]
    if kind == "lidar":  # density falls with the square of the range
        r, a = 1 / rng.uniform(0.01, 1, n), rng.uniform(0, 2 * np.pi, n)
        return np.c_[r * np.cos(a), r * np.sin(a), rng.normal(0, 0.1, n)]
    if kind == "utm":
        return rng.random((n, 3)) * [1, 1, 0.1] + [5e5, 5e6, 300]
    if kind == "outlier":
        return np.r_[rng.random((n - 1, 3)), [[1e9, -1e9, 1e9]]]
    if kind == "duplicates":
        return np.repeat(rng.random((n // 10, 3)), 10, axis=0)
    if kind == "line":
        return np.c_[rng.random(n), np.zeros(n), np.zeros(n)]
    raise ValueError(kind)


KINDS = ["uniform", "surface", "lidar", "utm", "outlier", "duplicates", "line"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("k", [1, 7, 40])
def test_distances_are_those_of_scipy(kind, k):
    points = cloud(kind)
    found = knn(build_index(points), points, k)
    expected, _ = KDTree(points).query(points, k)
    np.testing.assert_allclose(found.distances, expected.reshape(len(points), k), rtol=1e-9, atol=1e-9)
    real = np.linalg.norm(points[found.points] - points[:, None], axis=2)
    np.testing.assert_allclose(found.distances, real, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("kind", ["uniform", "surface", "lidar"])
def test_sets_are_those_of_scipy(kind):
    points = cloud(kind)
    found = knn(build_index(points), points, 16)
    _, expected = KDTree(points).query(points, 16)
    np.testing.assert_array_equal(np.sort(found.points, axis=1), np.sort(expected, axis=1))


@given(LATTICE, st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_ties_go_as_in_the_naive_search(points, k, seed):
    k = min(k, len(points))
    query = np.random.default_rng(seed).integers(-3, 4, 3).astype(float)
    found = knn(build_index(points), query[None], k)
    assert found.points[0].tolist() == naive.nearest(points.tolist(), query.tolist(), k)


@given(LATTICE, st.randoms(use_true_random=False))
def test_order_of_the_input_changes_nothing(points, random):
    shuffled = list(range(len(points)))
    random.shuffle(shuffled)
    k = min(5, len(points))
    a = knn(build_index(points), points, k)
    b = knn(build_index(points[shuffled]), points, k)
    np.testing.assert_array_equal(points[a.points], points[shuffled][b.points])


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_many_points_at_few_places(seed, k):
    rng = np.random.default_rng(seed)
    points = rng.permutation(np.r_[np.zeros((300, 3)), np.ones((200, 3)), rng.integers(0, 4, (40, 3)) / 2.0])
    queries = np.r_[np.zeros((1, 3)), np.ones((1, 3)), rng.normal(size=(6, 3))]
    found = knn(build_index(points), queries, k)
    for rows, query in zip(found.points, queries, strict=True):
        assert rows.tolist() == naive.nearest(points.tolist(), query.tolist(), k)


def test_what_a_sensor_did_not_see_at_the_origin_costs_no_more_than_the_rest():
    points = np.r_[np.zeros((200_000, 3)), cloud("surface", 2000) + 1]
    found = knn(build_index(points), points[::997], 16)
    np.testing.assert_array_equal(found.points[0], np.arange(16))
    assert (found.distances[0] == 0).all()


def test_queries_need_not_be_points_of_the_cloud():
    points = cloud("surface")
    queries = np.random.default_rng(1).normal(0, 20, (500, 3))
    found = knn(build_index(points), queries, 9)
    expected, _ = KDTree(points).query(queries, 9)
    np.testing.assert_allclose(found.distances, expected, rtol=1e-12)


def test_any_number_of_threads_gives_the_same(monkeypatch):
    points = cloud("lidar", 20_000)
    monkeypatch.setenv("EDGEL_NUM_THREADS", "1")
    one = knn(build_index(points), points, 16)
    monkeypatch.setenv("EDGEL_NUM_THREADS", "4")
    four = knn(build_index(points), points, 16)
    np.testing.assert_array_equal(one.points, four.points)
    np.testing.assert_array_equal(one.distances, four.distances)


def test_number_of_threads_is_checked(monkeypatch):
    monkeypatch.setenv("EDGEL_NUM_THREADS", "many")
    with pytest.raises(ValueError, match="EDGEL_NUM_THREADS"):
        build_index(cloud("uniform"))


@pytest.mark.parametrize("k", [0, 4])
def test_more_neighbours_than_points_are_refused(k):
    with pytest.raises(ValueError, match="num_neighbors: expected 1 to 3"):
        knn(build_index(np.eye(3)), np.eye(3), k)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 7, 8, 9, 300, 2000]))
def test_queries_in_the_order_of_the_index_are_answered_as_any(seed, some):
    """Queries that are the index's own points need no tree of their own, and change no bit."""
    rng = np.random.default_rng(seed)
    points = cloud(KINDS[seed % len(KINDS)], 2000, seed)
    index = build_index(points)
    chosen = rng.permutation(len(points))[:some]
    expected = knn(index, points[chosen], 5)
    places = np.sort(chosen)
    asked = {
        "at_points": (at_points(index, chosen), expected),
        "at_places": (at_places(index, places), knn(index, index.at(places), 5)),
        "every_point": (every_point(index), knn(index, points, 5)),
        "every_place": (every_place(index), knn(index, index.at(np.arange(len(index))), 5)),
    }
    for name, (queries, wanted) in asked.items():
        found = knn(index, queries, 5)
        np.testing.assert_array_equal(found.points, wanted.points, err_msg=name)
        np.testing.assert_array_equal(found.distances, wanted.distances, err_msg=name)


def test_lists_kept_of_a_small_cloud_are_those_that_are_searched_for():
    rng = np.random.default_rng(0)
    xyz = np.concatenate([rng.integers(0, 6, (400, 3)).astype(float), rng.random((400, 3))])  # ties, twins, and none
    kept, fresh = build_index(xyz), build_index(xyz)
    some = rng.permutation(len(xyz))[:300]
    knn(kept, every_place(kept), 32)
    assert kept.lists
    for k in (1, 9, 32, 64, 65):
        mine, searched = knn(kept, at_points(kept, some), k), knn(fresh, at_points(fresh, some), k)
        np.testing.assert_array_equal(mine.points, searched.points)
        np.testing.assert_array_equal(mine.distances, searched.distances)
    assert not fresh.lists
