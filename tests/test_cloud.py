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
