"""The scene of the page: clouds, edge points, segments, drawn from the panes of a session."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from edgel._kinds import LIKELY
from edgel._neighbors.thinning import thin
from edgel._viewer.colors import cloud_colors, edge_colors
from edgel._viewer.layout import FIELD_OF_VIEW, Layout, Placement, lay_out
from edgel._viewer.pick import Picked
from edgel._viewer.runs import LEAST_STRENGTH
from edgel._viewer.session import Pane
from edgel._viewer.settings import Settings
from edgel._viewer.source import Drawn
from edgel.curves import CurveKind, Curves
from edgel.edges import Edges

_POINT = 1.5  # side of a point of the cloud, a square, in spacings: no holes, and little drawn twice
_EDGE = 1.0  # side of an edge point, in those of the cloud
_RISE = 0.35  # sides of a point by which edge points stand out of the surface, whose points would hide them
_LOW_RISE = 0.2  # the same for unlikely ones, so that they hide no likely ones
_LEAST_EDGE = 0.01  # scene units: three pixels on a usual screen
_SPARSE = 0.01  # scene units: points that lie far from each other for the most part are seen at that size
_NOTHING = np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8)
_NORMAL, _TANGENT = 0.06, 0.05  # lengths of segments, scene units
_LIFT = 0.012  # scene units from the surface to the tangents, which the edge points would hide
_CELL = 0.03  # at most one segment a cell of this size, scene units
_TANGENT_COLOR, _NORMAL_COLORS = (0, 150, 50), ((40, 40, 40), (190, 120, 20))
_CURVE_COLORS = {
    CurveKind.LINE: (31, 78, 158),
    CurveKind.ARC: (26, 138, 74),
    CurveKind.CIRCLE: (176, 42, 143),
    CurveKind.POLYLINE: (208, 64, 42),
}
_STILL = 0.01  # scene units: a camera that was not moved by more was not moved by the user
_ABOVE = 0.12  # scene units from a cloud to its name
_MARK_COLOR = (255, 220, 0)
_DISTANCE_COLOR = (0, 0, 0)


class Canvas:
    """Handles of what is drawn. Only one thread may call `draw` at a time."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._nodes: dict[str, Any] = {}
        self._drawn: dict[str, Any] = {}
        self._laid_out: list[int] = []
        self._stands: dict[int, np.ndarray] = {}  # where each tab was last made to look from
        self.layout: Layout | None = None
        self.shown: list[np.ndarray] = []
        server.initial_camera.fov = FIELD_OF_VIEW

    def draw(self, panes: list[Pane], settings: Settings) -> None:
        """Make the scene show these panes."""
        if not panes:
            return
        sources = [id(pane.source) for pane in panes]
        if sources != self._laid_out:
            self._clear()
            self.layout, self._laid_out = lay_out([pane.source for pane in panes]), sources
            self.look()
        assert self.layout is not None
        shown = []
        with self._server.atomic():
            for number, (pane, placement) in enumerate(zip(panes, self.layout.placements, strict=True)):
                self._draw_cloud(number, pane, placement, settings)
                shown.append(self._draw_edges(number, pane, placement, settings))
                self._draw_curves(number, pane.curves, placement)
                if len(panes) > 1:
                    self._label(f"/label{number}", pane.name, placement)
        self.shown = shown

    def look(self, client: viser.ClientHandle | None = None) -> None:
        """Look at everything, in one tab or in all."""
        if self.layout is None:
            return
        for tab in [client] if client is not None else self._server.get_clients().values():
            view = self.layout.view(tab.camera.aspect)
            tab.camera.up_direction = (0.0, 0.0, 1.0)
            tab.camera.position, tab.camera.look_at = view.position, view.target
            self._stands[tab.client_id] = view.position

    def greet(self, client: viser.ClientHandle) -> None:
        """Let a new tab look at everything, and again when it is resized, as the panel does, until it was turned."""
        self.look(client)
        seen = [client.camera.aspect]

        def resized(camera: viser.CameraHandle) -> None:
            stood = self._stands.get(client.client_id)
            if camera.aspect != seen[0] and stood is not None and np.abs(camera.position - stood).max() < _STILL:
                self.look(client)
            seen[0] = camera.aspect

        client.camera.on_update(resized)

    def mark(self, picked: Sequence[Picked], words: str = "", distance: str = "") -> None:
        """Put a ball on edge points that were clicked, words beside the last, and a line from the one before.

        Parameters
        ----------
        picked : sequence of Picked
            None, one, or two.
        words : str
            Stand beside the last.
        distance : str
            Stands beside the line between two; without it there is none.
        """
        for name in ("/picked", "/picked-before", "/words", "/distance", "/distance-words"):
            self._remove(name)
        places = [self.shown[one.pane][one.edge].astype(float) for one in picked]
        scene = self._server.scene
        for name, one, at in zip(("/picked", "/picked-before"), picked[::-1], places[::-1], strict=False):
            radius = max(0.015, self.edge_size(one.pane))
            self._nodes[name] = scene.add_icosphere(name, radius=radius, color=_MARK_COLOR, opacity=0.8, position=at)
        if words:
            self._nodes["/words"] = scene.add_label("/words", words, position=places[-1], anchor="bottom-left")
        if distance:
            self._segments("/distance", (np.array([places], np.float32), np.full((1, 2, 3), _DISTANCE_COLOR, np.uint8)))
            self._nodes["/distance-words"] = scene.add_label(
                "/distance-words", distance, position=(places[0] + places[1]) / 2, anchor="top-center"
            )

    def edge_size(self, pane: int) -> float:
        """Size of the edge points of a pane, in scene units."""
        return 2 * float(self._nodes[f"/edges{pane}"].point_size)

    def _draw_cloud(self, number: int, pane: Pane, placement: Placement, settings: Settings) -> None:
        source, name = pane.source, f"/cloud{number}"
        drawn = source.drawn(settings)
        key = (drawn, settings.coloring, settings.size, source.normals is not None)
        if self._drawn.get(name) == key:  # nearly always, and comparing millions of points would take its time
            return
        self._drawn[name] = key
        points = placement.to_scene(pane.cloud.xyz[source.shown[drawn.at]])
        colors = cloud_colors(source, drawn.at, settings.coloring, placement.rotation)
        self._points(name, points, colors, settings.size * _point_size(drawn, placement))

    def _draw_edges(self, number: int, pane: Pane, placement: Placement, settings: Settings) -> np.ndarray:
        """Draw the edge points and their segments; return where the points are."""
        edges, name = pane.edges, f"/edges{number}"
        side = _point_size(pane.source.drawn(settings), placement)
        key = (edges, side, settings.size, settings.by_strength, settings.tangents, settings.normals)
        if self._drawn.get(name) == key:
            return self.shown[number]
        self._drawn[name] = key
        points, colors, segments = np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8), {}
        if edges is not None and len(edges):
            points = placement.to_scene(pane.cloud.xyz[edges.index])
            colors = edge_colors(edges, by_strength=settings.by_strength, least=LEAST_STRENGTH)
            few = _evenly_sampled(points) if settings.tangents or settings.normals else np.empty(0, np.int64)
            if settings.tangents:
                segments["tangents"] = _tangents(edges.take(few), points[few], placement)
            if settings.normals:
                segments["normals"] = _normals(edges.take(few), points[few], placement)
        drawn = points
        if edges is not None:
            rise = np.where((edges.strength < LIKELY) & (edges.method != "paper"), _LOW_RISE, _RISE)
            lift = (rise[:, None] * side * _outwards(edges, placement)).astype(np.float32)
            drawn, colors = np.concatenate([points + lift, points - lift]), np.concatenate([colors, colors])
        self._points(name, drawn, colors, settings.size * max(_EDGE * side, _LEAST_EDGE))
        for what in ("tangents", "normals"):
            self._segments(f"/{what}{number}", segments.get(what))
        return points

    def _draw_curves(self, number: int, curves: Curves | None, placement: Placement) -> None:
        name = f"/curves{number}"
        if name in self._drawn and self._drawn[name] is curves:
            return
        self._drawn[name] = curves
        if curves is None:
            self._segments(name, None)
            return
        inner = np.ones(len(curves.vertices), bool)
        inner[curves.start[1:] - 1] = False
        first = np.flatnonzero(inner)
        places = placement.to_scene(curves.vertices)
        kinds = np.repeat(curves.kind, np.diff(curves.start))[first]
        colors = np.array([_CURVE_COLORS[CurveKind(kind)] for kind in kinds], np.uint8).reshape(-1, 1, 3)
        self._segments(name, (np.stack([places[first], places[first + 1]], axis=1), np.repeat(colors, 2, axis=1)))

    def _points(self, name: str, points: np.ndarray, colors: np.ndarray, size: float) -> None:
        node = self._nodes.get(name)
        if node is None:
            node = self._nodes[name] = self._server.scene.add_point_cloud(
                name, *_NOTHING, point_shape="square", precision="float32", point_shading="flat", visible=False
            )
        if len(points):  # what did not change is not sent again; viser draws points twice as large as it says
            node.points, node.colors, node.point_size = points, colors, size / 2
        node.visible = len(points) > 0

    def _segments(self, name: str, segments: tuple[np.ndarray, np.ndarray] | None) -> None:
        node = self._nodes.get(name)
        if segments is None or not len(segments[0]):
            self._remove(name)
        elif node is None:
            self._nodes[name] = self._server.scene.add_line_segments(
                name, *segments, thickness=2.0, thickness_units="screen"
            )
        else:
            node.points, node.colors = segments

    def _label(self, name: str, text: str, placement: Placement) -> None:
        if name not in self._nodes:
            assert self.layout is not None
            up = np.cross(self.layout.right, self.layout.away)
            above = placement.offset + (np.abs(up) @ placement.half + _ABOVE) * up
            self._nodes[name] = self._server.scene.add_label(name, text, position=above)

    def _remove(self, name: str) -> None:
        node = self._nodes.pop(name, None)
        if node is not None:
            node.remove()

    def _clear(self) -> None:
        for name in list(self._nodes):
            self._remove(name)
        self._drawn.clear()


