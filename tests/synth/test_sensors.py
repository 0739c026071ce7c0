"""Simulated sensors: depth comes in steps, errors are alike over a window, steps bleed, lasers mix, truth stays."""

from dataclasses import replace

import numpy as np
import pytest

from edgel import synth
from edgel.edges import EdgeKind
from edgel.synth.sensors import focal_length
from edgel.synth.view import view

PLANE, BLOCK = synth.plane(), synth.stepped_block()
KINECT, STEREO, SPINNING = (synth.SENSORS[name] for name in ("kinect", "stereo", "spinning"))
OBLIQUE = {"direction": (0.3, 0.2, -0.9), "roll": 0.3}


def depth_of(scene):
    assert scene.depth is not None
    return scene.depth


def clean(solid, sensor, spacing, **pose):
    """The same view without any error."""
    return view(solid, projection="pinhole" if sensor.baseline else "spherical", spacing=spacing, **pose)


def disparity(scene, seen, sensor):
    return focal_length(seen) * sensor.baseline * np.nanmedian(depth_of(seen)) / depth_of(scene)


def steps(seen):
    """Pixels on the far side of a step along rows or columns, next to one on its near side."""
    depth, kind = depth_of(seen), seen.point_kind.reshape(depth_of(seen).shape)
    near, far = (kind & int(EdgeKind.OCCLUDING)) > 0, (kind & int(EdgeKind.OCCLUDED)) > 0
    beside = np.zeros_like(far)
    for axis in (0, 1):
        for way in (-1, 1):
            beside |= far & np.roll(near, way, axis) & (np.roll(depth, way, axis) < depth)
    return beside


@pytest.mark.parametrize("name", synth.SENSORS)
def test_the_truth_stays_and_points_move_along_their_rays(name):
    sensor = synth.SENSORS[name]
    scene, seen = synth.sense(BLOCK, sensor, spacing=1.0), clean(BLOCK, sensor, 1.0)
    for field in ("point_kind", "normals", "noise_free", "outlier", "pose"):
        assert getattr(scene, field).tobytes() == getattr(seen, field).tobytes()
    for field in type(seen.edges).__dataclass_fields__:
        assert getattr(scene.edges, field).tobytes() == getattr(seen.edges, field).tobytes()
    assert scene.cloud.shape == seen.cloud.shape
    assert scene.name == f"stepped_block/{name}"
    finite = np.isfinite(scene.cloud.xyz[:, 0])
    moved, still = scene.cloud.xyz[finite], seen.cloud.xyz[finite]
    assert 0.95 < finite.sum() / np.isfinite(seen.cloud.xyz[:, 0]).sum() <= 1
    assert np.abs(np.cross(moved, still)).max() < 1e-6 * np.linalg.norm(still, axis=1).max() ** 2
    found = np.linalg.norm(moved, axis=1) if name == "spinning" else moved[:, 2]
    np.testing.assert_allclose(found, depth_of(scene).ravel()[finite])


def test_the_seed_decides():
    first, again, other = (synth.sense(BLOCK, STEREO, spacing=2.0, seed=seed).cloud.xyz for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_a_sensor_without_errors_is_the_view():
    for sensor in (synth.Sensor(), synth.Sensor(baseline=0.05)):
        scene, seen = synth.sense(PLANE, sensor, spacing=2.0, **OBLIQUE), clean(PLANE, sensor, 2.0, **OBLIQUE)
        np.testing.assert_allclose(scene.cloud.xyz, seen.cloud.xyz, atol=1e-9)
        assert scene.name == "plane/sensor"


@pytest.mark.parametrize("sensor", [KINECT, STEREO], ids=["kinect", "stereo"])
def test_levels_are_equally_spaced_in_inverse_depth(sensor):
    scene, seen = synth.sense(BLOCK, sensor, spacing=1.0), clean(BLOCK, sensor, 1.0)
    levels = sensor.steps * disparity(scene, seen, sensor)
    levels = levels[np.isfinite(levels)]
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-6)
    assert 30 < len(np.unique(np.round(levels))) < 1000


def test_steps_of_a_kinect_are_as_published():
    """Two levels at z are ``z^2 / (8 f b)`` apart: 2 mm at 0.8 m, where pixels are 1.5 mm apart (f = 525)."""
    seen = clean(PLANE, KINECT, 1.0, **OBLIQUE)
    focal, middle = focal_length(seen), np.nanmedian(depth_of(seen))
    step = middle**2 / (8 * focal * KINECT.baseline * middle)
    assert step / (middle / focal) == pytest.approx(2.0 / (800 / 525), rel=0.1)


