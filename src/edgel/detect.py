"""The whole method on one screen: what `edgel.detect` does with a cloud."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Literal

import numpy as np

from edgel import paper
from edgel.cloud import as_cloud, as_vector, check_points
from edgel.color import color_channels, color_edges
from edgel.edges import EdgeKind, Edges, as_kinds
from edgel.evidence import crease_probability, examine, outline_probability, screen, survey
from edgel.evidence.faces import faces
from edgel.kdtree import build_index
from edgel.normals import check_num_neighbors, plane_fits, towards
from edgel.outline import outline_kinds
from edgel.stages import Stages
from edgel.viewing import METHODS, look

PRESETS = ("default", "paper")
DEFAULT_KINDS = EdgeKind.BOUNDARY | EdgeKind.OCCLUDING | EdgeKind.OCCLUDED | EdgeKind.CREASE
CREASE = 0.45  # least probability of a crease
OUTLINE = 0.5  # least probability that the surface ends


def detect(
    points: Any,
    *,
    preset: Literal["default", "paper"] = "default",
    kinds: EdgeKind | str | Iterable[str] = DEFAULT_KINDS,
    method: Literal["auto", "surface", "organized", "orthographic", "pinhole", "spherical"] = "auto",
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
        if viewpoint is not None:
            raise ValueError("viewpoint: the paper turns normals by D > 0; leave it out, or use the default preset")
        return paper.detect(points, num_neighbors=num_neighbors, progress=progress)
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
        rows = screen(index, surveyed)
    with stages("view"):
        viewing = look(cloud, checked.xyz, checked.rows, method, viewpoint)
    with stages("evidence"):
        evidence = examine(index, surveyed, checked.xyz[rows])
    with stages("decision"):
        sure = crease_probability(evidence)
        found.mark(rows, EdgeKind.CREASE, np.where(sure >= CREASE, sure, 0))
        if viewing.raster is None:
            ends = outline_probability(evidence)
            found.mark(rows, EdgeKind.BOUNDARY, np.where(ends >= OUTLINE, ends, 0))
        else:
            outline = outline_kinds(viewing.raster, checked.xyz)
            found.mark(np.arange(len(checked.xyz)), outline.kind, outline.strength)
    if EdgeKind.COLOR in kinds and channels is not None:
        with stages("color"):
            contrast = color_edges(
                index, checked.xyz, surveyed.normals_in_order(index), channels[checked.rows]
            ).strength
            found.mark(np.arange(len(checked.xyz)), EdgeKind.COLOR, contrast)
    with stages("faces"):
        edge = np.flatnonzero(found.kind & int(kinds))
        at = checked.xyz[edge]
        planes = towards(plane_fits(index, at, k), at, viewpoint)
        crease = np.flatnonzero(sure >= CREASE)
        sides = faces(evidence.take(crease), checked.xyz[rows[crease]], viewpoint).spread(
            edge, rows[crease], at, planes.normals
        )
    return Edges(
        index=checked.rows[edge],
        kind=found.kind[edge] & np.uint8(kinds),
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
        parameters={"num_neighbors": k},
        seconds=stages.seconds,
    )


class Marks:
    """The edge points found so far: kinds (N,) uint8 and strength (N,) of the most marked kind."""

    def __init__(self, count: int) -> None:
        self.kind = np.zeros(count, np.uint8)
        self.strength = np.zeros(count)

    def mark(self, rows: np.ndarray, kind: EdgeKind | np.ndarray, strength: np.ndarray) -> None:
        """Add a kind (one, or (M,) flags) at rows (M,) whose strength (M,) is above 0."""
        self.kind[rows] |= np.where(strength > 0, kind, 0).astype(np.uint8)
        self.strength[rows] = np.maximum(self.strength[rows], strength)
