"""Outlines seen from a view: rims against nothing, and the near and far side of every step in depth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._kernels.hysteresis import levels
from edgel._kernels.parallel import kernel, run_slices
from edgel._range_image.facets import local_planes, noise_level, without_isolated
from edgel._range_image.range_image import RangeImage
from edgel.edges import EdgeKind

STEP = 2.0  # spacings: least break of the surface between two pixels
LEVELS = 3.0  # and least break in levels to which the sensor rounds depths
GAP = 2.0  # spacings: least difference of their depths
LEAST_GAP = 0.6  # spacings: where neighbours' depths differ by less, even a faint step is ruled out
SURE = 6.0  # standard deviations by which a break exceeds what noise explains
WEAK = 2 / 3  # of all that, where a break continues a sure one
CHAIN = 4  # times the reach of the windows, in pixels: chains of both sides that are shorter are specks
FINEST = 0.02  # spacings: least noise; without any, rounding would choose among windows
BRIDGE = 2  # pixels: a hole no wider is bridged
STRAY = 0.7  # spacings, beside 4 deviations, off all planes around: a point floating alone
_FEWEST_LEVELS = 64


@dataclass(frozen=True, eq=False)
class Outline:
    """What of a cloud is an outline.

    Attributes
    ----------
    kind : (N,) uint8
        `EdgeKind` flags BOUNDARY, OCCLUDING, OCCLUDED of each point.
    strength : (N,) float64
        In (0, 1] where there is a flag, else 0; one half where a break just counts.
    """

    kind: np.ndarray
    strength: np.ndarray


def outlines(image: RangeImage, xyz: np.ndarray) -> Outline:
    """Find the outlines of a cloud in a view.

    Each pixel is given a plane of its own side of whatever edge is near. Where the planes of two neighbours (of 4, a
    hole of up to `BRIDGE` pixels between them) leave a step that neither plane's slope explains, the near point is
    OCCLUDING and the far one OCCLUDED. Pixels beside a wider hole are BOUNDARY.

    Parameters
    ----------
    image : RangeImage
    xyz : (N, 3) float64
        The points it was made of.

    Examples
    --------
    >>> import numpy as np
    >>> from edgel._range_image.range_image import orthographic
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(20.0))
    >>> stair = np.c_[x.ravel(), y.ravel(), 10.0 * (x.ravel() < 15)]
    >>> found = outlines(orthographic(stair, np.array([0, 0, -1])), stair)
    >>> [sorted(set(stair[(found.kind & side) > 0, 0].tolist())) for side in (EdgeKind.OCCLUDING, EdgeKind.OCCLUDED)]
    [[14.0], [15.0]]
    """
    step, side, rim, reach = _steps_and_rims(image, xyz)
    level = levels(step, WEAK, CHAIN * reach)
    kind = np.where(level > 0, side, 0) | np.where(rim, EdgeKind.BOUNDARY, 0)
    strength = np.where(rim, 1.0, level / (1 + level))
    shown = image.index >= 0
    flags, strengths = np.zeros(len(xyz), np.uint8), np.zeros(len(xyz))
    flags[image.index[shown]], strengths[image.index[shown]] = kind[shown], strength[shown]
    return Outline(flags, strengths)


def _steps_and_rims(image: RangeImage, xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """What `depth_steps` says of all pixels, which lie beside a void, and the reach of the windows of the planes."""
    perspective = image.viewpoint is not None
    rounding = LEVELS * _by_pixel(image, level_gaps(xyz, image.direction))
    spacing = image.spacing
    least = np.maximum(STEP * spacing, rounding)
    noise = np.fmax(noise_level(image), FINEST * spacing)
    depth = without_isolated(image.depth, spacing, noise)
    rim = beside_void(image.depth) & ~np.isnan(depth)
    # Noise is averaged over as few pixels as it allows: edges are seldom straight for long.
    known = ~np.isnan(spacing)
    level = float(np.median(noise[known] / spacing[known])) if known.any() else 0.0
    reach = 3 if level < 0.15 else 4 if level < 0.5 else 5
    wanted = np.flatnonzero(beside_gap(depth, LEAST_GAP * spacing))
    planes = local_planes(depth, noise, wanted, perspective, reach)
    astray = np.zeros(depth.shape, bool)
    off = np.abs(depth.ravel()[wanted] - planes[:, 0])
    astray.ravel()[wanted] = off > planes[:, 4] + STRAY * spacing.ravel()[wanted]
    depth[astray] = np.nan
    touched = astray
    for _ in range(2 * reach):  # as far as any window reaches
        touched = _widened(touched)
    again = np.flatnonzero(touched & beside_gap(depth, LEAST_GAP * spacing))
    planes = np.concatenate([planes, local_planes(depth, noise, again, perspective, reach)])
    latest = np.full(depth.shape, -1, np.int32)
    latest.ravel()[np.concatenate([wanted, again])] = np.arange(len(planes))
    step, side = depth_steps(depth, latest, planes, spacing, least, perspective)
    return step, side, rim, reach


def level_gaps(xyz: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """How far apart the levels are that a sensor rounds depths to, at each point; (N,) float64.

    Structured light and stereo give the coordinate along the optical axis in levels that lie farther apart with the
    distance. Where coordinates are not rounded, levels are as close as points are many.
    """
    along = xyz[:, np.argmax(np.abs(direction))]
    levels, which = np.unique(along, return_inverse=True)
    if len(levels) < _FEWEST_LEVELS:  # floors, not rounding
        return np.zeros(len(xyz))
    places = np.arange(len(levels))
    low, high = np.maximum(places - 2, 0), np.minimum(places + 2, len(levels) - 1)
    return ((levels[high] - levels[low]) / (high - low))[which]


def _by_pixel(image: RangeImage, values: np.ndarray) -> np.ndarray:
    of_pixels = np.full(image.shape, np.nan)
    of_pixels[image.index >= 0] = values[image.index[image.index >= 0]]
    return of_pixels


def depth_steps(
    depth: np.ndarray,
    which: np.ndarray,
    planes: np.ndarray,
    spacing: np.ndarray,
    least: np.ndarray,
    perspective: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Compare each pixel's plane, that of number `which` (H, W; -1: none), with those of its 4 neighbours.

    Returns
    -------
    (H, W) float64
        The largest step, in multiples of the least that counts.
    (H, W) uint8
        `EdgeKind` flag of the side that the pixel lies on.
    """
    step, side = np.zeros(depth.shape), np.zeros(depth.shape, np.uint8)
    run_slices(_steps, len(depth), depth, which, planes, spacing, least, perspective, step, side, size=32)
    return step, side


