import numpy as np
import pytest

import edgel
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


def test_large_finite_coordinates_are_not_dropped():
    points = np.full((4, 3), 1e308)
    assert check_points(points).num_dropped == 0


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
