"""The edges of a tile: strengths, kinds and places, once everything global is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._faces import Faces
from edgel._labels import Labels
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._range_image import pixel_size, raster, sides_in
from edgel._surface import Classification
from edgel._surface.curved_faces import COUNTS
from edgel._surface.evidence import Evidence
from edgel._surface.features import NUM_EVIDENCE
from edgel._surface.line import SURE as PLAIN
from edgel._surface.line import Faint, strength_of, with_faint
from edgel._surface.rims import COUNTS as RIM_COUNTS
from edgel._surface.surface import SURE, locate
from edgel.edges import EdgeKind
from edgel.tiled.box import Box
from edgel.tiled.chains import KINDS, Known, Line
from edgel.tiled.classify import HALO, SHOWN, Window, open_window, picture_of
from edgel.tiled.measure import Whole
from edgel.tiled.plan import Plan


def label_tile(plan: Plan, whole: Whole, line: Line, tile: int) -> None:
    """Find the edges in the core of a tile."""
    plan.keep("label", tile, lambda: _label(plan, whole, line, tile))


def _label(plan: Plan, whole: Whole, line: Line, tile: int) -> dict[str, np.ndarray]:
    spacing, core, read = whole.statistics.spacing, plan.tiles[tile], 0
    halo = HALO * spacing / 4
    while True:
        window = open_window(plan, core, halo, whole.statistics.cell)
        if window is None:
            faces = Faces.of_points(np.zeros((0, 3)), np.zeros((0, 3)))
            return _result(np.zeros(0, np.int64), np.zeros(0, np.uint8), np.zeros(0), faces, read)
        read += len(window.keys)
        own = Known(*_own(plan, window, tile))
        kind, strength = _kinds(plan, whole, line, tile, window, own)
        edge = np.flatnonzero(kind > 0)
        k = min(plan.options.num_neighbors, len(window.keys))
        if window.endless or _is_deep(window, edge, max(COUNTS[-1], k)):
            break
        halo *= 2
    index, viewpoint = window.index, _viewpoint(plan)
    rows = np.flatnonzero(np.isin(own.points, edge))
    crease, outline = (own.columns[name][rows] for name in KINDS)
    classified = Classification(own.points[rows], crease, outline, _evidence(own, rows))
    outermost = _outermost(plan, core, index.at(index.places_of(edge)), halo)
    faces = locate(index, index, None, classified, outermost, edge, kind[edge], k, viewpoint)
    if viewpoint is None:  # then nobody knows the outside
        faces = replace(faces, convex=np.zeros_like(faces.convex))
    return _result(window.keys[edge], kind[edge], strength[edge], faces, read)


def _result(key: np.ndarray, kind: np.ndarray, strength: np.ndarray, faces: Faces, read: int) -> dict[str, np.ndarray]:
    return {"key": key, "kind": kind, "strength": strength, "read": np.array(read), **vars(faces)}


def _own(plan: Plan, window: Window, tile: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """What the tile itself keeps of its points."""
    with plan.load("classify", tile) as found:
        points = np.searchsorted(window.keys, found["key"])
        columns = {name: found[name] for name in (*KINDS, "fit", "placed", "shown")}
    return points, np.full(len(points), tile), np.arange(len(points)), columns


def _evidence(known: Known, rows: np.ndarray) -> Evidence:
    """The evidence of some points, as far as it is kept."""
    features = np.full((len(rows), NUM_EVIDENCE), np.nan, np.float32)
    features[:, SHOWN] = known.columns["shown"][rows]
    return Evidence(features, known.columns["fit"][rows], known.columns["placed"][rows])


def _kinds(
    plan: Plan, whole: Whole, line: Line, tile: int, window: Window, own: Known
) -> tuple[np.ndarray, np.ndarray]:
    """Return kind and strength of all points of a window; those that other tiles own have none."""
    labels, options = Labels(len(window.keys)), plan.options
    crease, outline = (
        _strengths(plan, tile, kind, own.columns[kind], even) for kind, even in zip(KINDS, line.even, strict=True)
    )
    labels.add(own.points, EdgeKind.CREASE, crease)
    kind = EdgeKind.BOUNDARY
    if line.sides:
        xyz = window.index.by_point()
        kind = sides_in(raster(picture_of(xyz), -xyz[:, 2], pixel_size(whole.statistics.spacing)), own.points)
    labels.add(own.points, kind, outline)
    return labels.of(EdgeKind(options.kinds), options.min_strength), labels.strength


def _strengths(plan: Plan, tile: int, kind: str, probability: np.ndarray, even: float) -> np.ndarray:
    if even >= PLAIN:
        return strength_of(probability, even)
    with plan.load("link", tile) as found, plan.load(f"chained {kind}", tile) as chained:
        rows, none = found[f"{kind}_row"], np.zeros((0, 0), np.int64)
        return with_faint(probability, even, Faint(rows, none, none, found[f"{kind}_likeliest"]), chained["kept"])


def _viewpoint(plan: Plan) -> np.ndarray | None:
    return None if plan.options.viewpoint is None else np.array(plan.options.viewpoint)


def _is_deep(window: Window, edge: np.ndarray, count: int) -> bool:
    """Whether so many nearest of each edge point lie nearer than the side of the window."""
    if len(window.keys) < count:
        return False
    index, depth = window.index, np.empty(len(window.keys))
    depth[index.order] = window.depth
    xyz, deep = index.at(index.places_of(edge)), True
    for start in range(0, len(edge), 65_536):
        rows = slice(start, start + 65_536)
        deep &= bool((knn(index, xyz[rows], count).distances[:, -1] < depth[edge[rows]]).all())
    return deep


def _outermost(plan: Plan, core: Box, xyz: np.ndarray, halo: float) -> np.ndarray:
    """Return the points (K, 3) that surely are where the surface ends, as far around as edge points (E, 3) ask for."""
    while True:
        box = core.grown(halo, halo).without_end(*plan.bounds)
        found = [np.zeros((0, 3))]
        for tile in plan.around(box):
            with plan.load("classify", tile) as kept:
                found.append(kept["xyz"][kept["outline"] > SURE])
        outermost = np.concatenate(found)
        if box.endless or not len(xyz):
            return outermost
        outermost = outermost[box.holds(outermost)]
        if len(outermost) >= RIM_COUNTS[-1]:
            away = knn(build_index(outermost), xyz, RIM_COUNTS[-1]).distances[:, -1]
            if (away < box.depth(xyz)).all():
                return outermost
        halo *= 2
