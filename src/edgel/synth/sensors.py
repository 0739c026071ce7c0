"""Views as real sensors give them: depth in steps, errors alike in neighbouring pixels, steps that bleed, shadows.

Triangulating sensors (structured light, stereo) measure a disparity ``d = f b / z``, in pixels, by matching windows of
two pictures (K. Khoshelham and S. Elberink, Accuracy and Resolution of Kinect Depth Data for Indoor Mapping
Applications, Sensors 12(2), 2012, doi:10.3390/s120201437): its error is alike over a window, it is rounded to a part of
a pixel, and what only one of both eyes sees is lost. A spinning laser measures a range; where its beam falls on both
sides of a step, it gives something between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from edgel.edges import EdgeKind
from edgel.synth.solid import Solid
from edgel.synth.truth import Scene
from edgel.synth.view import view

_STEEPEST = 4.0  # pixels of depth for one across (76 degrees): more is no surface to match along
_HIDDEN = 0.5  # pixels of disparity by which the second eye's sight must be blocked


@dataclass(frozen=True)
class Sensor:
    """What a sensor does to depth.

    Attributes
    ----------
    baseline : float
        Distance between both eyes, in distances to the middle of what is seen; 0: a spinning laser, which measures the
        range.
    steps : int
        Levels of disparity in a pixel; 0: not rounded.
    noise : float
        Standard deviation of the error: of the disparity, pixels; of a laser's range, spacings.
    window : int
        Side of the window that is matched, pixels, an odd number: disparities are means over it, and errors are alike.
    bleed : float
        Farthest that the near side of a step in depth spreads over the far one, pixels.
    mixed : float
        Share of the pixels on the far side of a step, next to the near one, that lie between both, 0 to 1; of a laser,
        steps along its rings.

    Raises
    ------
    ValueError
        If a number is out of its range.
    """

    baseline: float = 0.0
    steps: int = 0
    noise: float = 0.0
    window: int = 1
    bleed: float = 0.0
    mixed: float = 0.0

    def __post_init__(self) -> None:
        for name in ("baseline", "steps", "noise", "bleed"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"{name}: expected a number of 0 or more, got {getattr(self, name)}")
        if self.window < 1 or self.window % 2 == 0:
            raise ValueError(f"window: expected an odd number of pixels, got {self.window}")
        if not 0 <= self.mixed <= 1:
            raise ValueError(f"mixed: expected a share of 0 to 1, got {self.mixed}")
        if self.baseline == 0 and (self.steps or self.window > 1):
            raise ValueError("baseline: a sensor with steps or a window matches two pictures; give their distance")


SENSORS = {
    "kinect": Sensor(baseline=0.09, steps=8, noise=0.08, window=9, bleed=2.0, mixed=0.1),
    "stereo": Sensor(baseline=0.12, steps=16, noise=0.12, window=5, bleed=2.0, mixed=0.2),
    "spinning": Sensor(noise=0.3, mixed=0.5),
}
"""Sensors by name: Kinect and PrimeSense (75 mm, 1/8 pixel, 9 x 9 pixels, errors of one half to one step), a projecting
stereo camera (Ensenso: 100 mm, 1/16 pixel, 5 x 5 pixels, errors of two steps), both at 0.8 m, as frames of theirs show
on flat faces; and a spinning laser of 16 rings (11 mm at 3 m, the beam about as wide as its shots are apart)."""


def sense(
    solid: Solid,
    sensor: Sensor,
    *,
    spacing: float,
    seed: int = 0,
    direction: Sequence[float] = (-0.48, 0.66, -0.58),
    roll: float = 0.2,
) -> Scene:
    """See a solid from one place with a real sensor's errors.

    It is the pinhole `view` of the solid, a laser's the spherical one, with its truth; only the cloud and the depth map
    are other: along their rays points are moved, and lost where one of both eyes sees nothing.

    Parameters
    ----------
    solid : Solid
    sensor : Sensor
        One of `SENSORS`, or another.
    spacing : float
        Root of the area per point, mm, wanted on average over what is seen.
    seed : int
        Of all errors: same seed, same bytes.
    direction, roll
        Where the sensor looks, see `view`.

    Raises
    ------
    ValueError
        If an option is out of its range.

    Examples
    --------
    >>> from edgel import synth
    >>> scene = synth.sense(synth.frustum(), synth.SENSORS["kinect"], spacing=1.0)
    >>> len(set(scene.depth[scene.depth > 0])) < 1000  # of 4,000 pixels: depth comes in steps
    True
    """
    projection = "pinhole" if sensor.baseline else "spherical"
    seen = view(solid, projection=projection, spacing=spacing, direction=direction, roll=roll)
    depth = seen.depth
    assert depth is not None
    rng = np.random.default_rng(seed)
    kind = seen.point_kind.reshape(depth.shape)
    if sensor.baseline:
        measured = _triangulated(depth, kind, focal_length(seen), sensor, rng)
    else:
        measured = _ranged(depth, kind, seen.spacing, sensor, rng)
    xyz = seen.noise_free * (measured / depth).reshape(-1, 1)
    name = f"{solid.name}/{next((name for name, one in SENSORS.items() if one == sensor), 'sensor')}"
    return replace(seen, name=name, cloud=replace(seen.cloud, xyz=xyz), depth=measured)


def _triangulated(
    depth: np.ndarray, kind: np.ndarray, focal: float, sensor: Sensor, rng: np.random.Generator
) -> np.ndarray:
    """Depth (H, W), mm, by the disparity of two eyes; NaN where there is none."""
    baseline = sensor.baseline * float(np.nanmedian(depth))
    across = focal * baseline  # disparity times depth
    true = across / depth
    front, reach = _fronts(depth, kind, int(np.ceil(sensor.bleed)) + 1, (0, 1))
    edge = sensor.bleed * np.clip(0.5 + 0.5 * _alike(depth.shape, sensor.window, rng), 0, 1)
    bled = np.where(reach <= edge, across / front, true)
    error = sensor.noise * _alike(depth.shape, sensor.window, rng)
    found = _means(bled, sensor.window, _STEEPEST * baseline / depth) + error
    flying = (reach - 1 <= edge) & (edge < reach) & (rng.random(depth.shape) < sensor.mixed)
    share = rng.random(depth.shape)
    between = share * across / front + (1 - share) * true
    found = np.where(flying, between, found)
    if sensor.steps:
        found = np.round(found * sensor.steps) / sensor.steps
    found[_shadow(true) | ~(found > 0)] = np.nan
    return across / found


def _ranged(
    depth: np.ndarray, kind: np.ndarray, spacing: float, sensor: Sensor, rng: np.random.Generator
) -> np.ndarray:
    """Range (H, W), mm, by a laser whose rings are the rows; NaN for misses."""
    front, reach = _fronts(depth, kind, 1, (1,))
    measured = depth + sensor.noise * spacing * rng.standard_normal(depth.shape)
    flying = (reach == 1) & (rng.random(depth.shape) < sensor.mixed)
    share = rng.random(depth.shape)
    return np.where(flying, share * front + (1 - share) * depth, measured)


def focal_length(seen: Scene) -> float:
    """Focal length of a pinhole view, pixels, from how far neighbouring rays are apart."""
    rays = (seen.noise_free[:, 0] / seen.noise_free[:, 2]).reshape(seen.cloud.shape)
    return 1 / float(np.nanmedian(np.diff(rays, axis=1)))


def _fronts(depth: np.ndarray, kind: np.ndarray, most: int, axes: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """How deep the near side is of the step that a pixel is beyond, and how many pixels away; inf beyond `most`.

    Looked for along the axes, from the step outward; views have an empty frame, so that nothing reaches around.
    """
    front, step = np.full(depth.shape, np.nan), np.full(depth.shape, np.nan)
    reach = np.full(depth.shape, np.inf)
    before = np.where((kind & int(EdgeKind.OCCLUDING)) > 0, depth, np.nan)
    reachable = (kind & int(EdgeKind.OCCLUDED)) > 0
    for pixels in range(1, most + 1):
        steps = step.copy()
        for axis in axes:
            for way in (-1, 1):
                beside = np.roll(before, way, axis)
                gap = depth - beside if pixels == 1 else np.roll(steps, way, axis)
                # The far side goes on as long as a pixel is nearer to it than to the near one.
                new = reachable & (depth - beside > gap / 2) & ~(front <= beside)
                front[new], step[new], reach[new] = beside[new], gap[new], pixels
        before, reachable = front.copy(), np.isinf(reach)
    return front, reach


def _alike(shape: tuple[int, ...], window: int, rng: np.random.Generator) -> np.ndarray:
    """A field (H, W) of mean 0 and standard deviation 1, each the sum of a window of independent numbers."""
    white = rng.standard_normal((shape[0] + window - 1, shape[1] + window - 1))
    sums = np.lib.stride_tricks.sliding_window_view(white, (window, window)).sum(axis=(2, 3))
    return sums / window


def _means(values: np.ndarray, window: int, steepest: np.ndarray) -> np.ndarray:
    """Mean of each value's window over pairs of opposite pixels that differ from it by at most `steepest` a pixel.

    Pairs, so that a plane stays one up to its rim.
    """
    half = window // 2
    padded = np.pad(values, half, constant_values=np.nan)
    offsets = [(row, column) for row in range(-half, half + 1) for column in range(-half, half + 1)]
    total, count = values.copy(), np.ones_like(values)
    for row, column in offsets[: len(offsets) // 2]:
        pair = [
            padded[half + y : half + y + values.shape[0], half + x : half + x + values.shape[1]]
            for y, x in ((row, column), (-row, -column))
        ]
        with np.errstate(invalid="ignore"):
            same = np.maximum(*(np.abs(beside - values) for beside in pair)) <= steepest * max(abs(row), abs(column))
        total[same] += (pair[0] + pair[1])[same]
        count += 2 * same
    return total / count


def _shadow(disparity: np.ndarray) -> np.ndarray:
    """Pixels (H, W) that the second eye, right of the first, does not see: something further right is before them."""
    columns = np.arange(disparity.shape[1])
    there = np.where(np.isfinite(disparity), columns - disparity, np.inf)
    ahead = np.minimum.accumulate(there[:, ::-1], axis=1)[:, ::-1]
    return np.isfinite(there) & (ahead < there - _HIDDEN)
