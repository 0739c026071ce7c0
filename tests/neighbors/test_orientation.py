"""Which side is outside: the sensor's, that of normals that came with the cloud, or what a whole surface says."""

import numpy as np
import pytest

import edgel
from edgel import EdgeKind, metrics, synth
from edgel._neighbors.pieces import UNIT, Pairs, join


def cube(side=30, jitter=0.0, seed=0):
    """A closed cube of points one apart, and the normals of its faces."""
    u, v = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0))
    parts, normals = [], []
    for axis in range(3):
        for level, sign in ((0.0, -1.0), (float(side), 1.0)):
            parts.append(np.insert(np.c_[u.ravel(), v.ravel()], axis, level, axis=1))
            normals.append(np.tile(sign * np.eye(3)[axis], (u.size, 1)))
    xyz, first = np.unique(np.concatenate(parts), axis=0, return_index=True)
    rng = np.random.default_rng(seed)
    return xyz + rng.normal(0, jitter, xyz.shape), np.concatenate(normals)[first]


def creases(found):
    return found.convex[(found.kind & EdgeKind.CREASE) > 0]


def test_nobody_knows_the_outside_of_a_cube():
    found = edgel.detect(cube()[0])
    assert found.orientation == "unknown"
    assert (found.convex == 0).all()
    assert (np.isfinite(found.angle)).any()
    assert edgel.estimate_normals(cube()[0]).orientation == "unknown"


def test_a_cube_is_convex_outwards():
    found = edgel.detect(cube()[0], orient="outward")
    assert found.orientation == "outward"
    assert len(creases(found)) > 300
    assert (creases(found) == 1).all()
    out = ((found.position - 15)[:, None] * found.normals).sum(axis=2)
    assert (out[np.isfinite(out)] > 0).all()


@pytest.mark.parametrize("sign", [1, -1], ids=["out", "in"])
def test_the_cloud_s_own_normals_decide(sign):
    xyz, normals = cube()
    cloud = edgel.Cloud(xyz, dict(zip(("nx", "NY", "nz"), 3 * sign * normals.T, strict=True)))
    found = edgel.detect(cloud)
    assert found.orientation == "normals"
    assert (creases(found) == sign).all()
    mine = edgel.estimate_normals(cloud, at=[500, 7])
    assert mine.orientation == "normals"
    assert ((mine.normals * sign * normals[[500, 7]]).sum(axis=1) > 0).all()
    seen = edgel.detect(cloud, viewpoint=(15, 15, 90), method="surface")
    assert seen.orientation == "sensor"


@pytest.mark.parametrize(
    "solid", [synth.stepped_block(), synth.gear(), synth.cube_fractal(), synth.frustum()], ids=lambda s: s.name
)
def test_creases_of_closed_solids_bend_the_right_way(solid):
    scene = synth.sample(solid, pattern="blue_noise", spacing=1.3 * solid.spacing, noise=0.1, seed=3)
    found = edgel.detect(scene.cloud, kinds="crease", orient="outward")
    true = scene.edges.take(np.nan_to_num(scene.edges.dihedral) > np.radians(25))
    nearest = metrics.nearest(found.position, true.positions)
    here = nearest.distances[:, 0] < 1.5 * scene.spacing
    convex, wanted = found.convex[here], true.convex[nearest.points[here, 0]]
    assert np.mean(convex != 0) >= 0.95
    assert np.mean(convex[convex != 0] == wanted[convex != 0]) >= 0.99


@pytest.mark.parametrize(("noise", "right"), [(0, 1), (0.3, 0.999), (1, 0.96)])
def test_normals_look_out_of_a_torus(noise, right):
    scene = synth.sample(synth.torus(), pattern="uniform", spacing=1.2, noise=noise, outliers=0.02, seed=4)
    found = edgel.estimate_normals(scene.cloud, orient="outward", num_neighbors=24)
    cosine = (found.normals * scene.normals).sum(axis=1)[~scene.outlier]
    assert np.mean(cosine[np.abs(cosine) > 0.7] >= 0) >= right


def test_several_pieces_have_an_outside_each():
    xyz = np.concatenate([cube(20)[0], cube(20)[0] + [60, 0, 0]])
    found = edgel.estimate_normals(xyz, orient="outward", num_neighbors=9)
    middle = np.where(xyz[:, :1] > 40, [70.0, 10, 10], [10.0, 10, 10])
    out = (found.normals * (xyz - middle)).sum(axis=1)
    assert (out > 0).all()


def test_order_and_threads_change_nothing(monkeypatch):
    xyz, _ = cube(20, jitter=0.1)
    expected = edgel.estimate_normals(xyz, orient="outward").normals
    order = np.random.default_rng(0).permutation(len(xyz))
    monkeypatch.setenv("EDGEL_NUM_THREADS", "3")
    np.testing.assert_array_equal(edgel.estimate_normals(xyz[order], orient="outward").normals, expected[order])


def test_rows_asked_for_and_rows_without_a_place():
    xyz, _ = cube(12)
    xyz[5] = np.nan
    whole = edgel.estimate_normals(xyz, orient="outward")
    some = edgel.estimate_normals(xyz, at=[5, 100, 3], orient="outward")
    np.testing.assert_array_equal(some.normals, whole.normals[[5, 100, 3]])
    assert np.isnan(some.normals[0]).all()


@pytest.mark.parametrize("estimate", [edgel.detect, edgel.estimate_normals])
def test_what_contradicts_itself_is_refused(estimate):
    with pytest.raises(ValueError, match="orient: expected one of auto, outward"):
        estimate(cube(9)[0], orient="inward")
    with pytest.raises(ValueError, match="'outward' and a viewpoint contradict"):
        estimate(cube(9)[0], orient="outward", viewpoint=(0, 0, 9))


def test_pairs_are_joined_by_the_sum_of_what_they_say():
    """Two pieces of three, between which one strong pair errs and two weaker ones are right."""
    pairs = [(0, 1, 1.0), (1, 2, -1.0), (3, 4, 1.0), (4, 5, 1.0), (0, 3, 0.9), (1, 4, -0.6), (2, 5, 0.6), (6, 7, -0.1)]
    a, b, weight = (np.array(column) for column in zip(*pairs, strict=True))
    pairs = Pairs(a, b, np.rint(weight * UNIT).astype(np.int64), np.ones(len(a), np.int64))
    sign, root = join(pairs, 8)
    assert root[:6].tolist() == [root[0]] * 6
    assert root[0] != root[6] == root[7]
    assert (sign[:6] * sign[0]).tolist() == [1, 1, -1, -1, -1, -1]
    assert sign[6] == -sign[7]
