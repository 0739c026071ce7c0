"""Lists of points that came from a grid are put back on it: a camera's, a height map's, a scanner's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from edgel._range_image.grid_steps import neighbours, pitch_of
from edgel._range_image.lattice import NEAR, find_lattice
from edgel._range_image.range_image import FRAME, RangeImage, unit

_OWN = 0.98  # least share of the points that have a place of the grid to themselves
_BESIDE = 0.6  # least share of the places beside points that are filled too: a grid, not points on round numbers
_EMPTIEST = 20  # cells for each point
EXACT = 0.15  # steps: of parallel rays a point lies as near as that to its place
_LEVEL = 1e-9  # rays less far from their axis have no azimuth
_AXES = {"z": (0, 1, 2), "y": (2, 0, 1)}  # which coordinates are x, y and z about these axes of a scanner


@dataclass(frozen=True, eq=False)
class Grid:
    """Points in the cells of a grid, one a cell.

    Attributes
    ----------
    points : (M,) int64
        The points that have a cell, in the order of the cells.
    cells : (M,) int64
        Their cells, row by row, ascending.
    shape : (int, int)
        Rows and columns.
    off : float
        How far the points lie off the middle of their cells on average, in cells.
    """

    points: np.ndarray
    cells: np.ndarray
    shape: tuple[int, int]
    off: float = 0.0

    def seen_along(self, xyz: np.ndarray, from_below: bool) -> RangeImage:
        """See the points (N, 3) from above or below, void all around the grid: the surface ends where the map does."""
        direction = np.array([0.0, 0.0, 1.0 if from_below else -1.0])
        across = xyz * (1, 1, 0)
        return self._seen(across, "organized", None, direction, [FRAME] * 4)

    def seen_from(self, xyz: np.ndarray, method: str, viewpoint: np.ndarray) -> RangeImage:
        """See the points (N, 3) from the viewpoint of their sensor.

        A side of the grid of which the points fill more than half is where the sensor's field of view ends, and no edge
        of the surface; around the others there is void.
        """
        rays = xyz - viewpoint
        depth = np.linalg.norm(rays, axis=1)
        rays /= np.where(depth > 0, depth, 1)[:, None]
        middle = unit(rays[self.points].mean(axis=0))
        row, col = np.divmod(self.cells, self.shape[1])
        (last_row, last_col), (height, width) = np.array(self.shape) - 1, self.shape
        filled = [(row == 0, width), (row == last_row, width), (col == 0, height), (col == last_col, height)]
        void = [0 if np.count_nonzero(on) > long / 2 else FRAME for on, long in filled]
        return self._seen(rays, method, viewpoint, middle, void)

    def _seen(
        self,
        across: np.ndarray,
        method: str,
        viewpoint: np.ndarray | None,
        direction: np.ndarray,
        void: list[int],
    ) -> RangeImage:
        """Fill an image, pixels of void above, below, left and right, from places across (N, 3)."""
        top, bottom, left, right = void
        index = np.full((self.shape[0] + top + bottom, self.shape[1] + left + right), -1)
        index[self.cells // self.shape[1] + top, self.cells % self.shape[1] + left] = self.points
        steps = [np.linalg.norm(across[b] - across[a], axis=1) for a, b in neighbours(index)]
        behind = np.full(len(across), np.inf)
        behind[self.points] = 0.0
        return RangeImage(index, method, (pitch_of(steps[0]), pitch_of(steps[1])), viewpoint, direction, behind)


def camera_grid(xyz: np.ndarray, viewpoint: np.ndarray) -> Grid | None:
    """Find the pixels of a camera at the viewpoint that looks along its Z axis, None if the points show none.

    Pixels lie at equal steps of x / z and y / z. Those whose coordinates are rounded are found as well, while they stay
    apart.

    Parameters
    ----------
    xyz : (N, 3) float64
    viewpoint : (3,) float64

    Examples
    --------
    >>> u, v = np.meshgrid(np.arange(-20, 20) / 50, np.arange(-10, 10) / 50)
    >>> wall = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3) * (3 + u.reshape(-1, 1))
    >>> grid = camera_grid(np.random.default_rng(0).permutation(wall), np.zeros(3))
    >>> grid is not None and grid.shape
    (20, 40)
    """
    rays = xyz - viewpoint
    forward = 1.0 if np.median(rays[:, 2]) > 0 else -1.0
    ahead = np.flatnonzero(forward * rays[:, 2] > _LEVEL * np.abs(rays[:, :2]).max(axis=1))
    rays = rays[ahead]
    picture = rays[:, :2] / rays[:, 2:]
    return _filled(xyz, ahead, picture, np.linalg.norm(rays, axis=1))


def map_grid(xyz: np.ndarray, *, from_below: bool = False) -> Grid | None:
    """Find the grid of a height map, whose points lie at equal steps of x and of y, each place used once.

    Where a few places are used twice the points nearer to the viewer show, from above or below.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(20.0))
    >>> grid = map_grid(np.c_[x.ravel(), y.ravel(), np.sin(x.ravel())])
    >>> grid is not None and grid.shape
    (20, 30)
    """
    return _filled(xyz, np.arange(len(xyz)), xyz[:, :2], xyz[:, 2] if from_below else -xyz[:, 2], EXACT)


def scanner_grid(xyz: np.ndarray, viewpoint: np.ndarray) -> Grid | None:
    """Find the grid of a scanner at the viewpoint, turning about Z or Y: equal steps of azimuth and of elevation."""
    rays = xyz - viewpoint
    away = np.linalg.norm(rays, axis=1)
    for x, y, z in _AXES.values():
        level = np.hypot(rays[:, x], rays[:, y])
        known = np.flatnonzero(level > _LEVEL * away)
        ahead, aside, height = (rays[known, axis] for axis in (x, y, z))
        middle = np.arctan2(aside.mean(), ahead.mean())
        azimuth = (np.arctan2(aside, ahead) - middle + np.pi) % (2 * np.pi)
        picture = np.column_stack([-azimuth, -np.arctan2(height, level[known])])
        if (grid := _filled(xyz, known, picture, away[known])) is not None:
            return grid
    return None


def _filled(
    xyz: np.ndarray, points: np.ndarray, picture: np.ndarray, depth: np.ndarray, near: float = NEAR
) -> Grid | None:
    """Put points (M,), at places (M, 2) of a picture, into the cells of its lattice, if there is one."""
    if len(points) < _OWN * len(xyz) or (across := find_lattice(picture[:, 0])) is None:
        return None
    if (along := find_lattice(picture[:, 1])) is None:
        return None
    cols, aside = across.places(picture[:, 0])
    rows, above = along.places(picture[:, 1])
    off = np.maximum(aside, above)
    on = np.flatnonzero(off <= near)
    grid = one_a_cell(xyz, points[on], rows[on], cols[on], depth[on])
    return None if grid is None else replace(grid, off=float(off.mean()))


def one_a_cell(
    xyz: np.ndarray, points: np.ndarray, rows: np.ndarray, cols: np.ndarray, depth: np.ndarray
) -> Grid | None:
    """Make a grid of points, the nearest of several in a cell; None if they fill none, or share its cells.

    Parameters
    ----------
    xyz : (N, 3) float64
        All the points.
    points : (M,) int64
        Those that lie on the grid.
    rows, cols : (M,) int64
        Where each lies, counted from anywhere.
    depth : (M,) float64
    """
    if len(points) < _OWN * len(xyz):
        return None
    rows, cols = rows - rows.min(), cols - cols.min()
    shape = int(rows.max()) + 1, int(cols.max()) + 1
    if min(shape) < 2 or shape[0] * shape[1] > _EMPTIEST * len(xyz):
        return None
    cells = rows * shape[1] + cols
    order = np.argsort(cells)
    own = np.diff(cells[order], prepend=-1) > 0
    if np.count_nonzero(own) < _OWN * len(xyz):
        return None
    if not own.all():
        order = np.lexsort((*xyz[points].T, depth, cells))[own]
    filled = np.zeros((shape[0] + 2, shape[1] + 2), bool)
    filled[rows + 1, cols + 1] = True
    beside = filled[:-2, 1:-1] * 1 + filled[2:, 1:-1] + filled[1:-1, :-2] + filled[1:-1, 2:]
    if beside[filled[1:-1, 1:-1]].mean() < 4 * _BESIDE:
        return None
    return Grid(points[order], cells[order], shape)