def test_errors_are_as_large_as_said_and_alike_over_the_window():
    sensor = replace(KINECT, steps=0)
    residuals = []
    for seed in range(6):
        scene, seen = (
            synth.sense(PLANE, sensor, spacing=0.7, seed=seed, **OBLIQUE),
            clean(PLANE, sensor, 0.7, **OBLIQUE),
        )
        residuals.append(disparity(scene, seen, sensor) - disparity(seen, seen, sensor))
    errors = np.array(residuals)
    assert np.nanstd(errors) == pytest.approx(sensor.noise, rel=0.1)
    assert abs(np.nanmean(errors)) < 0.1 * sensor.noise
    for lag in (1, 3, 6, 9, 12):  # a window of w pixels that moves on by k shares 1 - k / w with where it was
        alike = np.nanmean(errors[:, :, :-lag] * errors[:, :, lag:]) / np.nanmean(errors**2)
        assert alike == pytest.approx(max(0, 1 - lag / sensor.window), abs=0.1)


def test_a_window_rounds_creases_and_leaves_planes():
    sensor = synth.Sensor(baseline=0.09, window=9)
    flat, seen = synth.sense(PLANE, sensor, spacing=1.0, **OBLIQUE), clean(PLANE, sensor, 1.0, **OBLIQUE)
    np.testing.assert_allclose(flat.cloud.xyz, seen.cloud.xyz, atol=1e-6)
    scene, seen = synth.sense(BLOCK, sensor, spacing=1.0), clean(BLOCK, sensor, 1.0)
    crease = (seen.point_kind & int(EdgeKind.CREASE)) > 0
    off = np.linalg.norm(scene.cloud.xyz - seen.cloud.xyz, axis=1)
    assert np.nanmedian(off[crease]) > 0.5
    assert np.nanmedian(off[~crease]) < 0.1


def test_flying_pixels_of_a_laser_lie_between_both_sides():
    sensor = synth.Sensor(mixed=0.5)
    scene, seen = synth.sense(BLOCK, sensor, spacing=0.5), clean(BLOCK, sensor, 0.5)
    depth, measured = depth_of(seen), depth_of(scene)
    moved = np.isfinite(depth) & (np.abs(measured - depth) > 1e-9)
    assert moved.any()
    assert not (moved & ~steps(seen)).any()
    near = np.fmin(np.roll(depth, 1, axis=1), np.roll(depth, -1, axis=1))  # its rings are the rows
    assert (measured[moved] > near[moved]).all()
    assert (measured[moved] < depth[moved]).all()
    along = steps(seen) & (depth - near > 2 * seen.spacing)
    assert moved.sum() / along.sum() == pytest.approx(0.5, abs=0.15)


def test_the_near_side_bleeds_over_the_far_one():
    sensor = synth.Sensor(baseline=0.02, bleed=3.0)
    scene, seen = synth.sense(BLOCK, sensor, spacing=0.5), clean(BLOCK, sensor, 0.5)
    nearer = depth_of(seen) - depth_of(scene) > 2 * seen.spacing
    assert nearer.sum() > steps(seen).sum() / 2
    reach = steps(seen)
    for _ in range(3):
        padded = np.pad(reach, 1)
        reach = reach | padded[2:, 1:-1] | padded[:-2, 1:-1] | padded[1:-1, 2:] | padded[1:-1, :-2]
    assert not (nearer & ~reach).any()
    assert not (depth_of(scene) - depth_of(seen) > 1e-6).any()


def test_what_the_second_eye_does_not_see_is_lost_beside_the_near_side():
    seen = clean(BLOCK, STEREO, 0.5)
    lost = [
        np.isfinite(depth_of(seen))
        & np.isnan(depth_of(synth.sense(BLOCK, synth.Sensor(baseline=baseline), spacing=0.5)))
        for baseline in (0.05, 0.2)
    ]
    assert 0 < lost[0].sum() < lost[1].sum() < 0.2 * lost[1].size
    assert not (lost[0] & ~lost[1]).any()
    rows, columns = np.nonzero(lost[0])
    for row, column in zip(rows, columns, strict=True):  # something nearer stands to the right
        assert np.nanmin(depth_of(seen)[row, column:]) < depth_of(seen)[row, column]


def test_noise_of_a_laser():
    scene, seen = synth.sense(PLANE, SPINNING, spacing=1.0, **OBLIQUE), clean(PLANE, SPINNING, 1.0, **OBLIQUE)
    errors = depth_of(scene) - depth_of(seen)
    assert np.nanstd(errors) == pytest.approx(SPINNING.noise, rel=0.05)
    beside = np.nanmean(errors[:, 1:] * errors[:, :-1]) / np.nanmean(errors**2)
    assert abs(beside) < 0.05


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, value) for name in ("baseline", "steps", "noise", "bleed") for value in (-1, np.nan)),
        *(("window", value) for value in (0, 2, -3)),
        *(("mixed", value) for value in (-0.1, 1.1)),
    ],
)
def test_bad_sensors_are_named(name, value):
    with pytest.raises(ValueError, match=f"{name}: "):
        synth.Sensor(**{"baseline": 0.1, name: value})


def test_a_laser_matches_no_pictures():
    with pytest.raises(ValueError, match="baseline: "):
        synth.Sensor(window=5)


def test_bad_spacings_are_named():
    with pytest.raises(ValueError, match="spacing: "):
        synth.sense(PLANE, KINECT, spacing=0.0)
