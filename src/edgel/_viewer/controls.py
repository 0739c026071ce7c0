"""What can be pressed: the handles of the side panel, and the settings that they stand for."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser

from edgel._viewer import texts
from edgel._viewer.runs import LEAST_STRENGTH, METHODS, Method
from edgel._viewer.session import Pane
from edgel._viewer.settings import MAX_SCALE, Coloring, Settings
from edgel._viewer.source import Source
from edgel.edges import ASKABLE, EdgeKind, kind_names
from edgel.io import WRITERS

_EDGE_COLORS = ("kind", "strength")
_SHOWN_METHODS: dict[str, tuple[Method, ...]] = {"edgel": ("edgel",), "paper": ("paper",), "side by side": METHODS}


class Controls:
    """Handles of the side panel.

    Parameters
    ----------
    server : viser.ViserServer
    changed : callable
        Called, from any thread, when one of those that make up the settings was moved.
    """

    def __init__(self, server: viser.ViserServer, changed: Callable[[], None]) -> None:
        gui, start = server.gui, Settings()
        self._gui = gui
        gui.add_html(texts.HELP)
        self.status = gui.add_html("")
        with gui.add_folder("Edges"):
            self.legend = gui.add_html("")
            self.method = gui.add_dropdown(
                "Method", tuple(_SHOWN_METHODS), hint="edgel's own detector, the published method, or both side by side"
            )
            self.strength = gui.add_slider(
                "Strength ≥", LEAST_STRENGTH, 1.0, 0.01, start.strength, hint="Hide edges weaker than this"
            )
            self.angle = gui.add_slider(
                "Angle ≥ (°)", 0, 90, 1, 0, hint="Hide creases whose faces turn less than this, in degrees"
            )
            self.scale = gui.add_slider(
                "Scale", 1.0, MAX_SCALE, 0.5, start.scale, hint="Find only what is larger than this many point spacings"
            )
        with gui.add_folder("Show kinds"):
            self.kinds = {kind: gui.add_checkbox(kind_names(kind)[0], kind in start.kinds) for kind in ASKABLE}
        with gui.add_folder("Look"):
            self.coloring: Any = gui.add_dropdown("Color cloud by", (Coloring.GREY.value,))
            self.edge_colors = gui.add_dropdown("Color edges by", _EDGE_COLORS)
            self.tangents = gui.add_checkbox("Tangents", False, hint="Green segments along the edge")
            self.normals = gui.add_checkbox("Normals", False, hint="Segments: grey one face's, ochre the other's")
            self.curves = gui.add_checkbox(
                "Curves", False, hint="Lines, arcs and circles along the edges; click an edge point for their measures"
            )
            self.every_point = gui.add_checkbox(
                "Every point", False, hint="Draw all points of the cloud, which without a graphics card takes its time"
            )
            self.size = gui.add_slider("Point size", 0.5, 4.0, 0.1, 1.0)
            self.look = gui.add_button("Show everything", hint="Put the camera back to where it began")
        with gui.add_folder("Crop", expand_by_default=False):
            self.crop = [
                (gui.add_slider(f"{axis} from (%)", 0, 99, 1, 0), gui.add_slider(f"{axis} to (%)", 1, 100, 1, 100))
                for axis in "xyz"
            ]
            self.whole = gui.add_button("Whole cloud")
        self.images = gui.add_folder("The paper's images", visible=False)
        with self.images:
            self.pictures = gui.add_html("")
        with gui.add_folder("Clicked point"):
            self.numbers = gui.add_html(texts.numbers(None))
        with gui.add_folder("Save and repeat"):
            self.which: Any = gui.add_dropdown("Of", ("",), visible=False)
            self.format = gui.add_dropdown("Format", tuple(WRITERS))
            self.save_edges = gui.add_button("Save edges", hint="Download the edge points shown")
            self.save_picture = gui.add_button("Save picture", hint="Download a picture of this view")
            self.code = gui.add_html("")
        for handle in self._settings_handles():
            handle.on_update(lambda _: changed())
        self.which.on_update(lambda _: changed())
        self.whole.on_click(lambda _: self._uncrop(changed))

    def settings(self) -> Settings:
        """Return the settings as the handles stand now."""
        kinds = EdgeKind(0)
        for kind, box in self.kinds.items():
            kinds |= kind if box.value else EdgeKind(0)
        return Settings(
            methods=_SHOWN_METHODS[self.method.value],
            scale=max(float(self.scale.value), 1.0),
            strength=float(self.strength.value),
            angle=math.radians(self.angle.value),
            kinds=kinds,
            crop=tuple(_share(low.value, high.value) for low, high in self.crop),
            coloring=Coloring(self.coloring.value),
            by_strength=self.edge_colors.value == "strength",
            tangents=self.tangents.value,
            normals=self.normals.value,
            curves=self.curves.value,
            every_point=self.every_point.value,
            size=self.size.value,
        )

    def offer(self, sources: Sequence[Source], colorings: list[Coloring]) -> None:
        """Offer only what the files carry: colorings, and more points than are drawn at first."""
        names = tuple(coloring.value for coloring in Coloring if coloring in colorings)
        if self.coloring.options != names:
            self.coloring.options = names
        self.every_point.visible = any(len(source.few) < len(source.shown) for source in sources)

    def fit(self, panes: Sequence[Pane], settings: Settings) -> None:
        """Grey out what the method shown does not heed, and kinds of edge that none of the clouds can have."""
        heeded = "edgel" in settings.methods
        self.strength.disabled = self.angle.disabled = not heeded
        possible = _possible_kinds(panes)
        for kind, box in self.kinds.items():
            box.disabled = not (heeded and kind in possible)
        self.images.visible = "paper" in settings.methods

    def choose_pane(self, panes: list[Pane]) -> Pane | None:
        """Return the pane that saving is about, and offer the choice where there are several."""
        names = tuple(pane.name for pane in panes)
        if names and self.which.options != names:
            self.which.options = names
        self.which.visible = len(names) > 1
        return next((pane for pane in panes if pane.name == self.which.value), panes[0] if panes else None)

    def _settings_handles(self) -> list[Any]:
        return [
            *(self.method, self.strength, self.angle, self.scale, self.coloring, self.edge_colors),
            *(self.tangents, self.normals, self.curves, self.every_point, self.size),
            *self.kinds.values(),
            *(slider for pair in self.crop for slider in pair),
        ]

    def _uncrop(self, changed: Callable[[], None]) -> None:
        for low, high in self.crop:
            low.value, high.value = 0, 100
        changed()


def _share(low: float, high: float) -> tuple[float, float]:
    """Return the part of an axis between two percentages, in either order, one percent at least."""
    low, high = sorted((low, high))
    return low / 100, max(high, low + 1) / 100


def _possible_kinds(panes: Sequence[Pane]) -> EdgeKind:
    """Return the kinds that edgel's detector can find in some of the clouds, as far as that is known.

    Without a view, near and far sides are told apart on few clouds; the frame is that of an organized cloud's rows and
    columns.
    """
    sides, kinds = EdgeKind.OCCLUDING | EdgeKind.OCCLUDED, EdgeKind.BOUNDARY | EdgeKind.CREASE
    for pane in panes:
        found = None if pane.answer is None else pane.answer.edges
        if pane.method == "paper":
            continue
        if pane.source.has_color:
            kinds |= EdgeKind.COLOR
        if found is None or found.method != "surface" or np.any(found.kind & sides):
            kinds |= sides
        if found is None or found.method == "organized":
            kinds |= EdgeKind.FRAME
    return kinds
