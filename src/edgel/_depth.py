"""From depth images to organized clouds: the one back-projection of arrays, frames and files."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from edgel._intrinsics import as_intrinsics
from edgel._kernels.parallel import kernel, run_slices
from edgel.cloud import Cloud

MILLIMETRE = 0.001
"""Metres in a count of integer depths, unless the camera says otherwise."""


def from_depth(depth: Any, intrinsics: Any, *, depth_scale: float | None = None) -> Cloud:
    """Make an organized cloud of a depth image, in the camera's frame: x right, y down, z forward.

    Parameters
    ----------
    depth : (H, W) or (H, W, 1) array_like
        Depths along the optical axis: integers (counts), or floats. What is 0, negative, NaN, infinite or masked
        (`numpy.ma`) is no return.
    intrinsics : Intrinsics, mapping, object or array_like
        The camera, as `edgel.Intrinsics`, as ``(fx, fy, cx, cy)``, as a 3 x 3 matrix, or as others write it:

        - RealSense: ``rs.intrinsics`` or a mapping with ``fx fy ppx ppy``, ``width``, ``height``, ``coeffs``.
        - Open3D: ``PinholeCameraIntrinsic`` or its JSON, ``intrinsic_matrix`` of nine numbers column by column. In the
          metadata of its recordings (with ``depth_format``) ``depth_scale`` is counts in one metre.
        - ROS: ``CameraInfo``, 1 or 2, or its YAML file as a mapping: ``P`` (of the rectified image) where that is not
          all zeros, else ``K``.
        - BOP: an entry of ``scene_camera.json`` with ``cam_K``, or all of it if all images share one camera. Its
          ``depth_scale`` is millimetres in one count; the cloud comes out in metres all the same. (BOP's
          ``camera.json``, with ``fx``, is read as `Intrinsics`: by its ``depth_scale`` it gives millimetres.)
    depth_scale : float, optional
        Cloud units in one count. Default: that of `intrinsics`, else 0.001 for integers (millimetres to metres) and 1
        for floats.

    Returns
    -------
    Cloud
        (H, W) points, NaN where there was no return. The viewpoint is (0, 0, 0).

    Raises
    ------
    TypeError
        If `depth` holds no integers or floats, or `intrinsics` is no camera.
    ValueError
        If `depth` is no (H, W) image, or empty, or not of the camera's size; if the camera has lens distortion or skew.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> depth = np.array([[0, 2000, 2000]], np.uint16)
    >>> cloud = edgel.from_depth(depth, (10, 10, 0, 0))
    >>> cloud.shape, cloud.xyz[2]
    ((1, 3), array([0.4, 0. , 2. ]))
    """
    image = _as_image(depth)
    camera = as_intrinsics(intrinsics)
    if depth_scale is not None:
        camera = replace(camera, depth_scale=depth_scale)
    height, width = image.shape
    if camera.width not in (None, width) or camera.height not in (None, height):
        raise ValueError(
            f"the image is {width} x {height}, the intrinsics are for {camera.width} x {camera.height}; pass those of "
            "this image"
        )
    scale = camera.depth_scale or (1.0 if image.dtype.kind == "f" else MILLIMETRE)
    with np.errstate(over="ignore"):  # of an absurd camera: infinite, points that are not there
        right, down = (np.arange(width) - camera.cx) / camera.fx, (np.arange(height) - camera.cy) / camera.fy
    xyz = np.empty((height, width, 3))
    # A copy, whatever the type: the kernel is compiled for one.
    run_slices(_back_project, height, np.array(image, np.float64, order="C"), scale, right, down, xyz, size=_ROWS)
    return Cloud(xyz, viewpoint=np.zeros(3))


_ROWS = 64  # of a slice


@kernel
def _back_project(start, stop, depth, scale, right, down, xyz):
    """Write the points (H, W, 3) of depths (H, W): `right` (W,) and `down` (H,) are x and y of the rays at depth 1."""
    for row in range(start, stop):
        for col in range(depth.shape[1]):
            z = depth[row, col] * scale
            if not 0.0 < z < np.inf:
                z = np.nan
            xyz[row, col, 0] = right[col] * z
            xyz[row, col, 1] = down[row] * z
            xyz[row, col, 2] = z


def _as_image(depth: Any) -> np.ndarray:
    """Check depths and return them as (H, W), 0 where they were masked."""
    masked = np.ma.asarray(depth)
    if masked.dtype.kind not in "iuf":
        raise TypeError(
            f"depth: expected integers or floats of shape (H, W), got {type(depth).__name__} ({masked.dtype}); of a "
            "camera's frame pass the array, such as np.asanyarray(frame.get_data())"
        )
    image = masked.filled(0)
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[:, :, 0]
    if image.ndim != 2:
        remedy = "make a cloud of coordinates with edgel.Cloud(points)" if image.ndim == 3 else "reshape it to (H, W)"
        raise ValueError(f"depth: expected shape (H, W), got {image.shape}; pass one image of one channel, or {remedy}")
    if not image.size:
        raise ValueError(f"depth: an image of shape {image.shape} holds no pixels; pass one with some")
    return image
