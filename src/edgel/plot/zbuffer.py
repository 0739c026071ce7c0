"""A cloud splatted into a z-buffer: which of its points shows in each pixel of a picture, and how far it lies."""

from __future__ import annotations

from typing import Any

import numpy as np

from edgel._neighbors.spacing import pixel_spacing
from edgel.cloud import as_cloud, check_points
from edgel.plot.camera import Viewport, choose_camera, choose_frame, detail_frame

SUPERSAMPLING = 2  # samples along each axis of a pixel: everything below counts these subpixels

_DISC = 1.2  # radius of a disc in point spacings: neighbours overlap even round a missing point
_LARGEST, _LARGEST_IN_DETAIL = 1 / 110, 1 / 30  # radius of a disc, as a share of the picture's smaller side: no blots
_BEAD = 0.7  # radius of a disc on top, as a share of the others': a row of edge points is a string of beads
_LINE = 1 / 650  # least radius of a disc on top, as a share of the picture's smaller side, and never below a pixel:
# edges of dense clouds are lines, no hairs
_THROUGH = 6.0  # how far behind what covers them, in spacings, points on top still show
_STEEPEST = 0.03  # the same at least, as a share of the picture's smaller side: outlines of dense clouds are that steep


class ZBuffer:
    """The finite points of a cloud drawn as discs, at `SUPERSAMPLING` times the resolution of the picture.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
    viewport : Viewport

    Attributes
    ----------
    rows : (M,) int64
        Row of the input of each finite point.
    camera : Camera
    frame : Frame
        In pixels of the picture.
    x, y : (M,) float64
        Where the points fall, in subpixels from the left and from above; NaN behind the viewer.
    depth : (M,) float64
        Their distance from the viewer, in the cloud's unit, up to a constant.
    width, height : int
        Of the picture, in subpixels.
    spacing : float
        Between points in the picture, in subpixels.
    radius : float
        Of the discs, in subpixels.
    nearest : (height, width) int64
        The point that shows in each subpixel; -1 where none does.
    covered : (height, width) bool
        Where one shows.
    surface_depth : (height, width) float64
        Depth of the points that show; NaN where none does.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no finite coordinates, or none that the viewport shows.
    """

    def __init__(self, points: Any, viewport: Viewport) -> None:
        cloud = as_cloud(points)
        finite = check_points(cloud, minimum=1)
        self.rows = finite.rows
        self.camera = choose_camera(cloud, viewport.direction)
        projected = self.camera.project(finite.xyz)
        if not np.isfinite(projected[:, 0]).any():
            raise ValueError("direction: all points lie behind the viewer; look the other way")
        if viewport.detail is None:
            self.frame = choose_frame(projected, viewport)
        else:
            self.frame = detail_frame(self.camera, *viewport.detail, viewport.size)
        x, y = self.frame.to_pixels(projected)
        self.x, self.y, self.depth = x * SUPERSAMPLING, y * SUPERSAMPLING, projected[:, 2]
        self.width, self.height = self.frame.width * SUPERSAMPLING, self.frame.height * SUPERSAMPLING
        self._inside = (x >= 0) & (x < self.frame.width) & (y >= 0) & (y < self.frame.height)
        if not self._inside.any():
            raise ValueError("detail: no point of the cloud falls into the picture; choose a place on the cloud")
        self.spacing = pixel_spacing(self.x[self._inside], self.y[self._inside], self.width, self.height)
        self.radius = self._disc_radius(viewport)
        self.nearest = self._splat(np.arange(len(projected)), self.radius)
        self.covered = self.nearest >= 0
        self.surface_depth = np.where(self.covered, self.depth[self.nearest], np.nan)

    def scale(self) -> tuple[float, float]:
        """Size of a pixel of the picture (no subpixel) in the cloud's unit, and the distance at which it is that.

        In perspective that is half of what is seen, otherwise NaN: it is the same everywhere.
        """
        if self.camera.eye is None:
            return self.frame.pixel, float("nan")
        distance = float(np.nanmedian(self.surface_depth))
        return self.frame.pixel * distance, distance

    def pixel_size(self, depth: np.ndarray) -> np.ndarray | float:
        """Size of a pixel of the picture at a depth, in the cloud's unit: in perspective it grows with the distance."""
        return self.frame.pixel if self.camera.eye is None else self.frame.pixel * depth

    def overlay(self, rows: np.ndarray) -> np.ndarray:
        """Say which of these rows of the input shows in each subpixel when drawn on top, unless the cloud hides it.

        Returns
        -------
        (height, width) int64
            Which of `rows`, counted from 0; -1 where none shows.
        """
        points, which = self._finite(rows)
        seen = self._unhidden(points, max(_BEAD * self.radius, _LINE * min(self.width, self.height), SUPERSAMPLING))
        which_of_point = np.full(len(self.rows), -1)
        which_of_point[points] = which
        return np.where(seen >= 0, which_of_point[seen], -1)

    def sample_evenly(self, rows: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
        """Choose visible points evenly among those in these rows of the input, at most one in a cell of the picture.

        Parameters
        ----------
        rows : (E,) int64
        cell : float
            Side of the cells, in subpixels.

        Returns
        -------
        chosen : (A,) int64
            Which of `rows`, counted from 0.
        at : (A, 2) float64
            Where they fall, in subpixels from the left and from above.
        """
        points, which = self._finite(rows)
        seen = self._unhidden(points, 0.0)
        shown = np.sort(seen[seen >= 0])
        x, y = self.x[shown] / cell, self.y[shown] / cell
        cells = np.floor(y) * np.ceil(self.width / cell) + np.floor(x)
        nearest_middle = np.lexsort((shown, (x % 1 - 0.5) ** 2 + (y % 1 - 0.5) ** 2, cells))
        chosen = shown[nearest_middle[np.unique(cells[nearest_middle], return_index=True)[1]]]
        order = np.argsort(points, kind="stable")
        at = np.column_stack([self.x[chosen], self.y[chosen]])
        return which[order[np.searchsorted(points[order], chosen)]], at

    def _disc_radius(self, viewport: Viewport) -> float:
        """As large as closes the surface, unless the points of the picture have a size."""
        if viewport.point_size is not None:
            return SUPERSAMPLING * viewport.point_size / 2
        share = _LARGEST if viewport.detail is None else _LARGEST_IN_DETAIL
        return min(max(_DISC * self.spacing, 0.5), max(share * min(self.width, self.height), SUPERSAMPLING))

    def _finite(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points in rows of the input, the finite ones, and which of `rows` each is."""
        points = np.searchsorted(self.rows, rows)
        which = np.flatnonzero(points < len(self.rows))
        which = which[self.rows[points[which]] == rows[which]]
        return points[which], which

    def _splat(self, points: np.ndarray, radius: float) -> np.ndarray:
        """Draw points as discs and say which is the nearest in each subpixel; -1 where there is none."""
        rim = int(np.ceil(radius))
        x, y = self.x[points], self.y[points]
        # Discs of points a little outside reach into the picture.
        points = points[(x >= -rim) & (x < self.width + rim) & (y >= -rim) & (y < self.height + rim)]
        far_first = self._far_first(points)
        wide = self.width + 4 * rim
        nearest = np.full((self.height + 4 * rim) * wide, -1, np.int64)
        row, column = (np.floor(at[far_first]).astype(np.int64) + 2 * rim for at in (self.y, self.x))
        pixel = row * wide + column
        nearest[pixel] = far_first  # what is written last, the nearest, stays
        shown = nearest[pixel] == far_first  # points hidden in their own pixel need no disc
        down, right = np.mgrid[-rim : rim + 1, -rim : rim + 1]
        disc = (down * wide + right)[down**2 + right**2 <= radius**2]
        nearest[(pixel[shown, None] + disc).ravel()] = far_first[shown].repeat(len(disc))
        return nearest.reshape(-1, wide)[2 * rim : 2 * rim + self.height, 2 * rim : 2 * rim + self.width]

    def _far_first(self, points: np.ndarray) -> np.ndarray:
        """Sort points by their depth; of some as near the lowest in the picture comes last, whatever their order."""
        ordered = points[np.argsort(-self.depth[points], kind="stable")]
        if np.all(np.diff(self.depth[ordered])):
            return ordered
        return points[np.lexsort((-points, self.x[points], self.y[points], -self.depth[points]))]

    def _unhidden(self, points: np.ndarray, radius: float) -> np.ndarray:
        """Draw some of the points as `_splat` does, without those that lie behind what the picture shows."""
        slack = _THROUGH * max(self.spacing, self.radius)
        steep = max(slack, _STEEPEST * min(self.width, self.height))
        size = self.pixel_size(self.surface_depth) / SUPERSAMPLING
        # First by the points' own pixels: through gaps of a nearer surface shreds of farther discs would shine.
        points = points[self._inside[points]]
        row, column = self.y[points].astype(np.int64), self.x[points].astype(np.int64)
        points = points[self.depth[points] <= (self.surface_depth + steep * size)[row, column]]
        nearest = self._splat(points, radius)
        return np.where(self.depth[nearest] <= self.surface_depth + slack * size, nearest, -1)
