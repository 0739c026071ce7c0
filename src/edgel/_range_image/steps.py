"""Steps in depth and rims: the near and the far side of every step, and where the surface ends against nothing."""

from __future__ import annotations

import numpy as np

from edgel._kernels.hysteresis import levels
from edgel._kernels.parallel import kernel, part, run_slices
from edgel._range_image.facet_fits import Facets
from edgel._range_image.noise import even_places, spread
from edgel._range_image.rays import Rays

STEP = 2.0  # spacings: least break of the surface between two pixels
GAP = 2.0  # spacings: least difference of their depths
LEAST = 0.5  # spacings between neighbours: what is less is not looked at
EXPLAINED = 1.5  # noises that a window leaves around which no step is looked for
SMEAR = 2  # pixels to either side over which a sensor may smear a step
SURE = 6.2  # standard deviations by which a break exceeds what noise explains
WEAK = 2 / 3  # of all that, where a break continues a sure one
FAINTEST = 0.2  # of all that: what is less is not kept at any strength
CHAIN = 8  # pixels: chains of both sides that are shorter are specks
SHEER = 4.0, 4  # times all that, and pixels: steps so high need no longer chain
BRIDGE = 2  # pixels: a hole no wider is bridged; where it slants, it may be BRIDGED wide along rows or columns
BRIDGED = 5
LIMB = 2.5  # times the step before: the last step of a round surface that turns away, 1 / (sqrt(2) - 1) at most
NEARBY = 2  # cells within which the window of a pixel's own side lies
HELD = 0.25  # of the gap beside it, within which neighbours hold a pixel that no window fits
_SPREAD = 0.7, 1.0364  # quantile of chance that tells its spread, and the normal distribution's: chance has long tails
_BAND = 16  # rows


