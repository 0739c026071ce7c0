"""The whole method on one screen: what `edgel.detect` does with a cloud."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Literal

import numpy as np

from edgel._color import color_channels, color_edges
from edgel._kinds import LIKELY
from edgel._labels import label_edges, strength_of_contrast
from edgel._neighbors.normals import check_num_neighbors
from edgel._neighbors.orientation import check_orient, who_knows
from edgel._range_image import METHODS, choose_view, see_edges, without_no_return
from edgel._scale import at_scale, check_max_scale, check_scale, over_scales
from edgel._sides import orient_faces, viewer_of
from edgel._stages import Stages
from edgel._surface import Surface
from edgel.cloud import Cloud, Points, as_cloud, as_vector, check_points
from edgel.edges import EdgeKind, Edges, as_kinds

DEFAULT_KINDS = EdgeKind.BOUNDARY | EdgeKind.OCCLUDING | EdgeKind.OCCLUDED | EdgeKind.CREASE


def detect(
    points: Any,
    *,
    kinds: EdgeKind | str | Iterable[str] = DEFAULT_KINDS,
    method: Literal["auto", "surface", "organized", "orthographic", "pinhole", "spherical"] = "auto",
    min_strength: float = LIKELY,
    scale: float = 1.0,
    max_scale: float | None = None,
    num_neighbors: int = 16,
    viewpoint: Any = None,
    orient: Literal["auto", "outward"] = "auto",
    progress: Callable[[str], None] | None = None,
) -> Edges:
    """Find the edge points of a cloud, their kind, and the surface on either side.

    Parameters
    ----------
    points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points
        Points with a NaN or infinite coordinate are left out and counted.
    kinds : EdgeKind, or str, or iterable of str
        The kinds of edge wanted, as flags or as names ("boundary", "occluding", "occluded", "crease", "color",
        "frame"); all but the last two unless told; without creases a view takes less time. A point of several kinds
        keeps the flags of those wanted.
    method : {"auto", "surface", "organized", "orthographic", "pinhole", "spherical"}
        The way to look at the cloud: on the surface itself, from any side; along the rows and columns of an organized
        cloud; or in a projection of that kind. "auto" chooses, and `Edges.method` and `Edges.reason` say what and why.
        The published method is `edgel.paper.detect`.
    min_strength : float
        Least `Edges.strength` of the points returned, in (0, 1]; one half, on any cloud, is where an edge is as likely
        as not. Lower finds fainter edges and more that are none.
    scale : float
        Size of the smallest edges wanted, in median spacings, 1 or more: above 1 the cloud is thinned to one point a
        voxel of that size first, and what is smaller cannot be seen.
    max_scale : float, optional
        Largest scale at which softer edges are looked for too, in median spacings: what is rounded over several
        spacings, as by a fillet or by wear, is sharp where the cloud is thinned to twice the scale, four times, and so
        on. `Edges.of_scale` tells them apart again. Default: `scale`, so that no other is looked at.
    num_neighbors : int
        k of the plane fits that give the normals, the point itself among them; at least 3.
    viewpoint : (3,) array_like, optional
        Where the sensor stood. Default: what the cloud knows of it.
    orient : {"auto", "outward"}
        Which side of the surface is outside: that of the sensor, where its place or a view of the cloud is known, else
        that of the cloud's own normals (nx, ny, nz), else it is not known: `Edges.convex` is 0, and normals are turned
        upwards (+Z) for want of better. "outward" tells it from the whole surface instead: normals are carried from
        neighbour to neighbour, and the outermost points look outwards; for closed surfaces, scanned all round.
        `Edges.orientation` says which it was.
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
        is; if an option is out of its range, or a viewpoint is given beside ``orient="outward"``.

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
    kinds = as_kinds(kinds)
    _check_options(method, min_strength, scale)
    check_orient(orient, has_viewpoint=viewpoint is not None)
    options = {"kinds": kinds, "method": method, "min_strength": min_strength, "num_neighbors": num_neighbors}
    max_scale = check_max_scale(max_scale, scale)
    if max_scale > scale:
        return over_scales(
            detect, points, scale, max_scale, progress=progress, viewpoint=viewpoint, orient=orient, **options
        )
    if scale > 1:
        return at_scale(detect, points, scale, progress=progress, viewpoint=viewpoint, orient=orient, **options)
    cloud, stages = as_cloud(points), Stages(progress)
    viewpoint = cloud.viewpoint if viewpoint is None else as_vector(viewpoint, "viewpoint")
    checked = check_points(cloud)
    finite, missing = without_no_return(cloud, checked, viewpoint)
    xyz, k = finite.xyz, check_num_neighbors(num_neighbors, len(finite.xyz))
    colors = _channels(cloud, finite) if EdgeKind.COLOR in kinds else None

    with stages("view"):
        view = choose_view(cloud, finite, method, viewpoint)
    with stages("edges in the view"):
        seen = None if view.image is None else see_edges(view.image, xyz, kinds)
    surface = Surface(xyz, stages)
    found = surface.strengths if seen is None or seen.is_fine(kinds) else None
    with stages("labels"):
        labels = label_edges(xyz, found, seen, None if viewpoint is not None else surface)
    if colors is not None:
        normals = surface.normals
        with stages("color"):
            contrast = color_edges(surface.index, xyz, normals, colors).strength
            labels.add(np.arange(len(xyz)), EdgeKind.COLOR, strength_of_contrast(contrast))
    with stages("localisation"):
        kind = labels.of(kinds, min_strength)
        edge = np.flatnonzero(kind > 0)
        viewer = viewer_of(view, viewpoint, xyz)
        if seen is None:
            faces = surface.faces(edge, kind[edge], k, viewer)
        else:
            fitted = None if found is None else surface.faces(edge, kind[edge], k, viewer)
            faces = seen.faces(edge, xyz, viewer, fitted)
    with stages("orientation"):
        orientation, own = who_knows(orient, cloud, sensor=viewpoint is not None or seen is not None)
        own = None if own is None else own[finite.rows]
        faces = orient_faces(faces, orientation, edge, labels.strength[edge] >= LIKELY, surface, own)
    return Edges(
        index=finite.rows[edge],
        kind=kind[edge],
        strength=labels.strength[edge],
        **vars(faces),
        num_points=checked.num_input,
        num_dropped=checked.num_dropped,
        method=view.method,
        reason=view.reason + missing,
        orientation=orientation,
        parameters={"min_strength": min_strength, "num_neighbors": k},
        seconds=stages.seconds,
    )


def _check_options(method: str, min_strength: float, scale: float) -> None:
    if method not in METHODS:
        raise ValueError(
            f"method: expected one of {', '.join(METHODS)}, got {method!r}"
            + ("; the published method is edgel.paper.detect" if method == "paper" else "")
        )
    if not 0 < min_strength <= 1:
        raise ValueError(f"min_strength: expected a number above 0 and at most 1, got {min_strength}")
    check_scale(scale)


def _channels(cloud: Cloud, finite: Points) -> np.ndarray:
    """Return the colors of the finite points of a cloud, (N, C)."""
    channels = color_channels(cloud)
    if channels is None:
        raise ValueError("kinds: color edges need red, green and blue or an intensity, and the cloud carries neither")
    return channels[finite.rows]
