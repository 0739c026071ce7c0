"""Outlines seen from a view: rims against nothing, and the near and far side of every step in depth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel.canny import hysteresis
from edgel.edges import EdgeKind
from edgel.parallel import kernel, run_slices
from edgel.raster import Raster

STEP = 2.0  # spacings: least break of the surface between two pixels
LEVELS = 3.0  # and of the levels to which the sensor rounds depths
GAP = 2.0  # spacings: least difference of their depths
SURE = 6.0  # standard deviations by which a break exceeds what noise explains
WEAK = 4.0  # and where it continues one that does
CHAIN = 8  # pixels: shorter chains, both sides together, are specks
BRIDGE = 2  # pixels: a hole no wider is bridged
SECTORS = 16
HALF, QUARTER = 7, 3  # sectors of a window that fits on one side of any straight edge, and into any right angle
STRAY = 0.7  # spacings, beside `_STRAY_SIGMAS` deviations, off all planes around: a point floating alone
_STRAY_SIGMAS = 4.0
PREFER = (0.0, 0.1, 0.3)
_FEWEST_LEVELS = 64
_CLOSE = 3.0  # spacings, and standard deviations, within which neighbours hold a pixel


@dataclass(frozen=True, eq=False)
class Outline:
    """What of a cloud is an outline.

    Attributes
    ----------
    kind : (N,) uint8
        `EdgeKind` flags BOUNDARY, OCCLUDING, OCCLUDED of each point.
    strength : (N,) float64
        In (0, 1] where there is a flag, else 0.
    """

    kind: np.ndarray
    strength: np.ndarray


def outline_kinds(raster: Raster, xyz: np.ndarray) -> Outline:
    """Find the outlines of a cloud in a view.

    Each pixel is given a plane of its own side of whatever edge is near. Where the planes of two neighbours (of 4, a
    hole of up to `BRIDGE` pixels between them) leave a step that neither plane's slope explains, the near point is
    OCCLUDING and the far one OCCLUDED. Pixels beside a wider hole are BOUNDARY.

    Parameters
    ----------
    raster : Raster
    xyz : (N, 3) float64
        The points it was made of.

    Examples
    --------
    >>> import numpy as np
    >>> from edgel.raster import orthographic
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(20.0))
    >>> stair = np.c_[x.ravel(), y.ravel(), 10.0 * (x.ravel() < 15)]
    >>> found = outline_kinds(orthographic(stair, np.array([0, 0, -1])), stair)
    >>> [sorted(set(stair[(found.kind & side) > 0, 0].tolist())) for side in (EdgeKind.OCCLUDING, EdgeKind.OCCLUDED)]
    [[14.0], [15.0]]
    """
    num_points = len(xyz)
    perspective = raster.viewpoint is not None
    spacing = raster.spacing
    noise = noise_level(raster)
    depth = without_lonely(raster.depth, spacing, noise)
    held = ~np.isnan(depth)
    level = np.nanmedian(noise / spacing)
    reach = 3 if level < 0.15 else 4 if level < 0.5 else 5
    for _ in range(2):  # once more without the pixels that nothing around predicts
        planes = local_planes(depth, noise, perspective, reach)
        depth = np.where(np.abs(depth - planes[..., 0]) > planes[..., 4] + STRAY * spacing, np.nan, depth)
    least = np.maximum(STEP * spacing, LEVELS * _by_pixel(raster, level_gaps(xyz, raster.direction)))
    step, side = depth_steps(depth, planes, spacing, least, perspective)
    chained = without_specks(hysteresis(step, WEAK / SURE, 1.0))
    kind = np.where(chained, side, 0).astype(np.uint8)
    rim = beside_void(raster.depth) & held
    kind[rim] |= np.uint8(EdgeKind.BOUNDARY)
    shown = raster.index >= 0
    strength = np.where(rim, 1.0, np.where(chained, step / (1 + step), 0))
    flags, strengths = np.zeros(num_points, np.uint8), np.zeros(num_points)
    flags[raster.index[shown]], strengths[raster.index[shown]] = kind[shown], strength[shown]
    return Outline(flags, strengths)


def noise_level(raster: Raster, tile: int = 16) -> np.ndarray:
    """Standard deviation of the depth's noise around each pixel, (H, W) float64, in the cloud's unit.

    From second differences, which a plane does not have, by their median, which steps and outliers do not move.
    """
    depth = raster.depth
    height, width = depth.shape
    rows, cols = -(-height // tile), -(-width // tile)
    sums = np.full((2, *depth.shape), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        # On a plane seen from a viewpoint it is the inverse of the range that is linear in the pixels.
        flat = -1 / depth if raster.viewpoint is not None else depth
        scale = depth**2 if raster.viewpoint is not None else np.ones_like(depth)
    sums[0, 1:-1] = np.abs(flat[:-2] - 2 * flat[1:-1] + flat[2:]) * scale[1:-1]
    sums[1, :, 1:-1] = np.abs(flat[:, :-2] - 2 * flat[:, 1:-1] + flat[:, 2:]) * scale[:, 1:-1]
    least = np.fmin(sums[0], sums[1]) * 0 + (sums[0] + sums[1]) / 2
    padded = np.full((rows * tile, cols * tile), np.nan)
    padded[:height, :width] = least
    tiles = padded.reshape(rows, tile, cols, tile).transpose(0, 2, 1, 3).reshape(rows * cols, -1)
    known = np.isfinite(tiles).sum(axis=1) >= tile
    level = np.full(rows * cols, np.nan)
    if known.any():
        level[known] = np.nanmedian(tiles[known], axis=1)
        level[~known] = np.median(level[known])
    else:
        level[:] = 0.0
    # Median of the mean of two |d2|, each of deviation sqrt(6) sigma: 1.85 sigma.
    return np.repeat(np.repeat((level / 1.85).reshape(rows, cols), tile, axis=0), tile, axis=1)[:height, :width]


def without_lonely(depth: np.ndarray, spacing: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Drop pixels that fewer than 4 of their 24 neighbours hold: points floating alone."""
    kept = np.full(depth.shape, np.nan)
    run_slices(_held, len(depth), depth, _CLOSE * (spacing + noise), kept, size=32)
    return kept


