"""RangeImage: a cloud as a sensor sees it, one point a pixel.

Organized clouds come as they are; any other points are projected along a direction, onto the image plane of a camera,
or onto a sphere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.queries import at_places
from edgel._neighbors.spacing import covered_area
from edgel._range_image.grid_steps import angles, neighbours, parallel_direction, pitch_of, unevenness

FRAME = 4  # empty pixels around a projection, so that the cloud's rim lies beside a void
_SAMPLE = 2000  # points at which the evenness of the image is looked at
_RINGS = 0.25  # nearest neighbours this much flatter than 45 degrees lie on scan lines along the rows
_GRID, _EVEN = 0.9, 0.75  # nearest neighbours of a grid are 1 spacing away, those of random points 0.5
_LOOSE = 1.3  # pixels of random points are this much larger than their spacing, or a third would be empty
_PAIRS = 2_000  # neighbours along a column, and along a row, at which an organized cloud is looked at
_GRAZING = 1e-6  # cosine to the optical axis from which a point lies beside the camera
_MOST_PIXELS = 50  # for each point


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Which point each pixel shows.

    Attributes
    ----------
    index : (H, W) int64
        Row of the point, among those the image was made of; -1 = nothing.
    method : str
        "organized", "orthographic", "pinhole" or "spherical".
    pitch : (float, float)
        Size of a pixel, along a column and along a row of the image: radians where the rays leave a viewpoint, else in
        the cloud's unit.
    viewpoint : (3,) float64 or None
        Where the rays leave; None where they are parallel.
    direction : (3,) float64
        Unit vector along the parallel rays, or along the middle one.
    behind : (N,) float64
        How far each point lies behind the one that its pixel shows, in spacings; 0 for the points shown.
    """

    index: np.ndarray
    method: str
    pitch: tuple[float, float]
    viewpoint: np.ndarray | None
    direction: np.ndarray
    behind: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.index.shape[0], self.index.shape[1]


def organized(
    xyz: np.ndarray, rows: np.ndarray, shape: tuple[int, int], viewpoint: np.ndarray | None = None
) -> RangeImage:
    """See an organized cloud as its sensor did.

    Whether the rays leave the viewpoint or are parallel is read off the cloud: whichever makes the steps from pixel to
    pixel the more even.

    Parameters
    ----------
    xyz : (N, 3) float64, finite
    rows : (N,) int64
        Place of each point in the flat grid (`edgel.cloud.Points.rows`).
    shape : (int, int)
    viewpoint : (3,) float64, optional
        Default: the origin, where sensors have theirs.
    """
    index = np.full(shape[0] * shape[1], -1)
    index[rows] = np.arange(len(xyz))
    index = index.reshape(shape)
    eye = np.zeros(3) if viewpoint is None else viewpoint
    pairs = neighbours(index, most=_PAIRS)
    from_eye = [angles(xyz[a] - eye, xyz[b] - eye) for a, b in pairs]
    direction = parallel_direction(xyz, pairs)
    across = [_across(xyz[b] - xyz[a], direction) for a, b in pairs]
    middle = unit((xyz[pairs[0][0]] - eye).mean(axis=0)) if len(pairs[0][0]) else unit(xyz.mean(axis=0) - eye)
    if unevenness(across) < unevenness(from_eye):
        facing = direction @ (middle if viewpoint is not None or direction[2] == 0 else -direction * direction[2])
        direction = -direction if facing < 0 else direction
        steps, eye, middle = across, None, direction
    else:
        steps = from_eye
    if eye is not None:
        run_slices(_hide, len(xyz), xyz, rows, eye, index.ravel(), size=65536)
    pitch = [pitch_of(step) for step in steps]
    return RangeImage(index, "organized", (pitch[0], pitch[1]), eye, middle, np.zeros(len(xyz)))


@kernel
def _hide(start, stop, xyz, rows, eye, index):
    """Show nothing where points lie in the viewpoint itself: sensors report shots without an echo so."""
    for p in range(start, stop):
        if xyz[p, 0] == eye[0] and xyz[p, 1] == eye[1] and xyz[p, 2] == eye[2]:
            index[rows[p]] = -1


