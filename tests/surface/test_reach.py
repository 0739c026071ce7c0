"""What lies out of reach of a point changes nothing that is said of it."""

import numpy as np

from edgel import synth
from edgel._neighbors.kdtree import build_index
from edgel._surface import classify, cloud_statistics, screen
from edgel._surface.forest import Forest, load_forests
from edgel._surface.reach import evidence_reach

ALL_LEAVES = Forest(np.zeros(1, np.int32), np.full(1, -1, np.int16), np.full(1, 9, np.float32), np.zeros(1, np.int32))


def probabilities(index, statistics):
    """Crease and outline by point, (N, 2); 0 where no one looked."""
    found = classify(index, screen(index, statistics, {**load_forests(), "leaf": ALL_LEAVES}))
    said = np.zeros((len(index), 2))
    said[found.points] = np.column_stack([found.crease, found.outline])
    return said


def test_what_is_out_of_reach_changes_nothing():
    scene = synth.sample(synth.wedge_fan(), pattern="uniform", spacing=1.9, noise=0.1, outliers=0.01, seed=4)
    xyz = scene.cloud.xyz
    cut = np.quantile(xyz[:, 0], 0.7)
    tile = np.ascontiguousarray(xyz[xyz[:, 0] < cut])
    whole, part = build_index(xyz), build_index(tile)
    statistics = cloud_statistics(whole)
    reach = np.empty(len(tile))
    reach[part.order] = evidence_reach(part)
    sure = reach < cut - tile[:, 0]  # told by the tile alone
    assert sure.mean() > 0.4
    assert np.median(reach) < 25 * scene.spacing
    expected, said = probabilities(whole, statistics)[xyz[:, 0] < cut], probabilities(part, statistics)
    np.testing.assert_array_equal(said[sure], expected[sure])
    assert (said[sure] > 0.5).any()
    assert (said != expected).any()  # near the cut it is another surface
