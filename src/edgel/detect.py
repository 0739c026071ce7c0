"""The whole method on one screen: what `edgel.detect` does with a cloud."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Literal

import numpy as np

from edgel import paper
from edgel.cloud import as_cloud, as_vector, check_points
from edgel.color import color_channels, color_edges
from edgel.edges import EdgeKind, Edges, as_kinds
from edgel.evidence import judge, survey
from edgel.evidence.faces import faces
from edgel.kdtree import build_index
from edgel.normals import check_num_neighbors, plane_fits, towards
from edgel.outline import outline_kinds
from edgel.stages import Stages
from edgel.viewing import METHODS, look

PRESETS = ("default", "paper")
DEFAULT_KINDS = EdgeKind.BOUNDARY | EdgeKind.OCCLUDING | EdgeKind.OCCLUDED | EdgeKind.CREASE
LIKELY = 0.5  # strength of an edge that is as likely as not
EVEN = (0.45, 0.5)  # probability of an edge that is as likely as not: least, on the vaguest cloud, and most
COLOR = 0.2  # contrast of a color edge that is as likely as not


def detect(
    points: Any,
    *,
    preset: Literal["default", "paper"] = "default",
    kinds: EdgeKind | str | Iterable[str] = DEFAULT_KINDS,
    method: Literal["auto", "surface", "organized", "orthographic", "pinhole", "spherical"] = "auto",
    min_strength: float = LIKELY,
    num_neighbors: int = 16,
    viewpoint: Any = None,
    progress: Callable[[str], None] | None = None,
) -> Edges:
    """Find the edge points of a cloud, their kind, and their normals.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        Points with a NaN or infinite coordinate are left out and counted.
    preset : {"default", "paper"}
        "default" looks at every point's neighbours in 3D, and at the cloud as its sensor saw it where that is known.
        "paper" is the
        published method as it stands, with its defaults: Canny on a projection along Z. `edgel.paper.detect` has its
        options.
    kinds : EdgeKind, or str, or iterable of str
        The kinds of edge wanted, as flags or as names ("boundary", "occluding", "occluded", "crease", "color"); all but
        color unless told. A point of several kinds keeps the flags of those wanted. "paper" tells no kinds apart.
    method : {"auto", "surface", "organized", "orthographic", "pinhole", "spherical"}
        The way to look at the cloud: on the surface itself, from any side; along the rows and columns of an organized
        cloud; or in a projection of that kind. "auto" chooses, and `Edges.method` and `Edges.reason` say what and why.
    min_strength : float
        Least `Edges.strength` of the points returned, in (0, 1]; one half, on any cloud, is where an edge is as likely
        as not. Lower finds fainter edges and more that are none. "paper" has thresholds of its own.
    num_neighbors : int
        k of the plane fits that give the normals, the point itself among them; at least 3.
    viewpoint : (3,) array_like, optional
        Normals are turned towards it. Default: the sensor's position when the cloud knows it, else from above (+Z).
        With "paper" they have ``D > 0`` and no viewpoint can be given.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Returns
    -------
    Edges
        The same whatever the order of the points and the number of threads.

    Raises
    ------
    TypeError, ValueError
        If `points` carries no coordinates or fewer than 3 finite ones, or lies on one line or spot, where no surface
        is; if an option is out of its range.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    >>> roof = np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - 20)]
    >>> edges = edgel.detect(roof)
    >>> ridge = edges.index[edges.kind == edgel.EdgeKind.CREASE]
    >>> set(roof[ridge, 0].tolist())
    {20.0}
    """
    if preset not in PRESETS:
        raise ValueError(f"preset: expected one of {', '.join(PRESETS)}, got {preset!r}")
    kinds = as_kinds(kinds)
    if method not in METHODS:
        raise ValueError(f"method: expected one of {', '.join(METHODS)}, got {method!r}")
    if preset == "paper":
        if kinds != DEFAULT_KINDS:
            raise ValueError("kinds: the paper tells no kinds of edge apart; leave it out, or use the default preset")
        if method != "auto":
            raise ValueError("method: the paper has its own, along Z; leave it out, or use the default preset")
        if min_strength != LIKELY:
            raise ValueError("min_strength: the paper has thresholds of its own, see edgel.paper.detect; leave it out")
        if viewpoint is not None:
            raise ValueError("viewpoint: the paper turns normals by D > 0; leave it out, or use the default preset")
        return paper.detect(points, num_neighbors=num_neighbors, progress=progress)
    if not 0 < min_strength <= 1:
        raise ValueError(f"min_strength: expected a number above 0 and at most 1, got {min_strength}")
    cloud = as_cloud(points)
    viewpoint = cloud.viewpoint if viewpoint is None else as_vector(viewpoint, "viewpoint")
    checked = check_points(cloud)
    channels = color_channels(cloud) if EdgeKind.COLOR in kinds else None
    if EdgeKind.COLOR in kinds and channels is None:
        raise ValueError("kinds: color edges need red, green and blue or an intensity, and the cloud carries neither")
    k = check_num_neighbors(num_neighbors, len(checked.xyz))

    stages = Stages(progress)
    found = Marks(len(checked.xyz))
    with stages("index"):
        index = build_index(checked.xyz)
    with stages("survey"):
        surveyed = survey(index)
        if not surveyed.has_surface:
            raise ValueError("points: all lie on one line or spot, so there is no surface whose edges could be found")
    with stages("view"):
        viewing = look(cloud, checked.xyz, checked.rows, index, method, viewpoint)
    with stages("evidence"):
        verdict = judge(index, surveyed)
    with stages("decision"):
        found.mark(verdict.rows, EdgeKind.CREASE, strength(verdict.crease))
        if viewing.raster is None:
            found.mark(verdict.rows, EdgeKind.BOUNDARY, strength(verdict.outline))
        else:
            outline = outline_kinds(viewing.raster, checked.xyz)
            found.mark(np.arange(len(checked.xyz)), outline.kind, outline.strength)
    if EdgeKind.COLOR in kinds and channels is not None:
        with stages("color"):
            normals = surveyed.normals_in_order(index)
            contrast = color_edges(index, checked.xyz, normals, channels[checked.rows]).strength
            found.mark(np.arange(len(checked.xyz)), EdgeKind.COLOR, color_strength(contrast))
    with stages("faces"):
        kind = found.of(kinds, min_strength)
        edge = np.flatnonzero(kind)
        at = checked.xyz[edge]
        planes = towards(plane_fits(index, at, k), at, viewpoint)
        creased = np.flatnonzero(kind[verdict.rows] & EdgeKind.CREASE)
        rows = verdict.rows[creased]
        sides = faces(verdict.evidence.take(creased), checked.xyz[rows], viewpoint).spread(
            edge, rows, at, planes.normals
        )
    return Edges(
        index=checked.rows[edge],
        kind=kind[edge],
        strength=found.strength[edge],
        position=sides.position,
        direction=sides.direction,
        normals=sides.normals,
        angle=sides.angle,
        convex=sides.convex,
        num_points=checked.num_input,
        num_dropped=checked.num_dropped,
        preset=preset,
        method=viewing.method,
        reason=viewing.reason,
        parameters={"min_strength": min_strength, "num_neighbors": k},
        seconds=stages.seconds,
    )


def strength(probability: np.ndarray) -> np.ndarray:
    """Turn the probabilities of one kind into strengths, so that one half is the best place to draw the line.

    The expected F1 is greatest at half of it (Lipton et al. 2014, doi:10.1007/978-3-662-44851-9_15): near one half
    where edges are plain, lower where noise leaves none of them sure. Odds keep their ratio.
    """
    falling = np.sort(probability)[::-1]
    expected = np.cumsum(falling) / (np.arange(1, len(falling) + 1) + falling.sum())
    even = min(max(float(expected.max(initial=0.0)), EVEN[0]), EVEN[1])
    return probability * (1 - even) / (probability * (1 - even) + even * (1 - probability))


def color_strength(contrast: np.ndarray) -> np.ndarray:
    """Turn contrasts into strengths, a sure edge's threshold to one half; its fainter parts have that too."""
    return np.where(contrast > 0, np.maximum(contrast / (contrast + COLOR), LIKELY), 0)


class Marks:
    """The edge points found so far: kinds (N,) uint8 and strength (N,) of the most marked kind.

    A kind less likely than not (strength below one half) counts only where no other is more likely. So the kinds of a
    point do not depend on how faint the edges are that were asked for.
    """

    def __init__(self, count: int) -> None:
        self.kind = np.zeros(count, np.uint8)
        self.strength = np.zeros(count)

    def mark(self, rows: np.ndarray, kind: EdgeKind | np.ndarray, strength: np.ndarray) -> None:
        """Add a kind (one, or (M,) flags) at rows (M,), with its strength (M,)."""
        before, flags = self.strength[rows], np.where(strength > 0, kind, 0).astype(np.uint8)
        both = (before >= LIKELY) & (strength >= LIKELY)
        self.kind[rows] = np.where(both, self.kind[rows] | flags, np.where(strength > before, flags, self.kind[rows]))
        self.strength[rows] = np.maximum(before, strength)

    def of(self, kinds: EdgeKind, least: float) -> np.ndarray:
        """Return the kinds (N,) uint8 among those wanted, of the points that have the least strength or more."""
        return np.where(self.strength >= least, self.kind & np.uint8(kinds), np.uint8(0))