def _point_size(drawn: Drawn, placement: Placement) -> float:
    """Side of the points of a cloud, in scene units: their spacing, more where most lie farther apart than that."""
    return float(max(_POINT * drawn.spacing * placement.unit, min(3.0 / np.sqrt(max(len(drawn.at), 1)), _SPARSE)))


def _outwards(edges: Edges, placement: Placement) -> np.ndarray:
    """Unit vectors off the surface, between the normals of both faces, in the scene (E, 3); 0 where none is known."""
    outwards = np.nan_to_num(edges.normals).sum(axis=1)
    length = np.linalg.norm(outwards, axis=1, keepdims=True)
    return outwards / np.where(length > 0, length, 1.0) @ placement.rotation.T


def _tangents(edges: Edges, points: np.ndarray, placement: Placement) -> tuple[np.ndarray, np.ndarray]:
    """Segments along the edge, (S, 2, 3), and their colors, (S, 2, 3) uint8."""
    along, normals = edges.direction @ placement.rotation.T, edges.normals[:, 0] @ placement.rotation.T
    known = np.isfinite(along[:, 0])
    middle = (points + _LIFT * np.nan_to_num(normals))[known]
    half = _TANGENT / 2 * along[known]
    ends = np.stack([middle - half, middle + half], axis=1)
    return ends, np.full((len(ends), 2, 3), _TANGENT_COLOR, np.uint8)


def _normals(edges: Edges, points: np.ndarray, placement: Placement) -> tuple[np.ndarray, np.ndarray]:
    """Segments along the normals of both faces, (S, 2, 3), and their colors, (S, 2, 3) uint8."""
    ends, colors = [], []
    for face, color in enumerate(_NORMAL_COLORS):
        normals = edges.normals[:, face] @ placement.rotation.T
        known = np.isfinite(normals[:, 0])
        start = points[known]
        ends.append(np.stack([start, start + _NORMAL * normals[known]], axis=1))
        colors.append(np.full((len(start), 2, 3), color, np.uint8))
    return np.concatenate(ends), np.concatenate(colors)


def _evenly_sampled(points: np.ndarray) -> np.ndarray:
    """Return which of the points have segments: at all of them they would be a carpet."""
    return thin(points, _CELL) if len(points) >= 3 else np.arange(len(points))
