"""From where a cloud is best looked at: as its sensor did, along one direction, or not in one view at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex, build_index
from edgel._range_image.near_far import DEPTH, SHOWN, explaining_direction
from edgel._range_image.range_image import RangeImage, organized, orthographic, pinhole, spherical
from edgel._range_image.regrid import camera_grid, map_grid, scanner_grid
from edgel._range_image.rings import find_rings
from edgel.cloud import Cloud, Points

METHODS = ("auto", "surface", "organized", "orthographic", "pinhole", "spherical")

_SAMPLE = 50_000  # points at which directions are compared, where the best is asked for
FEW = 1_500  # and where only near and far sides are to be told apart
_CAMERA = 0.5  # least cosine to the mean ray in the view of a camera
_DIGITS = 3  # of a cell: grids that fit as well as that are equally good, and the simplest is taken


@dataclass(frozen=True, eq=False)
class View:
    """How to look at a cloud, and why.

    Attributes
    ----------
    method : str
        "organized", "orthographic", "pinhole", "spherical", or "surface": no view shows it all.
    reason : str
        One line for people.
    image : RangeImage or None
        What the view shows; None for "surface".
    """

    method: str
    reason: str
    image: RangeImage | None = None


def best_view(cloud: Cloud, xyz: np.ndarray, viewpoint: np.ndarray | None = None) -> View:
    """Choose how to look at a cloud: as its sensor saw it, where that is known, else at the surface itself.

    A list of points that came from a grid, or from a spinning sensor, is put back on its grid. Of any other list a
    projection loses to the surface even where one shows all of it: its pixels are no finer than the spacing
    (docs/decisions.md).

    Parameters
    ----------
    cloud : Cloud
    xyz : (N, 3) float64
        Its finite points.
    viewpoint : (3,) float64, optional
        Default: the cloud's own.

    Examples
    --------
    >>> import numpy as np
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(20.0))
    >>> hill = np.c_[x.ravel(), y.ravel(), np.sin(x.ravel() / 5)]
    >>> best_view(Cloud(hill), hill).reason
    'the points lie on the grid of a height map, 20 x 30'
    >>> shaken = hill + np.random.default_rng(0).normal(0, 0.3, hill.shape)
    >>> best_view(Cloud(shaken), shaken).method
    'surface'
    """
    if cloud.shape is not None and min(cloud.shape) > 1:
        return View("organized", f"the points form a grid of {cloud.shape[0]} x {cloud.shape[1]}")
    viewpoint = cloud.viewpoint if viewpoint is None else viewpoint
    if (view := _sensor_view(xyz, viewpoint)) is not None:
        return view
    if viewpoint is None:
        return View("surface", "the points form no grid and the sensor's place is not known")
    rays = xyz - viewpoint
    away = np.linalg.norm(rays, axis=1)
    middle = rays.mean(axis=0)
    camera = (rays @ middle >= _CAMERA * away * np.linalg.norm(middle)).all() and middle.any()
    # A spinning sensor may see a narrow sector too: its lines lie farther apart than its shots.
    image = _from_viewpoint(spherical, xyz, viewpoint)
    if camera and image.pitch[0] == image.pitch[1] and away.min() > 0:
        image = pinhole(xyz, viewpoint)
    share = shown(image)
    if share >= SHOWN:
        return View(image.method, f"{share:.0%} of the points show from the viewpoint", image)
    return View("surface", f"only {share:.0%} of the points show from the viewpoint")


def _sensor_view(xyz: np.ndarray, viewpoint: np.ndarray | None) -> View | None:
    """See a list of points as the sensor did whose grid or rings it still shows; None where it shows none.

    A sensor whose place is not known is looked for at the origin, where sensors have theirs.
    """
    where = "origin" if viewpoint is None else "viewpoint"
    eye = np.zeros(3) if viewpoint is None else viewpoint
    below = viewpoint is not None and viewpoint[2] < np.median(xyz[:, 2])
    if (rings := find_rings(xyz, eye)) is not None:
        grid = rings.grid(xyz, eye)
        image = _from_viewpoint(spherical, xyz, eye) if grid is None else grid.seen_from(xyz, "spherical", eye)
        reason = f"the points lie on {rings.count} rings about the {where}, as those of a spinning sensor there"
        return View("spherical", reason, image)
    found = [
        (grid, name, stands)
        for grid, name, stands in (
            (map_grid(xyz, from_below=below), "a height map", None),
            (camera_grid(xyz, eye), f"a camera at the {where}", eye),
            (scanner_grid(xyz, eye), f"a scanner at the {where}", eye),
        )
        if grid is not None
    ]
    if not found:
        return None
    grid, name, stands = min(found, key=lambda each: round(each[0].off, _DIGITS))
    reason = f"the points lie on the grid of {name}, {grid.shape[0]} x {grid.shape[1]}"
    image = grid.seen_along(xyz, below) if stands is None else grid.seen_from(xyz, "organized", stands)
    return View("organized", reason, image)


def _from_viewpoint(project: Callable[..., RangeImage], xyz: np.ndarray, viewpoint: np.ndarray) -> RangeImage:
    """Project the points; those in the viewpoint itself (sensors report shots without an echo so) do not show."""
    rows = np.flatnonzero((xyz != viewpoint).any(axis=1))
    if len(rows) == len(xyz):
        return project(xyz, viewpoint)
    image = project(xyz[rows], viewpoint)
    behind = np.zeros(len(xyz))
    behind[rows] = image.behind
    return replace(image, index=np.where(image.index >= 0, rows[image.index], -1), behind=behind)


def choose_view(cloud: Cloud, finite: Points, method: str, viewpoint: np.ndarray | None) -> View:
    """View a cloud in the way that is asked for, or ("auto") the best one.

    Parameters
    ----------
    cloud : Cloud
    finite : Points
        Its finite points.
    method : str
        One of `METHODS`.
    viewpoint : (3,) float64 or None

    Raises
    ------
    ValueError
        If the cloud lacks what the method needs.
    """
    xyz = finite.xyz
    view = best_view(cloud, xyz, viewpoint) if method == "auto" else View(method, "asked for")
    if view.image is not None or view.method == "surface":
        return view
    if view.method == "orthographic":
        index = build_index(xyz)  # a sample that does not depend on the order of the points
        sample = index.at(index.evenly_sampled(_SAMPLE))
        image = orthographic(xyz, _best_direction(xyz, sample, viewpoint))
    elif view.method == "organized":
        if cloud.shape is None or min(cloud.shape) < 2:
            raise ValueError("method: 'organized' needs points in a grid, (H, W, 3); use 'auto' for a list of points")
        image = organized(xyz, finite.rows, cloud.shape, viewpoint)
    else:
        if viewpoint is None:
            raise ValueError(f"method: {method!r} needs to know where the sensor was; give viewpoint, or use 'auto'")
        image = _from_viewpoint(pinhole if view.method == "pinhole" else spherical, xyz, viewpoint)
    return View(view.method, view.reason, image)


def explaining_view(index: NeighborIndex) -> np.ndarray | None:
    """Return the direction (3,) that shows nearly all of a list of points, None if none does."""
    return direction_that_explains(index.at(index.sampled(FEW)))


def direction_that_explains(sample: np.ndarray) -> np.ndarray | None:
    """Return the direction (3,) that shows nearly all of a sample (M, 3) of the points, in any order, None if none."""
    sample = sample[np.lexsort(sample.T)]
    return explaining_direction(sample, _directions(sample))


def _best_direction(xyz: np.ndarray, sample: np.ndarray, viewpoint: np.ndarray | None) -> np.ndarray:
    """Return the direction whose orthographic view of a sample (M, 3) of the points shows most of it."""
    best, most = np.array([0.0, 0.0, -1.0]), -1.0
    for direction in _directions(xyz):
        if viewpoint is not None and direction @ (xyz.mean(axis=0) - viewpoint) < 0:
            direction = -direction
        share = shown(orthographic(sample, direction))
        if share > most + 1e-3:  # earlier candidates, the view from above first, win a draw
            best, most = direction, share
    return best


def shown(image: RangeImage) -> float:
    """Share of the points that lie in the layer nearest to the viewer."""
    return float(np.mean(image.behind <= DEPTH))


def _directions(xyz: np.ndarray) -> list[np.ndarray]:
    """Axes, from above first, then the principal directions."""
    centred = xyz - xyz.mean(axis=0)
    principal = np.linalg.eigh(centred.T @ centred)[1].T
    # An eigenvector's sign is left to rounding: its largest part points down its axis.
    signs = [-np.sign(vector[np.argmax(np.abs(vector))]) for vector in principal]
    axes = -np.eye(3)[[2, 0, 1]]
    return [*axes, *(sign * vector for sign, vector in zip(signs, principal, strict=True))]
