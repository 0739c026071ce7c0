"""Noise is measured for what it is, and points are moved where it asks for it and nowhere else."""

import numpy as np
import pytest

import edgel
from edgel import metrics, synth
from edgel._neighbors.kdtree import build_index
from edgel._surface.smoothing import ALL, FROM, cloud_noise, smoothed
from edgel._surface.statistics import STEPS, cloud_statistics


def block(noise, spacing=2.0):
    return synth.sample(synth.stepped_block(), pattern="blue_noise", spacing=spacing, noise=noise, seed=2)


@pytest.mark.parametrize("make", [synth.wedge_fan, synth.sphere, synth.thin_plate, synth.gear])
def test_what_is_bent_or_thin_is_not_noisy(make):
    solid = make()
    scene = synth.sample(solid, pattern="uniform", spacing=np.sqrt(solid.area / 8000), seed=1)
    assert cloud_noise(build_index(scene.cloud.xyz)) < FROM / 2


def test_noise_is_measured_in_spacings():
    said = [cloud_noise(build_index(block(noise).cloud.xyz)) for noise in (0.0, 0.1, 0.3, 1.0)]
    assert said == sorted(said)
    assert said[1] == pytest.approx(0.08, abs=0.03)
    assert said[2] < FROM < ALL <= said[3]


def test_points_stay_where_they_are_unless_noise_moves_them():
    for noise in (0.0, 0.3):
        index = build_index(block(noise).cloud.xyz)
        assert smoothed(index) is index
    scene = block(1.0)
    index = build_index(scene.cloud.xyz)
    moved = smoothed(index).by_point()
    flat = metrics.nearest(scene.noise_free, scene.edges.positions).distances[:, 0] > 5 * scene.spacing
    before, after = (
        np.sqrt((((xyz - scene.noise_free) * scene.normals).sum(axis=1)[flat] ** 2).mean())
        for xyz in (scene.cloud.xyz, moved)
    )
    assert before == pytest.approx(scene.spacing, rel=0.1)
    assert after < before / 2
    np.testing.assert_array_equal(index.by_point(), scene.cloud.xyz)


def test_creases_are_found_in_noise_of_a_spacing():
    scene = block(1.0, spacing=1.6)
    found = edgel.detect(scene.cloud)
    true = scene.edges.positions[scene.edges.dihedral > np.radians(25)]
    reached = metrics.nearest(true, scene.noise_free[found.index]).distances[:, 0] <= 2.5 * scene.spacing
    astray = metrics.nearest(scene.noise_free[found.index], true).distances[:, 0] > 2.5 * scene.spacing
    assert reached.mean() >= 0.85  # 0.64 where nothing is smoothed
    assert astray.mean() <= 0.12
    assert np.isfinite(found.position).all()


def test_statistics_hang_neither_on_the_sample_nor_on_what_is_far():
    index = build_index(block(0.1, spacing=0.9).cloud.xyz)
    assert len(index) > 20_000
    places = index.sampled(5_000)
    assert len(places) == pytest.approx(5_000, rel=0.1)
    assert (np.diff(places) > 0).all()
    # Chosen by coordinates alone: of half of the cloud the same points, and about as many more.
    near = np.ascontiguousarray(index.xyz.T[index.xyz[0] < np.median(index.xyz[0])])
    half = build_index(near)
    same = {tuple(p) for p in index.at(places)} & {tuple(p) for p in near}
    assert same <= {tuple(p) for p in half.at(half.sampled(5_000))}
    said = cloud_statistics(index).features
    assert (np.abs(said / STEPS - np.round(said / STEPS)) < 1e-5).all()
    most = index.xyz.T[index.xyz[0] > np.quantile(index.xyz[0], 0.01)]
    np.testing.assert_array_equal(cloud_statistics(build_index(np.ascontiguousarray(most))).features, said)
