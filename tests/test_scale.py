"""Edges larger than some spacings: detecting on a thinned cloud."""

import numpy as np
import pytest
from hall import hall, roof

import edgel
from edgel import synth
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


def bent(radius, seed=0):
    """Two planes at a right angle, joined by a round of some radius along y; one point a unit square."""
    rng = np.random.default_rng(seed)
    arc, half, length = radius * np.pi / 2, 25.0, 50.0
    along = rng.uniform(-half - arc / 2, half + arc / 2, round(14 * (2 * half + arc) * length))
    angle = np.clip(along, -arc / 2, arc / 2) / radius
    beyond = (np.abs(along) - arc / 2).clip(0) * np.sqrt(0.5)
    xyz = np.column_stack(
        [
            radius * np.sin(angle) + np.sign(along) * beyond,
            rng.uniform(0, length, len(along)),
            radius * np.cos(angle) - beyond,
        ]
    )
    return xyz[synth.poisson_disc(xyz, 0.752)]


def test_softer_edges_are_found_at_larger_scales_and_say_so():
    scales = []
    for radius in (0.01, 3.0, 6.0):
        cloud = bent(radius)
        found = edgel.detect(cloud, kinds="crease", max_scale=8)
        ridge = found.take((np.abs(cloud[found.index, 0]) < 4) & (np.abs(cloud[found.index, 1] - 25) < 20))
        assert len(ridge) >= 5
        scales.append(np.median(ridge.scale))
        assert (np.abs(cloud[found.index, 0]) < 5).all()
        assert found.parameters["max_scale"] == 8
    assert scales[0] < 2.2 < scales[1] < scales[2]
    # The choice is the user's: without fillets the soft one is none.
    assert len(found.of_scale(high=2.0)) == 0


@pytest.mark.parametrize("max_scale", [0.5, np.nan, np.inf])
def test_a_largest_scale_below_the_least_is_refused(max_scale):
    with pytest.raises(ValueError, match="max_scale: expected the scale"):
        edgel.detect(hall(), max_scale=max_scale)
