"""A cloud laid out in a picture: which point shows in each pixel, how far it lies, how light it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel._neighbors.spacing import pixel_spacing
from edgel.cloud import as_cloud, check_points
from edgel.plot.camera import choose_camera, choose_frame, detail_frame

FINE = 2  # samples along each axis of a pixel: everything below counts these fine pixels

_LIGHT = np.array([-0.30, 0.42, 0.86])  # towards the light: from the left, above, and behind the viewer
_AMBIENT = 0.5  # how far round the light reaches, so that slopes away from it still differ
_DISC = 1.2  # radius of a disc in point spacings: neighbours overlap even round a missing point
_LARGEST, _LARGEST_IN_DETAIL = 1 / 110, 1 / 30  # radius of a disc, as a share of the picture's smaller side: no blots
_BEAD = 0.7  # radius of a disc on top, as a share of the others': a row of edge points is a string of beads
_LINE = 1 / 650  # least radius of a disc on top, as a share of the picture's smaller side, and never below a pixel:
# edges of dense clouds are lines, no hairs
_THROUGH = 6.0  # how far behind what covers them, in spacings, points on top still show
_STEEPEST = 0.03  # the same at least, as a share of the picture's smaller side: outlines of dense clouds are that steep


class Scene:
    """A cloud in a picture twice as fine as the one asked for.

    Parameters
    ----------
    points, direction, size, crop, margin, point_radius
        As `edgel.plot.render` takes them.
    detail : ((3,) array_like, float), optional
        As `edgel.plot.picture` takes it.

    Attributes
    ----------
    num_input : int
        Points of the input, finite or not.
    rows : (M,) int64
        Row of the input of each finite point.
    columns, downs : (M,) float64
        Where they fall, in fine pixels from the left and from above; NaN behind the viewer.
    distance : (M,) float64
        From the viewer, in the cloud's unit, up to a constant.
    width, height : int
        Of the picture, in fine pixels.
    spacing : float
        Between points in the picture, in fine pixels.
    winner : (height, width) int64
        Which finite point shows; -1 where none.
    covered : (height, width) bool
        Where one shows.
    """

    def __init__(
        self,
        points: Any,
        *,
        direction: Any,
        size: tuple[int, int],
        crop: bool,
        margin: float,
        point_radius: float | None = None,
        detail: tuple[Any, float] | None = None,
    ) -> None:
        _check_options(size, margin, point_radius)
        cloud = as_cloud(points)
        checked = check_points(cloud, minimum=1)
        self.num_input, self.rows = len(cloud), checked.rows
        self.camera = choose_camera(cloud, direction)
        placed = self.camera.place(checked.xyz)
        if not np.isfinite(placed[:, 0]).any():
            raise ValueError("direction: all points lie behind the viewer; look the other way")
        if detail is None:
            self.frame = choose_frame(placed, size, margin=margin, crop=crop)
        else:
            self.frame = detail_frame(self.camera, *detail, size)
        columns, downs = self.frame.columns_rows(placed)
        self.columns, self.downs, self.distance = columns * FINE, downs * FINE, placed[:, 2]
        self.width, self.height = self.frame.width * FINE, self.frame.height * FINE
        self._inside = (columns >= 0) & (columns < self.frame.width) & (downs >= 0) & (downs < self.frame.height)
        if not self._inside.any():
            raise ValueError("detail: no point of the cloud falls into the picture; choose a place on the cloud")
        self.spacing = pixel_spacing(self.columns[self._inside], self.downs[self._inside], self.width, self.height)
        share = _LARGEST if detail is None else _LARGEST_IN_DETAIL
        largest = max(share * min(self.width, self.height), FINE)
        self.radius = min(max(_DISC * self.spacing, 0.5), largest) if point_radius is None else FINE * point_radius
        self.winner = self._splat(np.arange(len(placed)), self.radius)
        self.covered = self.winner >= 0
        self._depth = np.where(self.covered, self.distance[self.winner], np.nan)

    def scale(self) -> tuple[float, float]:
        """Size of a pixel of the picture (not a fine one) in the cloud's unit, and the distance at which it is that.

        In perspective that is half of what is seen, otherwise NaN: it is the same everywhere.
        """
        if self.camera.eye is None:
            return self.frame.pixel, float("nan")
        distance = float(np.nanmedian(self._depth))
        return self.frame.pixel * distance, distance

    def shaded_by_slope(self) -> np.ndarray:
        """How light each fine pixel is by the slope of the depth around it, 0 to 1, (height, width)."""
        return _lightness(self._normals_seen() @ _LIGHT).repeat(FINE, axis=0).repeat(FINE, axis=1)

    def normals_by_slope(self) -> np.ndarray:
        """Unit normal of the surface in each fine pixel, in the cloud's frame, by the slope, (height, width, 3)."""
        axes = np.vstack([self.camera.right, self.camera.up, self.camera.back])
        return (self._normals_seen() @ axes).repeat(FINE, axis=0).repeat(FINE, axis=1)

    def _normals_seen(self) -> np.ndarray:
        """Unit normals to the right, up and towards the viewer, one a pixel, (height / FINE, width / FINE, 3)."""
        # At the resolution of the picture itself: four times as fast, and the outline stays that of the fine one.
        depth, covered = self._depth[::FINE, ::FINE], self.covered[::FINE, ::FINE]
        footprint = self._footprint(depth)
        depth = _smoothed(depth, covered, int(np.ceil(1.5 * max(self.spacing, self.radius) / FINE)))
        down, right = np.gradient(depth)
        # Depth grows away from the viewer; a jump counts as a steep slope, no more.
        x, y = (np.clip(np.nan_to_num(step / footprint), -3.0, 3.0) for step in (right, -down))
        return np.dstack([x, y, np.ones_like(x)]) / np.sqrt(x * x + y * y + 1.0)[..., None]

    def shaded_by_normal(self, normals: Any) -> np.ndarray:
        """How light each fine pixel is by the normals (N, 3) of the points themselves, 0 to 1, (height, width)."""
        normals = np.asarray(normals, float)
        if normals.shape != (self.num_input, 3):
            raise ValueError(f"normals: expected ({self.num_input}, 3), one a point, got {normals.shape}")
        axes = np.column_stack([self.camera.right, self.camera.up, self.camera.back])
        return _lightness(np.nan_to_num(normals[self.rows] @ axes @ _LIGHT))[self.winner]

    def on_top(self, rows: np.ndarray) -> np.ndarray:
        """Say which of these rows of the input shows in each fine pixel when drawn on top, unless the cloud hides it.

        Returns
        -------
        (height, width) int64
            Places among `rows`; -1 where none shows.
        """
        finite, places = self._finite(rows)
        winner = self._unhidden(finite, max(_BEAD * self.radius, _LINE * min(self.width, self.height), FINE))
        place = np.full(len(self.rows), -1)
        place[finite] = places
        return np.where(winner >= 0, place[winner], -1)

    def spread(self, rows: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
        """Choose visible points evenly among those in these rows of the input, at most one in a cell of the picture.

        Returns
        -------
        chosen : (A,) int64
            Places among `rows`.
        at : (A, 2) float64
            Where they fall, in fine pixels from the left and from above.
        """
        finite, places = self._finite(rows)
        winner = self._unhidden(finite, 0.0)
        shown = np.sort(winner[winner >= 0])
        x, y = self.columns[shown] / cell, self.downs[shown] / cell
        cells = np.floor(y) * np.ceil(self.width / cell) + np.floor(x)
        nearest_middle = np.lexsort((shown, (x % 1 - 0.5) ** 2 + (y % 1 - 0.5) ** 2, cells))
        chosen = shown[nearest_middle[np.unique(cells[nearest_middle], return_index=True)[1]]]
        order = np.argsort(finite, kind="stable")
        return places[order[np.searchsorted(finite[order], chosen)]], np.column_stack(
            [self.columns[chosen], self.downs[chosen]]
        )

    def _finite(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Finite points among rows of the input, and their places in `rows`."""
        which = np.searchsorted(self.rows, rows)
        places = np.flatnonzero(which < len(self.rows))
        places = places[self.rows[which[places]] == rows[places]]
        return which[places], places

    def _splat(self, which: np.ndarray, radius: float) -> np.ndarray:
        """Draw points as discs and say which shows in each fine pixel, the nearest; -1 where none."""
        rim = int(np.ceil(radius))
        x, y = self.columns[which], self.downs[which]
        # Discs of points a little outside reach into the picture.
        which = which[(x >= -rim) & (x < self.width + rim) & (y >= -rim) & (y < self.height + rim)]
        far_first = self._far_first(which)
        wide = self.width + 4 * rim
        winner = np.full((self.height + 4 * rim) * wide, -1, np.int64)
        row, column = (np.floor(at[far_first]).astype(np.int64) + 2 * rim for at in (self.downs, self.columns))
        pixel = row * wide + column
        winner[pixel] = far_first  # what is written last, the nearest, stays
        shown = winner[pixel] == far_first  # points hidden in their own pixel need no disc
        down, right = np.mgrid[-rim : rim + 1, -rim : rim + 1]
        disc = (down * wide + right)[down**2 + right**2 <= radius**2]
        winner[(pixel[shown, None] + disc).ravel()] = far_first[shown].repeat(len(disc))
        return winner.reshape(-1, wide)[2 * rim : 2 * rim + self.height, 2 * rim : 2 * rim + self.width]

    def _far_first(self, which: np.ndarray) -> np.ndarray:
        """Sort points by their distance; of some as near the lowest in the picture comes last, whatever their order."""
        ordered = which[np.argsort(-self.distance[which], kind="stable")]
        if np.all(np.diff(self.distance[ordered])):
            return ordered
        return which[np.lexsort((-which, self.columns[which], self.downs[which], -self.distance[which]))]

    def _unhidden(self, which: np.ndarray, radius: float) -> np.ndarray:
        """Draw some of the points as `_splat` does, without those that lie behind what the picture shows."""
        slack = _THROUGH * max(self.spacing, self.radius)
        steep = max(slack, _STEEPEST * min(self.width, self.height))
        size = self._footprint(self._depth) / FINE
        # First by the points' own pixels: through gaps of a nearer surface shreds of farther discs would shine.
        which = which[self._inside[which]]
        down, right = self.downs[which].astype(np.int64), self.columns[which].astype(np.int64)
        which = which[self.distance[which] <= (self._depth + steep * size)[down, right]]
        winner = self._splat(which, radius)
        return np.where(self.distance[winner] <= self._depth + slack * size, winner, -1)

    def _footprint(self, depth: np.ndarray) -> np.ndarray | float:
        """Size of a pixel on the surface, in the cloud's unit: in perspective it grows with the distance."""
        return self.frame.pixel if self.camera.eye is None else self.frame.pixel * depth


def _check_options(size: tuple[int, int], margin: float, point_radius: float | None) -> None:
    if len(size) != 2 or min(size) < 16 or max(size) > 20_000:
        raise ValueError(f"size: expected width and height from 16 to 20,000 pixels, got {size!r}")
    if not 0 <= margin < 0.4:
        raise ValueError(f"margin: expected a share of the picture from 0 to 0.4, got {margin}")
    if point_radius is not None and not 0 <= point_radius <= 100:
        raise ValueError(f"point_radius: expected 0 to 100 pixels, got {point_radius}")


def _lightness(cosine: np.ndarray) -> np.ndarray:
    """Map the cosine of the angle to the light to 0..1; slopes a little turned away from it are not yet black."""
    return np.clip((cosine + _AMBIENT) / (1.0 + _AMBIENT), 0.0, 1.0)


def _smoothed(values: np.ndarray, known: np.ndarray, radius: int) -> np.ndarray:
    """Smooth the known values twice by a square of 2 radius + 1; what is unknown has no say; NaN far from any."""
    middle = np.nanmean(values)  # small numbers keep their digits in the running sums
    total, weight = np.where(known, values - middle, 0.0), known.astype(float)
    for _ in range(2):
        total, weight = _box(total, radius), _box(weight, radius)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(weight > 1e-6, total / weight, np.nan)


def _box(values: np.ndarray, radius: int) -> np.ndarray:
    """Mean over squares of 2 radius + 1; zeros outside."""
    for axis in (0, 1):
        pad = [(0, 0), (0, 0)]
        pad[axis] = (radius + 1, radius)
        sums = np.pad(values, pad)
        np.cumsum(sums, axis=axis, out=sums)
        far, near = [slice(None)] * 2, [slice(None)] * 2
        far[axis], near[axis] = slice(2 * radius + 1, None), slice(None, -2 * radius - 1)
        values = (sums[tuple(far)] - sums[tuple(near)]) / (2 * radius + 1)
    return values