def _across(steps: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Lengths of steps (M, 3) across a direction."""
    return np.linalg.norm(steps - (steps @ direction)[:, None] * direction, axis=1)


def orthographic(xyz: np.ndarray, direction: np.ndarray) -> RangeImage:
    """Project points along parallel rays.

    Parameters
    ----------
    xyz : (N, 3) float64, finite
    direction : (3,)
        In which the viewer looks; (0, 0, -1) looks down.

    Examples
    --------
    >>> import numpy as np
    >>> x, y = np.meshgrid(np.arange(30.0), np.arange(20.0))
    >>> image = orthographic(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()], np.array([0, 0, -1]))
    >>> image.shape, int((image.index >= 0).sum())
    ((28, 38), 600)
    """
    right, down, forward = viewer_axes(direction, np.array([0.0, 0.0, 1.0]))
    middle = xyz.mean(axis=0)  # far from the origin the image's coordinates would lose their digits
    picture = (xyz - middle) @ np.column_stack([right, down])
    return _rastered(xyz, picture, xyz @ forward, "orthographic", None, forward)


def pinhole(xyz: np.ndarray, viewpoint: np.ndarray) -> RangeImage:
    """Project points onto the plane of a camera that looks from the viewpoint at their middle.

    Raises
    ------
    ValueError
        If a point lies beside or behind such a camera.
    """
    rays = xyz - viewpoint
    right, down, forward = viewer_axes(rays.mean(axis=0), np.array([0.0, 0.0, 1.0]))
    ahead = rays @ forward
    if not (ahead > _GRAZING * np.linalg.norm(rays, axis=1)).all():
        raise ValueError("viewpoint: some points lie beside or behind a camera there; use a spherical projection")
    picture = np.column_stack([rays @ right / ahead, rays @ down / ahead])
    return _rastered(xyz, picture, np.linalg.norm(rays, axis=1), "pinhole", viewpoint, forward)


def spherical(xyz: np.ndarray, viewpoint: np.ndarray, up: np.ndarray | None = None) -> RangeImage:
    """Project points onto a sphere about the viewpoint: azimuth along the rows, elevation along the columns.

    Parameters
    ----------
    xyz : (N, 3) float64, finite
    viewpoint : (3,)
    up : (3,), optional
        The sensor's axis; default +Z.
    """
    rays = xyz - viewpoint
    up = np.array([0.0, 0.0, 1.0]) if up is None else up
    level = rays.mean(axis=0)
    right, down, forward = viewer_axes(level - (level @ up) * up, up)
    ahead, aside = rays @ forward, rays @ right
    picture = np.column_stack([np.arctan2(aside, ahead), np.arctan2(rays @ down, np.hypot(ahead, aside))])
    return _rastered(xyz, picture, np.linalg.norm(rays, axis=1), "spherical", viewpoint, forward)


def viewer_axes(direction: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Right, down and forward of a viewer."""
    length = _length(direction)
    forward = direction / length if length > 1e-12 else np.roll(up, 1)
    if abs(forward @ up) > 0.99 * _length(up):
        up = np.roll(up, -1)
    right = _cross(forward, up)
    right = right / _length(right)
    return right, _cross(forward, right), forward


def _length(vector: np.ndarray) -> float:
    return math.sqrt(vector @ vector)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of two vectors; NumPy's, made for many, takes many times as long for two."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _rastered(
    xyz: np.ndarray,
    picture: np.ndarray,
    depth: np.ndarray,
    method: str,
    viewpoint: np.ndarray | None,
    forward: np.ndarray,
) -> RangeImage:
    """Let each pixel show the nearest of its points."""
    low, high = picture.min(axis=0), picture.max(axis=0)
    across, along = image_pitch(picture)
    growth = np.sqrt(((high - low) / (across, along) + 1).prod() / (_MOST_PIXELS * len(xyz) + 10_000))
    size = np.array([across, along]) * max(growth, 1.0)
    # Half a pixel off the lowest point: points of a grid then lie in the middle of their pixels.
    cells = np.floor((picture - low) / size + 0.5).astype(np.int64) + FRAME
    width, height = (int(count) for count in np.floor((high - low) / size + 0.5) + 1 + 2 * FRAME)
    index = np.full(height * width, -1)
    pixels = cells[:, 1] * width + cells[:, 0]
    _nearest(pixels, depth, xyz, index)
    pitch = (float(size[1]), float(size[0]))
    front = depth[index[pixels]]
    spacing = np.sqrt(pitch[0] * pitch[1]) * (1.0 if viewpoint is None else np.maximum(front, 1e-300))
    behind = (depth - front) / spacing
    return RangeImage(index.reshape(height, width), method, pitch, viewpoint, forward, behind)


def image_pitch(picture: np.ndarray) -> tuple[float, float]:
    """Measure how far apart points lie in an image, along its rows and along its columns.

    Parameters
    ----------
    picture : (N, 2) float64
        Place of each point: right, down.
    """
    extent = np.ptp(picture, axis=0)
    if len(picture) < 2 or not extent.any():
        return 1.0, 1.0
    side = float(np.sqrt(covered_area(picture) / len(picture)))
    flat = np.column_stack([picture, np.zeros(len(picture))])
    index = build_index(flat)
    places = index.evenly_sampled(_SAMPLE)
    points = index.order[places]
    near = knn(index, at_places(index, places), min(9, len(flat)))
    # The nearest that is elsewhere: clouds repeat points.
    elsewhere = near.distances > 1e-6 * side
    first = np.argmax(elsewhere, axis=1)
    known = elsewhere.any(axis=1)
    picked = near.points[np.arange(len(points)), first][known]
    step = np.abs(picture[picked] - picture[points[known]])
    if len(step) == 0:
        return side, side
    right, down = np.median(step, axis=0)
    if down < _RINGS * right and right < side:
        return float(right), float(side * side / right)
    nearest = float(np.median(np.hypot(*step.T)))
    if nearest > _GRID * side:  # exactly its step: pixels a little smaller or larger would leave out whole columns
        return nearest, nearest
    side *= 1.0 if nearest > _EVEN * side else _LOOSE
    return side, side


@kernel
def _nearest(pixels, depth, xyz, index):
    for p in range(len(pixels)):
        q = index[pixels[p]]
        if q < 0 or depth[p] < depth[q]:
            index[pixels[p]] = p
        elif depth[p] == depth[q]:
            for axis in range(3):  # of two at the same depth the one of smaller coordinates, whatever their order
                if xyz[p, axis] != xyz[q, axis]:
                    if xyz[p, axis] < xyz[q, axis]:
                        index[pixels[p]] = p
                    break


def unit(vector: np.ndarray) -> np.ndarray:
    """Unit vector along a vector (3,), +Z where it has no length."""
    length = np.linalg.norm(vector)
    return vector / length if length > 0 else np.array([0.0, 0.0, 1.0])
