"""The published method, step by step: project, Canny, back-project, and normals at the edge points only.

"Intelligent Point Cloud Edge Detection Method Based on Projection Transformation", Wireless Communications and Mobile
Computing (Hindawi). What it leaves open is chosen by measurement (docs/decisions.md), what it has wrong is listed with
the numbers recomputed in docs/errata.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from edgel._faces import Faces
from edgel._neighbors.kdtree import bounds, build_index
from edgel._neighbors.normals import Normals, by_offset, check_num_neighbors, fit_planes_within, no_planes
from edgel._neighbors.queries import at_points
from edgel._neighbors.spacing import occupied_spacing
from edgel._scale import at_scale, check_scale
from edgel._stages import Stages
from edgel.cloud import check_points
from edgel.edges import EdgeKind, Edges
from edgel.io.errors import printable
from edgel.paper.canny import CannyResult, canny, check_gaussian
from edgel.paper.projection import PixelGrid, back_project, grey_image, points_near, project

PIXEL_SPACINGS = 4.0  # default pixel, in point spacings: coarse enough for no holes, which would all be edges
TOLERANCE_SHARE = 0.018  # default tolerance, of the image's size: both of the paper's parts give about 10 %
_STEP_RESPONSE = 4.0 * 255.0  # the Sobel magnitude of the largest step of grey, which is strength 1
_MAX_PIXELS = 2**28
# Pixels, in which neighbours are looked for first: just below three, so that three more on every side are enough. On a
# level surface the 16 nearest reach 0.56 of the default pixel, on the steep sides of the paper's tee up to 3.7; with
# 0.99 two fifths of its edge points had to be tried again, with 2.99 one in 3,000.
_FIRST_REACH = 2.99


@dataclass(frozen=True, eq=False, repr=False)
class PaperEdges(Edges):
    """Edges of the published method, with the image of every step.

    It knows of one face only: the second normal, `direction` and `angle` are NaN, `position` is the point itself. All
    images have a frame of one empty pixel: the part touches the border, and its outline may be steepest just outside.
    Row 0 lies at the smallest y.

    Attributes
    ----------
    planes : Normals
        Best-fit plane of each edge point's neighbours in the whole cloud, with D and e of eq. 20.
    grid : PixelGrid
        Where the pixels lie in the cloud.
    projection : (H + 2, W + 2) float64
        The highest z in each pixel, in the cloud's unit, NaN where no point falls (eq. 1-2).
    image : (H + 2, W + 2) float64
        The projection in grey, 0 where no point falls (eq. 5-6, fig. 1c, 3a).
    smoothed : (H + 2, W + 2) float64
        The image after the Gaussian (eq. 12).
    gradient : (H + 2, W + 2) float64
        Magnitude of the smoothed image's Sobel gradient (eq. 13).
    thinned : (H + 2, W + 2) float64
        The gradient where non-maximum suppression leaves it, 0 elsewhere (section 3.3).
    edge_map : (H + 2, W + 2) bool
        The edge pixels (fig. 3b): Canny's, or those that were given.
    """

    planes: Normals
    grid: PixelGrid
    projection: np.ndarray
    image: np.ndarray
    smoothed: np.ndarray
    gradient: np.ndarray
    thinned: np.ndarray
    edge_map: np.ndarray

    def take(self, rows: np.ndarray) -> Self:
        """Return some of the edge points; the images stay those of all."""
        return replace(super().take(rows), planes=self.planes.take(rows))


def detect(
    points: Any,
    *,
    width: int | None = None,
    height: int | None = None,
    kernel_size: int = 5,
    sigma: float = 1.4,
    low: float = 16.0,
    high: float = 40.0,
    tolerance: float | None = None,
    gray_min: float = 100.0,
    num_neighbors: int = 16,
    scale: float = 1.0,
    edge_map: Any = None,
    progress: Callable[[str], None] | None = None,
) -> PaperEdges:
    """Find edge points and their normals as the paper does.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        Seen along Z from above.
    width, height : int, optional
        Size W x H of the image, in pixels. Default: square pixels of 4 point spacings; give one for square pixels.
    kernel_size : int
        Width of the Gaussian's square, in pixels, odd (eq. 7).
    sigma : float
        Its standard deviation, in pixels (eq. 7).
    low, high : float
        Thresholds on the gradient of the smoothed grey, in Sobel units: a step of g grey levels gives about 2.3 g.
    tolerance : float, optional
        Half the side t of the window around each edge pixel, in the cloud's unit. Default: 1.8 % of the root of the
        image's area, and at least a pixel; so the share of edge points, about 10 % on the paper's parts, does not
        depend on how densely they were scanned.
    gray_min : float
        Grey of the lowest point, 0 to 255 (eq. 5); 0 is where no point falls.
    num_neighbors : int
        k of the plane fits (step 9).
    scale : float
        Side of the voxels to one point of which the cloud is thinned first, in median spacings; at 1 it is not thinned.
    edge_map : (H + 2, W + 2) bool array_like, optional
        Edge pixels of your own in place of Canny's, such as another detector finds in `PaperEdges.image` of the same
        cloud; back-projection and normals are as ever, and `low` and `high` have no say.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Returns
    -------
    PaperEdges
        Normals are turned so that ``D > 0`` (eq. 20).

    Raises
    ------
    TypeError, ValueError
        If `points` carries no coordinates, fewer than 3 finite ones, or has no extent along x or y; if an option is out
        of its range.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.linspace(0, 1, 200), np.linspace(0, 1, 200))
    >>> edges = edgel.paper.detect(np.c_[x.ravel(), y.ravel(), (x.ravel() > 0.5) * 0.2])
    >>> edges.image.shape, 0.1 < edges.share < 0.5
    ((52, 52), True)
    """
    if not 0 <= gray_min <= 255:
        raise ValueError(f"gray_min: expected a grey level from 0 to 255, got {gray_min}")
    check_gaussian(kernel_size, sigma)
    checked = check_points(points)
    check_num_neighbors(num_neighbors, len(checked.xyz))
    check_scale(scale)
    if scale > 1:
        options = {"width": width, "height": height, "kernel_size": kernel_size, "sigma": sigma}
        options |= {"low": low, "high": high, "tolerance": tolerance, "gray_min": gray_min}
        options |= {"num_neighbors": num_neighbors, "edge_map": edge_map}
        return at_scale(detect, points, scale, progress=progress, **options)
    stages = Stages(progress)
    with stages("projection"):
        grid = choose_grid(checked.xyz, width, height)
        highest = project(checked.xyz, grid)
        image = np.pad(grey_image(highest, grid, gray_min), grid.frame)
        given = None if edge_map is None else _check_edge_map(edge_map, image.shape)
    with stages("canny"):
        found = canny_of_projection(image, kernel_size, sigma, low, high)
        found = found if given is None else replace(found, edges=given)
    with stages("back-projection"):
        window = choose_tolerance(tolerance, grid)
        hits = back_project(checked.xyz, grid, found.edges, found.magnitude, window)
    with stages("normals"):
        planes = by_offset(local_plane_fits(checked.xyz, grid, hits.rows, num_neighbors))
    return PaperEdges(
        index=checked.rows[hits.rows],
        kind=np.full(len(hits.rows), EdgeKind.IMAGE, np.uint8),
        strength=np.clip(hits.strength / _STEP_RESPONSE, np.finfo(float).tiny, 1.0),
        **vars(Faces.of_points(checked.xyz[hits.rows], planes.normals)),
        orientation="unknown",
        planes=planes,
        num_points=checked.num_input,
        num_dropped=checked.num_dropped,
        method="paper",
        reason="the published method looks along Z" + ("" if given is None else "; the edge map was given"),
        parameters={
            "width": grid.width,
            "height": grid.height,
            "kernel_size": kernel_size,
            "sigma": sigma,
            **({"low": low, "high": high} if given is None else {}),
            "tolerance": window,
            "gray_min": gray_min,
            "num_neighbors": num_neighbors,
        },
        seconds=stages.seconds,
        grid=grid,
        projection=np.pad(highest, grid.frame, constant_values=np.nan),
        image=image,
        smoothed=found.smooth,
        gradient=found.magnitude,
        thinned=found.thinned,
        edge_map=found.edges,
    )


def local_plane_fits(xyz: np.ndarray, grid: PixelGrid, rows: np.ndarray, num_neighbors: int) -> Normals:
    """Fit planes to the k nearest of all points (N, 3), at some rows (M,), without sorting all of them.

    Two points are at least as far apart in space as in the projection, so only points in pixels nearby can be among
    the neighbours. A point whose neighbours reach as far as the pixels looked at is tried again with more of them.
    """
    k = check_num_neighbors(num_neighbors, len(xyz))
    planes = no_planes(len(rows))
    left, reach = np.arange(len(rows)), _FIRST_REACH * max(grid.pixel)
    while len(left):
        near = points_near(xyz, grid, rows[left], reach)
        if len(near) >= k:
            asked = np.zeros(len(xyz), np.bool_)
            asked[rows[left]] = True
            index = build_index(xyz[near])
            found, distances = fit_planes_within(index, at_points(index, np.flatnonzero(asked[near])), k)
            sure = (distances < reach) | (len(near) == len(xyz))
            planes.put(left[sure], found.take(sure))
            left = left[~sure]
        reach *= 4.0
    return planes


def choose_grid(xyz: np.ndarray, width: int | None, height: int | None) -> PixelGrid:
    """Lay the image over the cloud's bounding box (eq. 3-4), with square pixels where a size is not given.

    A frame of one pixel goes round it: no point falls there, so grey is 0, and Canny may find the outline there.
    """
    for name, size in (("width", width), ("height", height)):
        if size is not None and (not isinstance(size, int | np.integer) or not 1 <= size <= _MAX_PIXELS):
            raise ValueError(
                f"{name}: expected a number of pixels from 1 to {_MAX_PIXELS:,}, got {printable(size, 40)}"
            )
    lower, upper = bounds(xyz)
    extent = upper - lower
    for axis, name in enumerate("xy"):
        if not extent[axis] > 0:
            raise ValueError(
                f"points: all have {name} = {lower[axis]:g}, so the paper's vertical projection shows only a line; "
                "turn the cloud so that its face looks along Z, or use edgel.detect"
            )
    if width is not None:
        pixel = extent[0] / width
    elif height is not None:
        pixel = extent[1] / height
    else:
        pixel = PIXEL_SPACINGS * occupied_spacing(xyz, lower, upper)
    with np.errstate(divide="ignore", over="ignore"):  # extents of some 1e-320
        columns, rows = width or max(extent[0] / pixel, 1.0), height or max(extent[1] / pixel, 1.0)
    if not columns * rows <= _MAX_PIXELS:
        raise ValueError(
            f"width, height: an image of {columns:.6g} x {rows:.6g} pixels is larger than {_MAX_PIXELS:,}; give a "
            "smaller size"
        )
    columns, rows = round(columns), round(rows)
    return PixelGrid(int(columns), int(rows), lower, upper, frame=1)


def choose_tolerance(tolerance: float | None, grid: PixelGrid) -> float:
    """Return half the side of the back-projection's window, in the cloud's unit."""
    if tolerance is None:
        extent = grid.upper - grid.lower
        return float(max(*grid.pixel, TOLERANCE_SHARE * np.sqrt(extent[0] * extent[1])))
    if not 0 < tolerance < np.inf:
        raise ValueError(f"tolerance: expected a length above 0, in the cloud's unit, got {tolerance}")
    return float(tolerance)


def canny_of_projection(image: np.ndarray, kernel_size: int, sigma: float, low: float, high: float) -> CannyResult:
    """Run Canny on a projection (eq. 7-17, sections 3.1-3.4), with empty pixels all round it.

    The cloud touches all four borders of its image; no point falls beyond them, so grey is 0 there too. If the border
    pixels were repeated instead, the rims at the borders would be missed.
    """
    frame = kernel_size // 2 + 2
    found = canny(np.pad(image, frame), kernel_size=kernel_size, sigma=sigma, low=low, high=high)
    inner = (slice(frame, -frame), slice(frame, -frame))
    return CannyResult(*(getattr(found, step.name)[inner] for step in fields(found)))


def _check_edge_map(edge_map: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return a user's edge map as bool of the image's shape; ValueError if it is none."""
    given = np.asarray(edge_map)
    if given.shape != shape or given.dtype.kind not in "biu":
        raise ValueError(
            f"edge_map: expected bool of shape {shape}, that of the projection with its frame of one pixel "
            f"(PaperEdges.image), got {given.dtype} of shape {given.shape}; give width and height if it is another's"
        )
    return np.ascontiguousarray(given, np.bool_)
