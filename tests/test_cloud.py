import copy
import pickle

import numpy as np
import pytest

import edgel
from edgel import Cloud, metrics, plot
from edgel._neighbors.spacing import median_spacing
from edgel.cloud import as_cloud, check_points


def test_attributes_follow_their_points():
    cloud = edgel.Cloud(np.arange(12.0).reshape(4, 3), {"a": np.arange(4), "rgb": np.zeros((4, 3), np.uint8)})
    some = cloud.take(np.array([2, 0]))
    assert some.attributes["a"].tolist() == [2, 0]
    assert some.attributes["rgb"].shape == (2, 3)
    more = cloud.with_attributes(b=np.ones(4))
    assert list(more.attributes) == ["a", "rgb", "b"]
    assert list(cloud.attributes) == ["a", "rgb"]


def test_an_organized_cloud_knows_its_shape():
    cloud = edgel.Cloud(np.zeros((4, 5, 3)))
    assert cloud.shape == (4, 5)
    assert len(cloud) == 20
    assert not cloud.take(np.array([0])).is_organized
    assert "organized 4 x 5" in repr(cloud)


class _LikeOpen3D:
    points = [[0.0, 1, 2]] * 4


class _LikeLaspy:
    xyz = np.ones((4, 3))


@pytest.mark.parametrize("carrier", [_LikeOpen3D(), _LikeLaspy(), [[1, 2, 3]] * 4, edgel.Cloud(np.ones((4, 3)))])
def test_whatever_carries_points_is_taken(carrier):
    assert as_cloud(carrier).xyz.shape == (4, 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"xyz": np.zeros((4, 3)), "attributes": {"a": np.zeros(3)}}, "'a'"),
        ({"xyz": np.zeros((4, 3)), "attributes": {"a": np.float64(3)}}, "'a'"),
        ({"xyz": np.zeros((4, 3)), "shape": (2, 3)}, "shape"),
        ({"xyz": np.zeros((4, 3)), "viewpoint": [1, 2]}, "viewpoint"),
    ],
)
def test_what_does_not_fit_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        edgel.Cloud(**arguments)


def test_large_finite_coordinates_are_not_dropped_but_refused():
    """Their sum overflows like an infinite one, but they are numbers: nothing is left out without a word."""
    with pytest.raises(ValueError, match="row 0 and 3 more has a coordinate beyond"):
        check_points(np.full((4, 3), 1e308))
    assert check_points(np.full((4, 3), 1e30)).num_dropped == 0


@pytest.mark.parametrize("value", [1.5e154, -1e200, 1.01e30])
@pytest.mark.parametrize(
    "use",
    [
        edgel.detect,
        edgel.paper.detect,
        edgel.estimate_normals,
        lambda points: edgel.detect(points, method="orthographic"),
        lambda points: metrics.nearest(points[:3], points),
        lambda points: metrics.nearest(points, points[:3]),
        median_spacing,
        plot.picture,
    ],
)
def test_coordinates_whose_squares_overflow_are_refused_with_their_row(use, value):
    points = np.random.default_rng(0).random((40, 3))
    points[17, 1] = value
    with pytest.raises(ValueError, match=r"row 17 has a coordinate beyond 1e\+30"):
        use(points)


def test_the_row_named_is_that_of_the_input():
    points = np.random.default_rng(0).random((40, 3))
    points[3], points[17, 1], points[30, 0] = np.nan, 1e200, -1e40
    with pytest.raises(ValueError, match="row 17 and 1 more"):
        edgel.detect(points)


@pytest.mark.parametrize("viewpoint", [[0, 0, 1.5e154], [1e31, 0, 0], [np.inf, 0, 0]])
def test_a_viewpoint_too_far_away_is_refused(viewpoint):
    points = np.random.default_rng(0).random((40, 3))
    for use in (edgel.detect, edgel.estimate_normals):
        with pytest.raises(ValueError, match="viewpoint: expected three finite numbers"):
            use(points, viewpoint=viewpoint)
    with pytest.raises(ValueError, match="viewpoint"):
        Cloud(points, viewpoint=np.array(viewpoint))


def test_large_and_small_units_give_the_same_edges():
    x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    expected = edgel.detect(roof)
    for unit in (2.0**-60, 2.0**60):
        found = edgel.detect(roof * unit)
        np.testing.assert_array_equal(found.index, expected.index)
        assert np.isfinite(found.position).all()


@pytest.mark.parametrize("clone", [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy, copy.copy])
def test_clouds_and_answers_can_be_pickled_and_copied(clone):
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    roof = np.dstack([x, y, -abs(x - 10)])
    cloud = Cloud(
        roof, {"intensity": np.arange(400)}, viewpoint=np.array([0.0, 0, 9]), crs="EPSG:25832", metadata={"a": 1}
    )
    other = clone(cloud)
    np.testing.assert_array_equal(other.xyz, cloud.xyz)
    np.testing.assert_array_equal(other.attributes["intensity"], cloud.attributes["intensity"])
    assert (other.shape, other.crs, dict(other.metadata)) == (cloud.shape, cloud.crs, dict(cloud.metadata))
    with pytest.raises(TypeError):
        other.attributes["more"] = np.zeros(400)
    for edges in (edgel.detect(cloud), edgel.paper.detect(cloud)):
        again = clone(edges)
        np.testing.assert_array_equal(again.index, edges.index)
        assert repr(again) == repr(edges)
    planes = clone(edgel.estimate_normals(cloud))
    assert len(planes) == 400


def test_what_is_masked_is_missing():
    mask = np.arange(12).reshape(4, 3) == 4
    points = np.ma.masked_array(np.arange(12).reshape(4, 3), mask)
    missing = np.ma.masked_array(np.arange(4), [True, False, False, False])
    attributes = {name: missing.astype(name) for name in ("float32", "float64", "int16", "int64", "bool")}
    cloud = edgel.Cloud(points, attributes)
    assert np.array_equal(np.isnan(cloud.xyz), mask)
    assert check_points(points).rows.tolist() == [0, 2, 3]
    assert check_points(list(points)).rows.tolist() == [0, 2, 3]
    for name, values in cloud.attributes.items():
        assert np.isnan(values).tolist() == [True, False, False, False]
        assert values.dtype == (name if name.startswith("float") else np.float64)
    whole = edgel.Cloud(np.ma.masked_array(np.eye(3)), {"id": np.ma.masked_array([1, 2, 3])})
    assert whole.attributes["id"].dtype == int
    assert type(whole.xyz) is np.ndarray


@pytest.mark.parametrize("values", [["a", "b", "c"], [2**60, 1, 2]])
def test_a_mask_that_a_type_cannot_say_is_refused(values):
    masked = np.ma.masked_array(values, [False, True, False])
    with pytest.raises(ValueError, match="attribute 'name': some are masked"):
        edgel.Cloud(np.eye(3), {"name": masked})
