"""The colors of a cloud as channels in [0, 1]."""

from __future__ import annotations

import numpy as np

from edgel._objects import COLORS
from edgel.cloud import Cloud

_INTENSITY = ("intensity", "scalar_intensity", "reflectance", "reflectivity")
_PERCENTILES = (1.0, 99.0)  # of the intensity, which has no range of its own: a few glints must not decide


def color_channels(cloud: Cloud) -> np.ndarray | None:
    """Return the colors of a cloud as channels in which equal differences look about equally large.

    Of rgb, Ohta's ``(r + g + b) / 3``, ``(r - b) / 2`` and ``(2 g - r - b) / 4`` (1980,
    doi:10.1016/0146-664X(80)90047-7), the latter two shifted by 1/2: brightness apart from hue, in which shadows make
    no step and sensors are noisier. Values stay as they are encoded: the gamma of sRGB is near enough to lightness.
    Otherwise the intensity between its 1st and its 99th percentile.

    Parameters
    ----------
    cloud : Cloud
        With ``red``, ``green``, ``blue`` (integers of 8 or 16 bits, of 16 also when they hold 8; or floats up to 1, 255
        or 65535), or ``intensity``; capital letters do not matter.

    Returns
    -------
    (N, 3) or (N, 1) float64, or None
        In [0, 1], NaN where the color is not finite; None when the cloud carries neither, or one value everywhere.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> byte = np.array([0, 255], np.uint8)
    >>> color_channels(edgel.Cloud(np.zeros((2, 3)), {"red": byte, "green": byte, "blue": byte}))
    array([[0. , 0.5, 0.5],
           [1. , 0.5, 0.5]])
    """
    rgb = rgb_of(cloud)
    if rgb is not None and (np.ptp(rgb[_known(cloud, rgb)], axis=0) > 0).any():
        r, g, b = rgb.T
        return np.column_stack([(r + g + b) / 3, (r - b) / 2 + 0.5, (2 * g - r - b) / 4 + 0.5])
    intensity = intensity_of(cloud)
    return None if intensity is None else intensity[:, None]


def rgb_of(cloud: Cloud) -> np.ndarray | None:
    """Return red, green and blue (N, 3) in [0, 1], NaN where not finite; None when the cloud carries none."""
    columns = _columns(cloud)
    if not all(name in columns for name in COLORS):
        return None
    rgb = np.column_stack([columns[name] for name in COLORS]).astype(np.float64)
    rgb[~np.isfinite(rgb).all(axis=1)] = np.nan
    known = rgb[_known(cloud, rgb)]
    return np.clip(rgb / _full_range(columns["red"].dtype, known.max()), 0.0, 1.0) if len(known) else None


def intensity_of(cloud: Cloud) -> np.ndarray | None:
    """Return the intensity (N,) in [0, 1], its 1st percentile 0 and its 99th 1, NaN where not finite.

    None when the cloud carries none, or one value everywhere.
    """
    columns = _columns(cloud)
    for name in _INTENSITY:
        if name in columns:
            values = columns[name].astype(np.float64)
            values[~np.isfinite(values)] = np.nan
            known = values[_known(cloud, values)]
            if len(known) and np.ptp(known) > 0:
                low, high = np.percentile(known, _PERCENTILES)
                if low == high:
                    low, high = known.min(), known.max()
                return np.clip((values - low) / (high - low), 0.0, 1.0)
    return None


def _columns(cloud: Cloud) -> dict[str, np.ndarray]:
    return {name.lower(): values for name, values in cloud.attributes.items() if values.ndim == 1}


def _known(cloud: Cloud, values: np.ndarray) -> np.ndarray:
    """Points (N,) bool with finite coordinates and a value."""
    known = ~np.isnan(values if values.ndim == 1 else values[:, 0])
    return known & np.isfinite(cloud.xyz).all(axis=1)


def _full_range(kind: np.dtype, largest: float) -> float:
    """Largest value that colors of this type can have; of 16 bits and floats the values tell how many they use."""
    if kind.kind == "f" and largest <= 1.0:
        return 1.0
    return 255.0 if kind.itemsize == 1 or largest <= 255.0 else max(65535.0, largest)
