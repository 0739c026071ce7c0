"""The benchmark's own scoring: the truth of a scene scores 1, nothing 0, a thicker truth loses at zero tolerance."""

import accuracy
import numpy as np
import pytest

from edgel import EdgeKind, synth
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn

ALL = accuracy.ALL


@pytest.fixture(scope="module", params=["view", "sample"])
def scene(request):
    """A frustum seen from one side, and sampled all round."""
    solid = synth.frustum()
    if request.param == "view":
        return synth.view(solid, projection="pinhole", spacing=solid.spacing)
    return synth.sample(solid, pattern="blue_noise", spacing=solid.spacing)


def answer(scene, mask):
    return accuracy.score(scene, mask, np.where(mask, scene.point_kind, 0).astype(np.uint8), ALL)


def test_the_truth_of_a_scene_scores_one(scene):
    row = answer(scene, scene.point_kind != 0)
    assert row["zero"] == {"precision": 1, "recall": 1, "f1": 1, "mcc": 1, "iou": 1}
    assert row["all"]["f1@2.5"] == 1
    assert row["all"]["precision@1.0"] == 1
    assert row["all"]["precision@0.5"] > 0.99  # half a spacing off a curve is a little more off its samples
    assert row["kinds_right"] == 1
    assert row["false_per_thousand"] == 0
    assert row["position"]["median"] <= 0.5


def test_nothing_scores_zero(scene):
    row = answer(scene, np.zeros(len(scene.cloud), bool))
    assert row["zero"]["f1"] == row["all"]["f1@2.5"] == row["false_per_thousand"] == 0
    assert row["chamfer"] == np.inf
    assert row["kinds_right"] is None


def test_a_thicker_truth_loses_at_zero_tolerance_only(scene):
    finite = np.flatnonzero(np.isfinite(scene.noise_free).all(axis=1) & np.isfinite(scene.cloud.xyz).all(axis=1))
    true = np.flatnonzero(scene.point_kind)
    near = knn(build_index(scene.noise_free[true]), scene.noise_free[finite], 1).distances[:, 0] <= scene.spacing
    thick = np.zeros(len(scene.cloud), bool)
    thick[finite[near]] = True
    row = answer(scene, thick)
    assert row["zero"]["recall"] == 1
    assert row["zero"]["precision"] < 0.8
    assert row["all"]["precision@1.5"] == 1


def test_points_of_a_flat_face_are_false(scene):
    finite = np.isfinite(scene.cloud.xyz).all(axis=1)
    rows = np.flatnonzero(finite)
    apart = knn(build_index(scene.edges.positions), scene.noise_free[rows], 1).distances[:, 0]
    inner = np.zeros(len(scene.cloud), bool)
    inner[rows[apart > 3 * scene.spacing]] = True
    row = answer(scene, inner)
    assert row["all"]["precision@2.5"] == row["all"]["recall@2.5"] == row["zero"]["f1"] == 0
    assert row["false_per_thousand"] == pytest.approx(1000 * inner.sum() / finite.sum())


def test_outliers_are_always_false():
    solid = synth.frustum()
    scene = synth.sample(solid, pattern="uniform", spacing=solid.spacing, outliers=0.05)
    row = answer(scene, scene.outlier)
    assert scene.outlier.any()
    assert row["all"]["precision@2.5"] == 0


def test_faint_creases_count_neither_way():
    solid = synth.wedge_fan(angles=(170, 90), flank=12.0, width=30.0)
    scene = synth.sample(solid, pattern="blue_noise", spacing=solid.spacing)
    faint = (scene.edges.kind == int(EdgeKind.CREASE)) & (scene.edges.dihedral < accuracy.MIN_TURN)
    assert faint.any()
    to_faint = knn(build_index(scene.edges.positions[faint]), scene.noise_free, 1).distances[:, 0]
    on_faint = to_faint <= 0.5 * scene.spacing
    with_faint = answer(scene, (scene.point_kind != 0) | on_faint)
    without = answer(scene, scene.point_kind != 0)
    assert with_faint["all"]["f1@1.0"] == pytest.approx(without["all"]["f1@1.0"])


def test_a_grid_is_searched_for_its_best(scene):
    class Found:
        def __init__(self, mask):
            self.mask, self.kind = mask, np.where(mask, int(EdgeKind.CREASE), 0).astype(np.uint8)

    class Rival:
        def __init__(self):
            self.defaults, self.grid, self.finds = {"share": 0.0}, ({"share": 0.5}, {"share": 1.0}), ALL

        def run(self, cloud, spacing, parameters):
            true = np.flatnonzero(scene.point_kind)
            mask = np.zeros(len(cloud), bool)
            mask[true[: int(parameters["share"] * len(true))]] = True
            return Found(mask)

    best, tried = accuracy.best_of_grid(Rival(), [scene], lambda rival, one, p: rival.run(one.cloud, one.spacing, p))
    assert best == {"share": 1.0}
    assert [one["parameters"]["share"] for one in tried] == [0.0, 0.5, 1.0]
    assert tried[0]["mean"] == 0
