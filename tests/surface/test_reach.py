"""What is far from a point changes nothing, or next to nothing, that is said of it."""

import numpy as np
import pytest

import edgel
from edgel._neighbors.kdtree import build_index
from edgel._surface import classify, cloud_statistics, screen
from edgel._surface.leaves import describe_leaves
from edgel._surface.reach import Bounds, evidence_reach, screening_reach, settled


def probabilities(index, statistics):
    """Crease and outline by point, (N, 2); 0 where no one looked."""
    found = classify(index, screen(index, statistics))
    said = np.zeros((len(index), 2))
    said[found.points] = np.column_stack([found.crease, found.outline])
    return said


@pytest.fixture(scope="module")
def houses():
    """Flat and gabled roofs over uneven ground, seen from above, with trees."""
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(np.arange(150.0), np.arange(150.0)), axis=-1).reshape(-1, 2)
    plan = grid + rng.uniform(-0.45, 0.45, grid.shape)
    x, y = plan.T
    height = 2 * np.sin(x / 40) * np.cos(y / 30)
    u, v = np.abs(x % 38 - 19), np.abs(y % 30 - 15)
    roof, crown = (u < 11) & (v < 8), np.hypot(u - 19, v - 15) < 5
    height = np.where(roof, 9 + np.where(x % 76 < 38, 0, 8 - v) * 0.7, height)
    height += np.where(crown, rng.uniform(3, 9, len(plan)), 0)
    return np.column_stack([plan, height]) + 0.05 * rng.standard_normal((len(plan), 3))


def test_what_is_out_of_reach_changes_nothing(houses):
    xyz = np.concatenate([houses, houses[::500] + [0.3, 0.2, 6.0]])  # some stray points
    xyz[(xyz[:, 1] > 60) & (xyz[:, 2] < 15), 2] = 0.0  # and a field, which the first look rules out
    whole = build_index(xyz)
    statistics = cloud_statistics(whole)
    cut = 112 // statistics.cell * statistics.cell  # whole cells
    tile = np.ascontiguousarray(xyz[xyz[:, 0] < cut])
    part = build_index(tile)
    expected, said = probabilities(whole, statistics)[xyz[:, 0] < cut], probabilities(part, statistics)
    leaves = describe_leaves(part, statistics.cell)
    reach, looked = np.empty((2, len(tile)))
    everywhere = np.arange(len(part))
    for radii, result in ((evidence_reach(part, leaves, everywhere), reach), (screening_reach(part, leaves), looked)):
        result[part.order] = radii
    sure = reach < cut - tile[:, 0]  # told by the tile alone
    told = np.empty(len(tile), bool)
    told[part.order] = settled(part, leaves, Bounds.of(part, leaves), cut - part.xyz[0], np.ones(len(part), bool))
    np.testing.assert_array_equal(told, sure)  # most of them by their leaves
    assert sure.mean() > 0.3
    assert np.median(reach) < 60
    np.testing.assert_array_equal(said[sure], expected[sure])
    assert (said[sure] > 0.5).any()
    assert (said != expected).any()  # near the cut it is another surface
    # The first look alone reaches less far, and so does what it says.
    ruled_out, of_whole = np.empty(len(tile), bool), np.empty(len(xyz), bool)
    ruled_out[part.order], of_whole[whole.order] = (screen(i, statistics).probability == 0 for i in (part, whole))
    sure = looked < cut - tile[:, 0]
    assert sure.mean() > 0.5
    assert 0.1 < ruled_out[sure].mean() < 0.9
    np.testing.assert_array_equal(ruled_out[sure], of_whole[xyz[:, 0] < cut][sure])


def test_a_strip_left_out_changes_edges_beside_it_alone(houses):
    whole = edgel.detect(houses)
    assert (whole.kind & edgel.EdgeKind.OCCLUDING).any()
    for axis, rising in ((0, True), (1, False)):
        along = houses[:, axis] if rising else -houses[:, axis]
        kept = np.flatnonzero(along > np.quantile(along, 0.01))
        kinds, again = np.zeros((2, len(houses)), np.uint8)
        kinds[whole.index] = whole.kind
        part = edgel.detect(houses[kept])
        again[kept[part.index]] = part.kind
        far = along > np.quantile(along, 0.01) + 40
        assert np.sum((kinds != again)[far]) <= 0.002 * np.sum(kinds[far] > 0)
