"""Edges larger than some spacings: detecting on a thinned cloud."""

import numpy as np
import pytest
from hall import hall, roof

import edgel
from edgel._neighbors.spacing import median_spacing
from edgel._neighbors.thinning import thin


def test_the_published_method_has_a_scale_too():
    cloud = edgel.Cloud(hall())
    found = edgel.paper.detect(cloud, scale=2.0)
    assert found.parameters["scale"] == 2
    assert found.num_points == len(cloud)
    rows = thin(cloud, 2.0 * median_spacing(cloud))
    again = edgel.paper.detect(cloud.take(rows))
    np.testing.assert_array_equal(found.index, rows[again.index])
    np.testing.assert_array_equal(found.position, again.position)


def test_scale_finds_only_what_is_larger():
    x, y = np.meshgrid(np.arange(150.0), np.arange(150.0))
    z = np.maximum(40.0 - abs(x - 75.0), 0.0) + np.maximum(3.0 - abs(x - 18.0), 0.0)  # a roof, and a rib 6 wide
    cloud = np.c_[x.ravel(), y.ravel(), z.ravel()]
    found = [edgel.detect(cloud, kinds="crease"), edgel.detect(cloud, kinds="crease", scale=8.0)]
    at = [cloud[edges.index, 0] for edges in found]
    assert (abs(at[0] - 18) < 6).any()
    assert not (abs(at[1] - 18) < 6).any()
    assert (abs(at[1] - 75) <= 8).sum() > 5
    assert found[1].num_points == len(cloud)


def test_rows_at_a_scale_are_those_of_the_whole_cloud():
    xyz = np.vstack([[np.nan] * 3, hall()])
    edges = edgel.detect(xyz, scale=3.0)
    assert edges.num_points == len(xyz)
    assert edges.num_dropped == 1
    assert (np.diff(edges.index) > 0).all()
    spacing = median_spacing(xyz)
    assert (np.linalg.norm(edges.position - xyz[edges.index], axis=1) < 10 * spacing).all()


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan])
def test_bad_scales_are_refused(scale):
    with pytest.raises(ValueError, match="scale"):
        edgel.detect(roof(), scale=scale)
    with pytest.raises(ValueError, match="scale"):
        edgel.paper.detect(roof(), scale=scale)
