"""From where a cloud is best looked at: as its sensor did, along one direction, or not in one view at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from edgel._neighbors.kdtree import NeighborIndex
from edgel._range_image.range_image import RangeImage, organized, orthographic, pinhole, spherical
from edgel.cloud import Cloud, Points

METHODS = ("auto", "surface", "organized", "orthographic", "pinhole", "spherical")

SHOWN = 0.97  # least share of the points that one view has to show
DEPTH = 3.0  # spacings behind the nearest point of its pixel within which a point still shows
_SAMPLE = 50_000  # points at which directions are compared
_CAMERA = 0.5  # least cosine to the mean ray in the view of a camera
_RINGS = (8, 256)  # how many lasers a spinning sensor has
_RING_SHOTS = 100  # least mean number of shots of each
_ON_RINGS = 0.95  # least share of the shots that lie on them
_GAP = 5e-4  # of the range of elevations: least gap between rings
_SHARP = 0.3  # of the gap between two rings: most that a ring is thick


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

    A projection of a list of points loses to the surface even where one shows all of them: its pixels are no finer than
    the spacing (docs/decisions.md).

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
    >>> best_view(Cloud(hill), hill).method, best_view(Cloud(hill, shape=(20, 30)), hill).method
    ('surface', 'organized')
    """
    if cloud.shape is not None and min(cloud.shape) > 1:
        return View("organized", f"the points form a grid of {cloud.shape[0]} x {cloud.shape[1]}")
    viewpoint = cloud.viewpoint if viewpoint is None else viewpoint
    if viewpoint is not None:
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
    if (rings := count_rings(xyz)) > 0:
        reason = f"the points lie on {rings} rings about the origin, as those of a spinning sensor there"
        return View("spherical", reason, _from_viewpoint(spherical, xyz, np.zeros(3)))
    return View("surface", "the points form no grid and the sensor's place is not known")


def count_rings(xyz: np.ndarray) -> int:
    """Count the lasers of a spinning sensor at the origin, its axis +Z; 0 where the elevations of points show none.

    Parameters
    ----------
    xyz : (N, 3) float64

    Examples
    --------
    >>> import numpy as np
    >>> azimuth, elevation = np.meshgrid(np.arange(0, 6.28, 0.01), np.radians(np.arange(-15, 16, 2)))
    >>> rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1).reshape(-1, 3)
    >>> count_rings(rays * (5 + np.sin(rays[:, :1] * 9)))
    16
    """
    level = np.hypot(xyz[:, 0], xyz[:, 1])
    away = level + np.abs(xyz[:, 2]) > 0
    elevation = np.sort(np.arctan2(xyz[away, 2], level[away]))
    if len(elevation) < _RINGS[0] * _RING_SHOTS:
        return 0
    parted = np.flatnonzero(np.diff(elevation) > _GAP * (elevation[-1] - elevation[0]))
    first, last = np.append(0, parted + 1), np.append(parted, len(elevation) - 1)
    full = last - first + 1 >= _RING_SHOTS
    first, last = first[full], last[full]
    if not _RINGS[0] <= len(first) <= _RINGS[1] or (last - first + 1).sum() < _ON_RINGS * len(elevation):
        return 0
    thick, apart = elevation[last] - elevation[first], elevation[first[1:]] - elevation[last[:-1]]
    return len(first) if np.median(thick) < _SHARP * np.median(apart) else 0


def _from_viewpoint(project: Callable[..., RangeImage], xyz: np.ndarray, viewpoint: np.ndarray) -> RangeImage:
    """Project the points; those in the viewpoint itself (sensors report shots without an echo so) do not show."""
    rows = np.flatnonzero((xyz != viewpoint).any(axis=1))
    if len(rows) == len(xyz):
        return project(xyz, viewpoint)
    image = project(xyz[rows], viewpoint)
    behind = np.zeros(len(xyz))
    behind[rows] = image.behind
    return replace(image, index=np.where(image.index >= 0, rows[image.index], -1), behind=behind)


def choose_view(cloud: Cloud, finite: Points, index: NeighborIndex, method: str, viewpoint: np.ndarray | None) -> View:
    """View a cloud in the way that is asked for, or ("auto") the best one.

    Parameters
    ----------
    cloud : Cloud
    finite : Points
        Its finite points.
    index : NeighborIndex
        Of them.
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
