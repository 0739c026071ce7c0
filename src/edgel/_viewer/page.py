"""The page: keeps controls, texts and scene in step with the session."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import viser

from edgel._viewer import texts
from edgel._viewer.canvas import Canvas
from edgel._viewer.colors import colorings
from edgel._viewer.commands import command_line, python_lines
from edgel._viewer.controls import Controls
from edgel._viewer.latest import Latest
from edgel._viewer.pick import (
    Row,
    curve_places,
    describe,
    describe_curve,
    describe_distance,
    find,
    pick,
    row_of,
    summary,
)
from edgel._viewer.save import edges_file, picture_file, png
from edgel._viewer.session import Pane, Session
from edgel.io.errors import describe_error, printable
from edgel.paper import PaperEdges

_HEAD_START = 0.005  # seconds in which the texts leave before the scene
_CURVE_STEP = 0.005  # scene units between the places of a curve that can be clicked
_CLICK = 8  # pixels that a click may miss an edge point by


class Page:
    """One page for all tabs: what one changes, the others show.

    Callbacks of viser come from many threads, in any order. They only take over the settings; drawing is the work of
    one thread, which shows what is wanted when it begins.
    """

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        self._server, self._session = server, session
        self._lock = threading.Lock()
        self._images: dict[str, PaperEdges] = {}
        self._panes: list[Pane] = []
        self._picked: list[Row] = []  # the last two, the newest at the end
        server.gui.configure_theme(show_share_button=False, show_logo=False, control_width="large")
        server.gui.set_panel_label("edgel view")
        server.gui.main_panel.dock_right()
        self._canvas = Canvas(server)
        self._controls = Controls(server, self._take_over)
        self._painter = Latest(self._paint, "edgel view painter")
        self._controls.look.on_click(lambda event: self._canvas.look(event.client))
        self._controls.save_edges.on_click(self._save_edges)
        self._controls.save_picture.on_click(self._save_picture)
        server.scene.on_click()(self._click)
        server.on_client_connect(self._canvas.greet)
        session.start(self.refresh)

    def refresh(self) -> None:
        """Draw anew, soon."""
        self._painter.wake()

    def wait_idle(self, timeout: float | None = None) -> bool:
        """Wait until all is drawn, at most `timeout` seconds, and say whether it is."""
        return self._painter.wait_idle(timeout)

    def close(self) -> None:
        """Draw no more, and let a drawing under way come to its end, so that viser may stop."""
        self._painter.close()
        self._painter.wait_idle(2.0)

    def _take_over(self) -> None:
        with self._lock:  # read and assigned at once, or an older reading could come last
            self._session.settings = self._controls.settings()
        self._painter.wake()

    def _paint(self) -> None:
        session, controls = self._session, self._controls
        settings = session.settings
        panes = session.panes(settings)
        if panes:
            sources = [pane.source for pane in panes]
            controls.offer(sources, [coloring for source in sources for coloring in colorings(source)])
        controls.fit(panes, settings)
        pane = controls.choose_pane(panes)
        controls.status.content = texts.status(session, panes, settings)
        controls.legend.content = texts.legend(panes, settings)
        # The browser shows texts at once; those in one message with the scene would wait for a frame to be drawn.
        self._server.flush()
        time.sleep(_HEAD_START)
        self._canvas.draw(panes, settings)
        self._server.flush()
        changed = [pane.edges for pane in panes] != [pane.edges for pane in self._panes]  # Edges equal only themselves
        self._panes = panes
        if changed and self._picked:
            self._mark()
        self._show_images(panes)
        lines = (
            {}
            if pane is None
            else {
                "Copy command line": command_line(pane, settings),
                "Copy Python": python_lines(pane, settings),
            }
        )
        controls.code.content = texts.code(lines)

    def _show_images(self, panes: list[Pane]) -> None:
        """Show the projection and the edge map of each pane of the published method."""
        found = {pane.source.name: pane.answer.edges for pane in panes if pane.answer is not None}
        wanted = {name: edges for name, edges in found.items() if isinstance(edges, PaperEdges)}
        if wanted == self._images:  # Edges are equal if they are the same
            return
        self._images = wanted
        pictures = {}
        for name, edges in wanted.items():
            for what, image in (("projection", edges.image), ("edge map", edges.edge_map * 255)):
                pictures[f"{name}: {what}"] = png(image[::-1].astype(np.uint8))
        self._controls.pictures.content = texts.pictures(pictures)

    def _click(self, event: viser.SceneClickEvent) -> None:
        """Show the numbers of the edge point that was clicked."""
        camera = event.client.camera
        reach = _CLICK * 2 * np.tan(camera.fov / 2) / max(camera.image_height, 1)
        shown = self._canvas.shown
        sizes = [self._canvas.edge_size(number) for number in range(len(shown))]
        ray = np.array(event.ray_origin), np.array(event.ray_direction)
        picked = pick(shown, *ray, max_angle=float(reach), radius=max(sizes, default=0.0))
        self._picked = [] if picked is None else [*self._picked[-1:], row_of(self._panes, picked)]
        self._mark()
        if picked is None:
            self._pick_curve(ray, float(reach))

    def _pick_curve(self, ray: tuple[np.ndarray, np.ndarray], reach: float) -> None:
        """Show the measures of a curve that was clicked where it has no edge point."""
        layout, panes = self._canvas.layout, self._panes
        if layout is None:
            return
        none = np.empty((0, 3)), np.empty(0, np.int64)
        found = [
            none if pane.curves is None else curve_places(pane.curves, _CURVE_STEP / placement.unit)
            for pane, placement in zip(panes, layout.placements, strict=True)
        ]
        scene = [at.to_scene(places) for (places, _), at in zip(found, layout.placements, strict=True)]
        picked = pick(scene, *ray, max_angle=reach)
        if picked is not None:
            curves = panes[picked.pane].curves
            assert curves is not None
            self._controls.numbers.content = texts.numbers(
                describe_curve(curves, int(found[picked.pane][1][picked.edge]))
            )

    def _mark(self) -> None:
        """Mark the edge points clicked, if the last is shown, with its numbers and its distance from the other."""
        found = [find(self._panes, row) for row in self._picked]
        picked = [one for one in found if one is not None]
        if not found or found[-1] is None:
            self._picked = []
            self._canvas.mark([])
            self._controls.numbers.content = texts.numbers(None)
            return
        first, last = picked[0], picked[-1]
        pane = self._panes[last.pane]
        way = {}
        if first != last and self._panes[first.pane].source is pane.source:
            way = describe_distance(self._panes[first.pane], first.edge, pane, last.edge)
        self._canvas.mark(picked if way else [last], summary(pane, last.edge), way.get("distance", ""))
        self._controls.numbers.content = texts.numbers(way | describe(pane, last.edge))

    def _save_edges(self, event: viser.GuiEvent[Any]) -> None:
        pane = self._saved_pane(event)
        if pane is not None:
            self._send(event, lambda: edges_file(pane, self._controls.format.value))

    def _save_picture(self, event: viser.GuiEvent[Any]) -> None:
        pane, client = self._saved_pane(event), event.client
        if pane is None or client is None:
            return
        layout, panes = self._canvas.layout, self._panes
        names = [shown.name for shown in panes]
        if layout is not None and pane.name in names:
            away = client.camera.look_at - client.camera.position
            direction = layout.placements[names.index(pane.name)].to_cloud(away)
            self._send(event, lambda: picture_file(pane, direction, self._session.settings))

    def _saved_pane(self, event: viser.GuiEvent[Any]) -> Pane | None:
        """Return the pane chosen, with the edges that the settings ask for now; say so where there are none yet."""
        pane = self._controls.choose_pane(self._session.panes())
        if pane is not None and pane.is_current and pane.edges is not None:
            return pane
        if event.client is not None:
            event.client.add_notification(
                "Nothing to save yet", "There are no edges, or they are still being found.", color="yellow"
            )
        return None

    def _send(self, event: viser.GuiEvent[Any], make: Any) -> None:
        """Send a file to the tab that asked, or the reason why there is none."""
        if event.client is None:
            return
        try:
            name, content = make()
        except (ValueError, TypeError, ImportError, OSError, MemoryError) as error:
            event.client.add_notification("Could not be saved", describe_error(error), color="red")
            return
        event.client.send_file_download(printable(name), content, save_immediately=True)
