"""From where a cloud is best looked at: as its sensor did, along one direction, or not in one view at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel.cloud import Cloud
from edgel.raster import Raster, organized, orthographic, pinhole, spherical

METHODS = ("auto", "surface", "organized", "orthographic", "pinhole", "spherical")

SHOWN = 0.97  # least share of the points that one view has to show
DEPTH = 3.0  # spacings behind the nearest point of its pixel within which a point still shows
_CAMERA = 0.5  # least cosine to the mean ray in the view of a camera


@dataclass(frozen=True, eq=False)
class Viewing:
    """How to look at a cloud, and why.

    Attributes
    ----------
    method : str
        "organized", "orthographic", "pinhole", "spherical", or "surface": no view shows it all.
    reason : str
        One line for people.
    raster : Raster or None
        What the view shows, where one had to be made to find out.
    """

    method: str
    reason: str
    raster: Raster | None = None


def choose_method(cloud: Cloud, xyz: np.ndarray, viewpoint: np.ndarray | None = None) -> Viewing:
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
    >>> choose_method(Cloud(hill), hill).method, choose_method(Cloud(hill, shape=(20, 30)), hill).method
    ('surface', 'organized')
    """
    if cloud.shape is not None and min(cloud.shape) > 1:
        return Viewing("organized", f"the points form a grid of {cloud.shape[0]} x {cloud.shape[1]}")
    viewpoint = cloud.viewpoint if viewpoint is None else viewpoint
    if viewpoint is not None:
        rays = xyz - viewpoint
        away = np.linalg.norm(rays, axis=1)
        if away.min() > 0:
            middle = rays.mean(axis=0)
            camera = (rays @ middle >= _CAMERA * away * np.linalg.norm(middle)).all() and middle.any()
            # A spinning sensor may see a narrow sector too: its lines lie farther apart than its shots.
            raster = spherical(xyz, viewpoint)
            if camera and raster.pitch[0] == raster.pitch[1]:
                raster = pinhole(xyz, viewpoint)
            share = shown(raster, xyz)
            if share >= SHOWN:
                return Viewing(raster.method, f"{share:.0%} of the points show from the viewpoint", raster)
        else:
            share = 0.0
        return Viewing("surface", f"only {share:.0%} of the points show from the viewpoint")
    return Viewing("surface", "the points form no grid and the sensor's place is not known")


def look(cloud: Cloud, xyz: np.ndarray, rows: np.ndarray, method: str, viewpoint: np.ndarray | None) -> Viewing:
    """Look at a cloud in the way that is asked for, or ("auto") the best one; the raster is there unless "surface".

    Parameters
    ----------
    cloud : Cloud
    xyz : (N, 3) float64
        Its finite points.
    rows : (N,) int64
        Their rows in the cloud.
    method : str
        One of `METHODS`.
    viewpoint : (3,) float64 or None

    Raises
    ------
    ValueError
        If the cloud lacks what the method needs.
    """
    viewing = choose_method(cloud, xyz, viewpoint) if method == "auto" else Viewing(method, "asked for")
    if viewing.raster is not None or viewing.method == "surface":
        return viewing
    if viewing.method == "orthographic":
        raster, _ = _best_direction(xyz, viewpoint)
    elif viewing.method == "organized":
        if cloud.shape is None or min(cloud.shape) < 2:
            raise ValueError("method: 'organized' needs points in a grid, (H, W, 3); use 'auto' for a list of points")
        raster = organized(xyz, rows, cloud.shape, viewpoint)
    else:
        if viewpoint is None:
            raise ValueError(f"method: {method!r} needs to know where the sensor was; give viewpoint, or use 'auto'")
        raster = (pinhole if viewing.method == "pinhole" else spherical)(xyz, viewpoint)
    return Viewing(viewing.method, viewing.reason, raster)


def _best_direction(xyz: np.ndarray, viewpoint: np.ndarray | None) -> tuple[Raster | None, float]:
    """Return the orthographic view that shows most, and the share of the points that it shows."""
    best, most = None, -1.0
    for direction in _directions(xyz):
        if viewpoint is not None and direction @ (xyz.mean(axis=0) - viewpoint) < 0:
            direction = -direction
        raster = orthographic(xyz, direction)
        share = shown(raster, xyz)
        if share > most + 1e-3:  # earlier candidates, the view from above first, win a draw
            best, most = raster, share
    return best, most


def shown(raster: Raster, xyz: np.ndarray) -> float:
    """Share of the points that lie in the layer nearest to the viewer."""
    return float(np.mean(raster.behind <= DEPTH))


def _directions(xyz: np.ndarray) -> list[np.ndarray]:
    """Axes, from above first, then the principal directions."""
    centred = xyz - xyz.mean(axis=0)
    principal = np.linalg.eigh(centred.T @ centred)[1].T
    # An eigenvector's sign is left to rounding: its largest part points down its axis.
    signs = [-np.sign(vector[np.argmax(np.abs(vector))]) for vector in principal]
    axes = -np.eye(3)[[2, 0, 1]]
    return [*axes, *(sign * vector for sign, vector in zip(signs, principal, strict=True))]
