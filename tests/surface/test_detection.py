"""What the evidence and the trees make of surfaces whose edges are known."""

import numpy as np
import pytest

import edgel
from edgel import metrics, synth
from edgel.edges import EdgeKind


@pytest.fixture(scope="module")
def wedge():
    """A ridge that turns by 60 degrees, its feet by 30, sampled all round."""
    return synth.sample(synth.wedge_fan(angles=(120,), flank=20.0, width=40.0), pattern="blue_noise", spacing=0.8)


@pytest.fixture(scope="module")
def found(wedge):
    return edgel.detect(wedge.cloud)


def test_geometry_of_clean_creases(wedge, found):
    """Median error of position, direction and both normals, on the creases found."""
    creases = found.take((found.kind & EdgeKind.CREASE) > 0)
    true = wedge.edges.take(wedge.edges.dihedral > np.radians(25))
    apart = metrics.nearest(creases.position, true.positions)
    here = apart.distances[:, 0] < 1.5 * wedge.spacing
    creases, true = creases.take(here), true.take(apart.points[here, 0])
    off = creases.position - true.positions
    off -= (off * true.tangents).sum(axis=1, keepdims=True) * true.tangents
    assert np.nanmedian(np.linalg.norm(off, axis=1)) <= 0.1 * wedge.spacing
    assert np.nanmedian(between(creases.direction, true.tangents)) <= 3
    straight = [between(creases.normals[:, i], true.normals[:, i]) for i in (0, 1)]
    crossed = [between(creases.normals[:, i], true.normals[:, 1 - i]) for i in (0, 1)]
    assert np.nanmedian(np.fmin(np.maximum(*straight), np.maximum(*crossed))) <= 2
    assert np.nanmedian(np.abs(creases.angle - true.dihedral)) <= np.radians(3)


def between(a, b):
    return np.degrees(np.arccos(np.clip(np.abs((a * b).sum(axis=1)), 0, 1)))


@pytest.mark.parametrize(("turn", "recall"), [(45, 0.97), (25, 0.8)])
def test_creases_are_found_and_little_else(wedge, found, turn, recall):
    true = wedge.edges.positions[wedge.edges.dihedral > np.radians(turn)]
    places = wedge.cloud.xyz[found.index]
    assert np.mean(metrics.nearest(true, places).distances[:, 0] <= wedge.spacing) >= recall
    away = metrics.nearest(places, wedge.edges.positions).distances[:, 0] > 2.5 * wedge.spacing
    assert away.sum() <= len(wedge.cloud) / 1000


@pytest.mark.parametrize("noise", [0, 0.3])
def test_smooth_surfaces_have_no_edges(noise):
    scene = synth.sample(synth.sphere(), pattern="uniform", spacing=0.9, noise=noise, seed=3)
    assert len(edgel.detect(scene.cloud)) <= max(1, len(scene.cloud) / 1000)


def test_rotation_translation_scale_and_order_change_nothing(wedge, found):
    rng = np.random.default_rng(5)
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    order = rng.permutation(len(wedge.cloud))
    moved = 1000 * wedge.cloud.xyz[order] @ rotation.T + (3e5, -2e5, 7e4)
    again = edgel.detect(moved)
    mine, other = np.zeros((2, len(order)), bool)
    mine[found.index] = True
    other[order[again.index]] = True
    assert np.mean(mine != other) <= 2e-3  # rounding may decide a tie
    shuffled = edgel.detect(wedge.cloud.xyz[order])
    assert np.array_equal(np.sort(order[shuffled.index]), found.index)
    back = np.argsort(order[shuffled.index])
    assert np.array_equal(shuffled.position[back], found.position)


def test_twice_as_dense_keeps_the_edges(wedge, found):
    dense = synth.sample(
        synth.wedge_fan(angles=(120,), flank=20.0, width=40.0), pattern="blue_noise", spacing=0.8 / 2**0.5
    )
    again = edgel.detect(dense.cloud)
    apart = metrics.distances(wedge.cloud.xyz[found.index], dense.cloud.xyz[again.index])
    assert apart.chamfer <= wedge.spacing


def test_many_points_at_one_place_are_borne(wedge):
    repeated = np.concatenate([wedge.cloud.xyz, np.repeat(wedge.cloud.xyz[:3], 200, axis=0)])
    assert np.isfinite(edgel.detect(repeated).position).all()


def test_threads_change_nothing(wedge, found, monkeypatch):
    monkeypatch.setenv("EDGEL_NUM_THREADS", "1")
    alone = edgel.detect(wedge.cloud)
    assert np.array_equal(alone.index, found.index)
    assert np.array_equal(alone.strength, found.strength)
    assert np.array_equal(alone.normals, found.normals, equal_nan=True)