def find_steps(rays: Rays, facets: Facets, void: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the steps in depth of a range image with voids (H, W).

    Each pixel beside a gap is given the plane of its own side: of the windows around it the one that the surface fills
    best. Where the planes of two neighbours (of 4, a hole of up to `BRIDGE` pixels between them) leave a step that
    neither plane's slope explains, the near pixel is OCCLUDING and the far one OCCLUDED.

    Returns
    -------
    (H, W) float32
        Highest threshold, in multiples of what is likely, at which hysteresis keeps the pixel; 0 where none does.
    (H, W) uint8
        `EdgeKind` flag of the side that the pixel lies on.
    """
    shape = rays.near.shape
    step, side = np.zeros(shape, np.float32), np.zeros(shape, np.uint8)
    # Where neighbours share no noise no sensor has smeared the steps, and chance is what it should be.
    smear, sure = (0, SURE) if facets.white else (SMEAR, SURE * _chance(rays, facets))
    bridged = [int(BRIDGED * min(rays.pitch) / rays.pitch[1 - way] + 0.5) for way in (0, 1)]
    for way in (0, 1):  # a pixel belongs to pairs of two rows: bands of the second way are columns
        run_slices(
            _steps, shape[way], way, rays.near, rays.ray, facets.plane[0], facets.noise, facets.cell,
            max(rays.side, rays.pitch[1 - way]), rays.central, sure, void, bridged[way], smear, step, side,
            size=(1 + 3 * way) * _BAND,
        )  # fmt: skip
    level = np.zeros(step.size, np.float32)
    for scale, chain, faintest in ((1.0, CHAIN, FAINTEST), (SHEER[0], SHEER[1], WEAK * SHEER[0] * FAINTEST)):
        places, found = levels(step, WEAK, chain, faintest)
        level[places] = np.fmax(level[places], found / scale)
    return level.reshape(shape), side


def _chance(rays: Rays, facets: Facets) -> float:
    """Spread of the step between the planes of pixels 2 `SMEAR` + 1 apart over their noise, over the whole view."""
    places = even_places(rays.near.shape)
    values = np.full((len(places), 2), np.nan, np.float32)
    run_slices(
        _sample, len(places), places, rays.near, rays.ray, facets.plane[0], facets.noise, facets.cell, values,
        size=128,
    )  # fmt: skip
    return spread(values, *_SPREAD)


@kernel
def _sample(start, stop, places, near, ray, plane, noise, cell, values):
    height, width = near.shape
    for n in range(start, stop):
        row, col = places[n]
        if near[row, col] != near[row, col]:
            continue
        for way in range(2):
            r, c = (row, col + 2 * SMEAR + 1) if way == 0 else (row + 2 * SMEAR + 1, col)
            if r >= height or c >= width or near[r, c] != near[r, c]:
                continue
            i, j, _ = own_plane(row, col, near, ray, plane, cell)
            a, b, _ = own_plane(r, c, near, ray, plane, cell)
            if i < 0 or a < 0:
                continue
            step = 0.0
            for k in range(3):
                step += (plane[k, a, b] - plane[k, i, j]) * ray[row, col, k]
            left = max(plane[3, i, j], plane[3, a, b], noise[row // cell[0], col // cell[1]])
            if left > 0.0:
                values[n, way] = abs(step) / left


@part
def own_plane(row, col, near, ray, plane, cell):
    """Cell of the window that fits a pixel's own side best, and the plane's misfit there and in all, squared."""
    i, j = row // cell[0], col // cell[1]
    best, where = np.float32(np.inf), -1
    x, y, z, own = ray[row, col, 0], ray[row, col, 1], ray[row, col, 2], near[row, col]
    for down in range(-NEARBY, NEARBY + 1):
        for right in range(-NEARBY, NEARBY + 1):
            # At the rim a window comes up more than once: as the nearest it is, it wins.
            a, b = min(max(i + down, 0), plane.shape[1] - 1), min(max(j + right, 0), plane.shape[2] - 1)
            left = plane[3, a, b]
            off = own - plane[0, a, b] * x - plane[1, a, b] * y - plane[2, a, b] * z
            # The farther the window, the farther its plane is extended.
            farther = np.float32(1.0 + 0.1 * (down * down + right * right))
            value = left * left * farther + np.float32(0.25) * off * off
            better = value < best
            best, where = (value, a * plane.shape[2] + b) if better else (best, where)
    return where // plane.shape[2] if where >= 0 else -1, where % plane.shape[2], best


@part
def _held(row, col, gap, near):
    """Whether two of the eight neighbours are much nearer to a pixel than the gap is wide: no outlier."""
    count = 0
    for r in range(max(row - 1, 0), min(row + 2, near.shape[0])):
        for c in range(max(col - 1, 0), min(col + 2, near.shape[1])):
            if abs(near[r, c] - near[row, col]) < HELD * abs(gap):
                count += 1
    return count > 2  # itself among them


@part
def _leap(row, col, r, c, dr, dc, near, ray, plane, noise, cell):
    """Step that neither side's slope explains, and its noise."""
    height, width = near.shape
    gap = near[r, c] - near[row, col]
    sigma = noise[row // cell[0], col // cell[1]]
    i, j, misfit = own_plane(row, col, near, ray, plane, cell)
    a, b, other = own_plane(r, c, near, ray, plane, cell)
    limit = 16 * sigma * sigma
    if i >= 0 and a >= 0 and misfit < limit and other < limit:
        here = there = 0.0
        for k in range(3):
            differs = plane[k, a, b] - plane[k, i, j]
            here += differs * ray[row, col, k]
            there += differs * ray[r, c, k]
        # Seen from either pixel: planes that merely cross between the two, at a fold, are no step.
        if here * gap <= 0 or there * gap <= 0:
            return 0.0, 1.0
        left = max(plane[3, i, j], plane[3, a, b], sigma)
        return min(abs(here), abs(there)), left
    # Too thin for a window: neighbours have to hold it, and the pixels behind tell the slope.
    if (not misfit < limit and not _held(row, col, gap, near)) or (not other < limit and not _held(r, c, gap, near)):
        return 0.0, sigma
    leap = abs(gap)
    for s in range(2):
        p, q = (row - dr, col - dc) if s == 0 else (r + dr, c + dc)
        if p < 0 or q < 0 or p >= height or q >= width:
            continue
        slope = (near[row, col] - near[p, q]) if s == 0 else (near[p, q] - near[r, c])
        if slope == slope and slope * gap > 0:
            leap = min(leap, abs(gap) - abs(slope))
    return max(leap, 0.0) / 2, sigma


@kernel
def _steps(
    start, stop, way, near, ray, plane, noise, cell, unit, central, sure, void, bridged, smear, step, side
):  # fmt: skip
    height, width = near.shape
    dr, dc = (0, 1) if way == 0 else (1, 0)
    rows = (start, stop) if way == 0 else (0, height)
    cols = (0, width) if way == 0 else (start, stop)
    for row in range(rows[0], rows[1]):
        i = row // cell[0]
        for j in range(cols[0] // cell[1], (cols[1] - 1) // cell[1] + 1):
            # The window around a pixel beside a step lies on both sides of it: where one plane explains it, none is.
            if plane[3, i, j] < EXPLAINED * noise[i, j]:
                continue
            for col in range(max(j * cell[1], cols[0]), min((j + 1) * cell[1], cols[1])):
                here = near[row, col]
                if here != here:
                    continue
                r, c = row + dr, col + dc
                left_over = bridged
                while left_over and r < height and c < width and near[r, c] != near[r, c] and not void[r, c]:
                    r, c, left_over = r + dr, c + dc, left_over - 1
                if r >= height or c >= width or near[r, c] != near[r, c]:
                    continue
                gap = near[r, c] - here
                spacing = unit * max(here, near[r, c]) if central else unit
                if not abs(gap) > LEAST * spacing or not _steepest(row, col, r, c, dr, dc, gap, near, smear):
                    continue
                if r + c == row + col + 1 and _turns_away(row, col, r, c, gap, near, void):
                    continue
                sigma, value = noise[i, j], 0.0
                for apart in range(min(smear, bridged) + 1):
                    p, q, u, v = row - apart * dr, col - apart * dc, r + apart * dr, c + apart * dc
                    if p < 0 or q < 0 or u >= height or v >= width:
                        break
                    whole = (near[u, v] - near[p, q]) * (1.0 if gap > 0 else -1.0)
                    if not whole > max(GAP * spacing, sure * sigma / 2):  # NaN too
                        continue
                    leap, left = _leap(p, q, u, v, dr, dc, near, ray, plane, noise, cell)
                    value = max(value, min(leap / max(STEP * spacing, sure * left), whole / (GAP * spacing)))
                if value > step[row, col]:
                    step[row, col], side[row, col] = value, 4 if gap > 0 else 2
                if value > step[r, c]:
                    step[r, c], side[r, c] = value, 2 if gap > 0 else 4


@part
def _turns_away(row, col, r, c, gap, near, void):
    """Whether a round surface ends at the farther of two neighbours: steps grow towards it, and beyond is nothing."""
    height, width = near.shape
    down, right = (r - row, c - col) if gap < 0 else (row - r, col - c)  # to the farther one
    p, q, u, v = (row, col, r, c) if gap < 0 else (r, c, row, col)
    before, beside, beyond, away = p - down, q - right, u + down, v + right
    if before < 0 or beside < 0 or before >= height or beside >= width:
        return False
    if 0 <= beyond < height and 0 <= away < width and not void[beyond, away]:
        return False
    return abs(gap) <= LIMB * (near[before, beside] - near[p, q])


@part
def _steepest(row, col, r, c, dr, dc, gap, near, smear):
    """Whether no pair of neighbours within `SMEAR` pixels differs more: a sensor smears a step over some pixels."""
    sign = 1.0 if gap > 0 else -1.0
    for apart in range(1, smear + 1):
        p, q = row - apart * dr, col - apart * dc
        if p < 0 or q < 0:
            break
        if sign * (near[p + dr, q + dc] - near[p, q]) > sign * gap:
            return False
    for apart in range(1, smear + 1):
        u, v = r + apart * dr, c + apart * dc
        if u >= near.shape[0] or v >= near.shape[1]:
            break
        if sign * (near[u, v] - near[u - dr, v - dc]) > sign * gap:
            return False
    return True


def find_voids(rays: Rays) -> np.ndarray:
    """Mark holes that are wider than `BRIDGE` pixels, (H, W) uint8: what squares cover that are all hole.

    Between lines that lie far apart nothing is wide: there only holes along the lines count, wider than is bridged.
    """
    size = (1, BRIDGED + 1) if rays.apart[0] else (BRIDGED + 1, 1) if rays.apart[1] else (BRIDGE + 1,) * 2
    void = np.zeros(rays.near.shape, np.uint8)
    run_slices(_voids, len(void), rays.near, size, void, size=4 * _BAND)
    return void


def find_rims(near: np.ndarray, void: np.ndarray) -> np.ndarray:
    """Pixels beside a void; (H, W) bool."""
    rim = np.zeros(near.shape, np.bool_)
    run_slices(_rims, len(near), near, void, rim, size=4 * _BAND)
    return rim


@kernel
def _voids(start, stop, near, size, void):
    """Mark what rectangles of a size that are all hole cover."""
    height, width = near.shape
    deep = np.zeros(width, np.int64)  # rows of hole that end in the row, of each column
    for row in range(max(start - size[0] + 1, 0), min(stop + size[0] - 1, height)):
        run = 0
        for col in range(width):
            deep[col] = deep[col] + 1 if near[row, col] != near[row, col] else 0
            run = run + 1 if deep[col] >= size[0] else 0
            if run >= size[1]:
                for r in range(max(row - size[0] + 1, start), min(row + 1, stop)):
                    for c in range(col if run > size[1] else col - size[1] + 1, col + 1):
                        void[r, c] = 1


@kernel
def _rims(start, stop, near, void, rim):
    height, width = near.shape
    for row in range(start, stop):
        for col in range(width):
            if near[row, col] == near[row, col]:
                rim[row, col] = (
                    (row > 0 and void[row - 1, col])
                    or (row + 1 < height and void[row + 1, col])
                    or (col > 0 and void[row, col - 1])
                    or (col + 1 < width and void[row, col + 1])
                )
