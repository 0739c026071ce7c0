"""Near and far sides of outlines found on the surface."""

import numpy as np

import edgel
from edgel import EdgeKind, synth
from edgel._range_image.near_far import sides

DOWN = np.array([0.0, 0.0, -1.0])


def test_a_list_that_one_direction_explains_has_near_and_far_sides():
    scene = synth.scan(synth.stepped_block(), pitch=1.2, noise=0.0)
    shaken = scene.cloud.xyz + np.random.default_rng(0).uniform(-0.4, 0.4, scene.cloud.xyz.shape) * (1, 1, 0)
    found = edgel.detect(shaken)
    assert found.method == "surface"
    kind = np.zeros(len(shaken), int)
    kind[found.index] = found.kind
    for flag in (EdgeKind.OCCLUDING, EdgeKind.OCCLUDED):
        mine = (kind & flag) > 0
        assert mine.sum() > 50
        true = scene.noise_free[(scene.point_kind & flag) > 0]
        near = np.linalg.norm(shaken[mine][:, None] - true[None], axis=2).min(axis=1)
        assert (near < 3 * scene.spacing).mean() > 0.95


def test_a_closed_solid_has_none():
    cloud = synth.sample(synth.stepped_block(), spacing=3.0, seed=0).cloud
    kind = edgel.detect(cloud).kind
    assert not (kind & (EdgeKind.OCCLUDING | EdgeKind.OCCLUDED)).any()
    assert (sides(cloud.xyz, DOWN, np.arange(50), 1.0) == EdgeKind.BOUNDARY).all()


def test_steep_slopes_are_no_steps():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 60, (2, 3000))
    slope = np.column_stack([x, y, 1.5 * x])
    assert (sides(slope, DOWN, np.arange(3000), 1.0) == EdgeKind.BOUNDARY).mean() > 0.99
