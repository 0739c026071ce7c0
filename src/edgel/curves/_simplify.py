"""Curves with fewer vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel.curves._curves import Curves


def simplify(curves: Curves, tolerance: float) -> Curves:
    """Leave out vertices from which the curve stays nearer than a tolerance (Douglas and Peucker 1973).

    Ends stay, and so do corners; lengths, radii and all that was measured stay those of the curve itself.

    Parameters
    ----------
    curves : Curves
    tolerance : float
        In the cloud's unit, 0 or more.

    Raises
    ------
    ValueError
        If the tolerance is none.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    >>> r, t = np.meshgrid(np.arange(1.0, 20.0), t)
    >>> disc = np.c_[(r * np.cos(t)).ravel(), (r * np.sin(t)).ravel(), 0 * r.ravel()]
    >>> rim = edgel.curves.trace(disc, edgel.detect(disc, kinds="boundary"))
    >>> len(edgel.curves.simplify(rim, 1.0).vertices) < len(rim.vertices)
    True
    """
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise ValueError(f"tolerance: expected a length of 0 or more, got {tolerance}")
    paths = [_thinned(curves.points_of(curve), tolerance) for curve in range(len(curves))]
    start = np.concatenate([[0], np.cumsum([len(path) for path in paths])]).astype(np.int64)
    vertices = np.concatenate(paths) if paths else curves.vertices
    return replace(curves, vertices=vertices, start=start)


def _thinned(path: np.ndarray, tolerance: float) -> np.ndarray:
    kept = np.zeros(len(path), bool)
    kept[[0, -1]] = True
    if (path[0] == path[-1]).all():  # a loop has no chord: it is halved first
        kept[np.linalg.norm(path - path[0], axis=1).argmax()] = True
    stack = list(zip(np.flatnonzero(kept)[:-1], np.flatnonzero(kept)[1:], strict=True))
    while stack:
        a, b = stack.pop()
        if b - a < 2:
            continue
        chord, inner = path[b] - path[a], path[a + 1 : b] - path[a]
        along = np.clip(inner @ chord / max(chord @ chord, 1e-300), 0, 1)
        far = np.linalg.norm(inner - along[:, None] * chord, axis=1)
        at = int(far.argmax())
        if far[at] > tolerance:
            kept[a + 1 + at] = True
            stack += [(a, a + 1 + at), (a + 1 + at, b)]
    return path[kept]
