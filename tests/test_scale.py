"""Edges larger than some spacings: detecting on a thinned cloud."""

import numpy as np
import pytest
from hall import hall, roof, same

import edgel
from edgel._neighbors.spacing import median_spacing
from edgel._scale import at_scale


def test_scale_one_is_detect():
    same(at_scale(edgel.detect, hall(), 1.0), edgel.detect(hall()))


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
        at_scale(edgel.paper.detect, roof(), scale)