def beside_gap(depth: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Pixels beside a hole, or beside a depth that differs by `least` (H, W) or more; (H, W) bool."""
    wanted = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        first, second, own = (np.moveaxis(image, axis, 0) for image in (depth, least, wanted))
        apart = ~(np.abs(np.diff(first, axis=0)) < np.fmin(second[:-1], second[1:]))
        own[:-1] |= apart
        own[1:] |= apart
    return wanted & ~np.isnan(depth)


def beside_void(depth: np.ndarray) -> np.ndarray:
    """Pixels next to a hole that is wider than `BRIDGE` pixels; (H, W) bool."""
    hole = np.isnan(depth)
    void = ~_shifted(~hole, 1)  # upper left pixels of the squares of side BRIDGE + 1 that are all hole
    void[-BRIDGE:], void[:, -BRIDGE:] = False, False
    void = _shifted(void, -1)
    for _ in range(BRIDGE):  # squares leave the corners of a void out: give them back, but no cracks
        void = _widened(void) & hole
    return _widened(void) & ~hole


def _shifted(mask: np.ndarray, way: int) -> np.ndarray:
    """Whether any pixel of the square of side `BRIDGE` + 1 to the lower right is set (`way` -1: to the upper left)."""
    for axis in (0, 1):
        ahead = np.moveaxis(mask, axis, 0)[::way]
        out = ahead.copy()
        for shift in range(1, BRIDGE + 1):
            out[:-shift] |= ahead[shift:]
        mask = np.moveaxis(out[::way], 0, axis)
    return mask


def _widened(mask: np.ndarray) -> np.ndarray:
    """Set the pixels above, below, left and right too."""
    out = mask.copy()
    out[1:] |= mask[:-1]
    out[:-1] |= mask[1:]
    out[:, 1:] |= mask[:, :-1]
    out[:, :-1] |= mask[:, 1:]
    return out


@kernel
def _steps(start, stop, depth, which, planes, spacing, least, perspective, step, side):
    height, width = depth.shape
    for row in range(start, stop):
        for col in range(width):
            own = depth[row, col]
            if math.isnan(own) or which[row, col] < 0:
                continue
            p = planes[which[row, col]]
            for way in range(4):
                dr, dc = (0, 1, 0, -1)[way], (1, 0, -1, 0)[way]
                apart = 1
                r, c = row + dr, col + dc
                while apart <= BRIDGE and 0 <= r < height and 0 <= c < width and math.isnan(depth[r, c]):
                    r, c, apart = r + dr, c + dc, apart + 1
                if not (0 <= r < height and 0 <= c < width) or math.isnan(depth[r, c]) or which[r, c] < 0:
                    continue
                q = planes[which[r, c]]
                here = apart * (p[1] * dr + p[2] * dc)
                there = -apart * (q[1] * dr + q[2] * dc)
                if perspective:
                    here = here / max(1 - here / p[0], 0.1)
                    there = there / max(1 - there / q[0], 0.1)
                gap = q[0] - p[0]
                # Seen from either pixel: planes that merely cross between the two, at a fold, are no step.
                sign = 1.0 if gap > 0 else -1.0
                jump = sign * gap - max(sign * here, -sign * there, 0.0)
                near = min(spacing[row, col], spacing[r, c])
                sure = jump / max(least[row, col], least[r, c], SURE * math.sqrt(p[3] + q[3]))
                sure = min(sure, abs(gap) / (GAP * near))
                if sure > step[row, col]:
                    step[row, col] = sure
                    side[row, col] = 2 if gap > 0 else 4