def local_planes(depth: np.ndarray, noise: np.ndarray, perspective: bool, reach: int) -> np.ndarray:
    """Fit a plane to each pixel's own side of whatever edge is near.

    Returns
    -------
    (H, W, 5) float64
        Depth of the plane at the pixel, its slopes along rows and columns, and the variance of the fitted depth.
    """
    around = np.arange(-reach, reach + 1)
    dr, dc = (part.ravel() for part in np.meshgrid(around, around, indexing="ij"))
    inside = (dr**2 + dc**2 <= (reach + 0.3) ** 2) & ((dr != 0) | (dc != 0))
    dr, dc = dr[inside], dc[inside]
    sector = np.floor((np.arctan2(dr, dc) / (2 * np.pi) * SECTORS + 1e-9) % SECTORS).astype(np.int64)
    planes = np.full((*depth.shape, 5), np.nan)
    run_slices(_planes, len(depth), depth, noise, perspective, dr, dc, sector, planes, size=16)
    return planes


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


def _by_pixel(raster: Raster, values: np.ndarray) -> np.ndarray:
    return np.where(raster.index >= 0, values[raster.index], np.nan)


def depth_steps(
    depth: np.ndarray, planes: np.ndarray, spacing: np.ndarray, least: np.ndarray, perspective: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Compare each pixel's plane with those of its 4 neighbours.

    Returns
    -------
    (H, W) float64
        The largest step, in multiples of the least that counts.
    (H, W) uint8
        `EdgeKind` flag of the side that the pixel lies on.
    """
    step, side = np.zeros(depth.shape), np.zeros(depth.shape, np.uint8)
    run_slices(_steps, len(depth), depth, planes, spacing, least, perspective, step, side, size=32)
    return step, side


def without_specks(edges: np.ndarray) -> np.ndarray:
    """Drop chains (of 8-neighbours) of fewer than `CHAIN` pixels."""
    kept = np.zeros(edges.shape, np.bool_)
    _long_chains(np.pad(edges, 1), CHAIN, kept)
    return kept


def beside_void(depth: np.ndarray) -> np.ndarray:
    """Pixels next to a hole that is wider than `BRIDGE` pixels; (H, W) bool."""
    hole = np.isnan(depth)
    void = _grown(~_grown(~hole, BRIDGE, whole=True), BRIDGE, whole=True, lead=True) & hole
    for _ in range(BRIDGE):  # opening cuts the corners of voids: give them back, but no cracks
        void = _grown(void, 1) & hole
    return _grown(void, 1) & ~hole


def _grown(mask: np.ndarray, by: int, whole: bool = False, lead: bool = False) -> np.ndarray:
    """Widen a mask by one pixel up, down, left and right, or by squares of side `by` + 1."""
    out = mask.copy()
    if not whole:
        out[1:] |= mask[:-1]
        out[:-1] |= mask[1:]
        out[:, 1:] |= mask[:, :-1]
        out[:, :-1] |= mask[:, 1:]
        return out
    for axis in (0, 1):
        source = out.copy()
        for shift in range(1, by + 1):
            to, of = [slice(None)] * 2, [slice(None)] * 2
            to[axis], of[axis] = slice(shift, None), slice(None, -shift)
            if lead:
                to, of = of, to
            out[tuple(to)] |= source[tuple(of)]
    return out


@kernel
def _held(start, stop, depth, close, kept):
    height, width = depth.shape
    steps = np.empty(40)
    for row in range(start, stop):
        for col in range(width):
            own = depth[row, col]
            if math.isnan(own):
                continue
            top, left, bottom, right = max(row - 2, 0), max(col - 2, 0), min(row + 3, height), min(col + 3, width)
            tolerance, count = close[row, col], 0
            for attempt in range(2):
                count = -1
                for r in range(top, bottom):
                    for c in range(left, right):
                        if abs(depth[r, c] - own) <= tolerance:
                            count += 1
                if count >= 4 or attempt == 1:
                    break
                # Where the surface is steep, neighbours are farther away: as far as they are from each other.
                seen = 0
                for r in range(top, bottom):
                    for c in range(left, right):
                        if r + 1 < bottom and not math.isnan(depth[r + 1, c] - depth[r, c]):
                            steps[seen] = abs(depth[r + 1, c] - depth[r, c])
                            seen += 1
                        if c + 1 < right and not math.isnan(depth[r, c + 1] - depth[r, c]):
                            steps[seen] = abs(depth[r, c + 1] - depth[r, c])
                            seen += 1
                if seen == 0:
                    break
                tolerance += _CLOSE * np.median(steps[:seen])
            if count >= 4:
                kept[row, col] = own


@kernel
def _fit(m):
    """Plane v + a y + b x of moments n, x, y, xx, xy, yy, u, xu, yu, uu: v, a, b, residual sum, leverage at 0."""
    n = m[0]
    if n < 5:
        return 0.0, 0.0, 0.0, np.inf, 1.0
    mx, my, mu = m[1] / n, m[2] / n, m[6] / n
    xx, xy, yy = m[3] - m[1] * mx, m[4] - m[1] * my, m[5] - m[2] * my
    xu, yu, uu = m[7] - m[1] * mu, m[8] - m[2] * mu, m[9] - m[6] * mu
    det = xx * yy - xy * xy
    if det < 0.5:  # on a line
        return 0.0, 0.0, 0.0, np.inf, 1.0
    b, a = (xu * yy - yu * xy) / det, (yu * xx - xu * xy) / det
    rest = max(uu - b * xu - a * yu, 0.0)
    leverage = 1.0 / n + (mx * mx * yy - 2 * mx * my * xy + my * my * xx) / det
    return mu - b * mx - a * my, a, b, rest, leverage


@kernel
def _planes(start, stop, depth, noise, perspective, dr, dc, sector, planes):
    height, width = depth.shape
    sums, m = np.zeros((2 * SECTORS + 1, 10)), np.zeros(10)
    for row in range(start, stop):
        for col in range(width):
            own = depth[row, col]
            if math.isnan(own):
                continue
            sums[:] = 0.0
            for i in range(len(dr)):
                r, c = row + dr[i], col + dc[i]
                if r < 0 or r >= height or c < 0 or c >= width or math.isnan(depth[r, c]):
                    continue
                x, y = float(dc[i]), float(dr[i])
                u = depth[r, c] - own
                if perspective:
                    u *= own / depth[r, c]
                part = sums[sector[i] + 1]
                part[0] += 1.0
                part[1] += x
                part[2] += y
                part[3] += x * x
                part[4] += x * y
                part[5] += y * y
                part[6] += u
                part[7] += x * u
                part[8] += y * u
                part[9] += u * u
            for k in range(SECTORS):
                for j in range(10):
                    sums[SECTORS + 1 + k, j] = sums[1 + k, j]
            for k in range(1, 2 * SECTORS + 1):
                for j in range(10):
                    sums[k, j] += sums[k - 1, j]
            best = np.inf
            variance = noise[row, col] ** 2
            out = planes[row, col]
            out[0], out[1], out[2], out[3], out[4] = own, 0.0, 0.0, variance, 0.0
            for size in (SECTORS, HALF, QUARTER):
                for k in range(1 if size == SECTORS else SECTORS):
                    for j in range(10):
                        m[j] = sums[k + size, j] - sums[k, j]
                    m[0] += 1.0
                    v, a, b, rest, leverage = _fit(m)
                    if rest == np.inf:
                        continue
                    spread = max((rest + 4 * variance) / (m[0] - 3 + 4), variance)
                    score = spread * (1 + PREFER[0 if size == SECTORS else 1 if size == HALF else 2] + leverage) + v * v / 4
                    if score < best:
                        best = score
                        out[0], out[1], out[2], out[3] = own + v, a, b, spread * leverage
                        # By how much the pixel itself pulls its plane, it stays closer to it than others would.
                        out[4] = _STRAY_SIGMAS * math.sqrt(variance) * (1 - leverage)


@kernel
def _steps(start, stop, depth, planes, spacing, least, perspective, step, side):
    height, width = depth.shape
    for row in range(start, stop):
        for col in range(width):
            own = depth[row, col]
            if math.isnan(own):
                continue
            p = planes[row, col]
            for way in range(4):
                dr, dc = (0, 1, 0, -1)[way], (1, 0, -1, 0)[way]
                apart = 1
                r, c = row + dr, col + dc
                while apart <= BRIDGE and 0 <= r < height and 0 <= c < width and math.isnan(depth[r, c]):
                    r, c, apart = r + dr, c + dc, apart + 1
                if not (0 <= r < height and 0 <= c < width) or math.isnan(depth[r, c]):
                    continue
                q = planes[r, c]
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


@kernel
def _long_chains(padded, least, kept):
    """Copy the chains of at least `least` pixels; `padded` is emptied."""
    width = padded.shape[1]
    flat, chain = padded.ravel(), np.empty(padded.size, np.int64)
    for first in range(flat.size):
        if not flat[first]:
            continue
        flat[first] = False
        chain[0], done, count = first, 0, 1
        while done < count:
            for r in range(-1, 2):
                for c in range(-1, 2):
                    place = chain[done] + r * width + c
                    if flat[place]:
                        flat[place] = False
                        chain[count] = place
                        count += 1
            done += 1
        if count >= least:
            for i in range(count):
                kept[chain[i] // width - 1, chain[i] % width - 1] = True
