"""The state of the viewer without a browser: files and settings in, panes with their edges out."""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import edgel
from edgel._viewer.latest import Latest
from edgel._viewer.runs import Answer, Method, Run, find_edges
from edgel._viewer.select import select
from edgel._viewer.settings import Settings
from edgel._viewer.source import Source
from edgel.cloud import Cloud
from edgel.curves import Curves, trace
from edgel.edges import Edges
from edgel.io.errors import describe_error, printable

_KEPT = 24  # answers remembered, so that moving back is immediate


@dataclass(frozen=True, eq=False)
class Pane:
    """One cloud with the edges that one method found.

    Attributes
    ----------
    name : str
        What it is called on the page.
    source : Source
        Already read.
    cloud : Cloud
        Its cloud.
    method : {"edgel", "paper"}
    run : Run or None
        The run whose edges are shown; None before the first is done.
    answer : Answer or None
        What came of it.
    edges : Edges or None
        Those of the answer that the settings show.
    box : (2, 3) float64
        The crop box, in the cloud's frame.
    is_current : bool
        Whether the edges are those asked for; not while the detector still runs.
    """

    name: str
    source: Source
    cloud: Cloud
    method: Method
    run: Run | None
    answer: Answer | None
    edges: Edges | None
    box: np.ndarray
    is_current: bool
    curves: Curves | None = None


class Superseded(Exception):  # noqa: N818 - no error, a run that nobody waits for any more
    """Ends a run of the detector at its next stage."""


class Session:
    """Files, settings, and the worker that reads and detects.

    Parameters
    ----------
    paths : sequence of paths
    reading : mapping, optional
        Options of `edgel.read`.
    detect : callable
        Runs a detector, as `find_edges` does.
    read : callable
        As `edgel.read`.
    """

    def __init__(
        self,
        paths: Sequence[str | os.PathLike[str]],
        *,
        reading: Mapping[str, Any] | None = None,
        detect: Callable[[Cloud, Run, Callable[[str], None]], Edges] = find_edges,
        read: Callable[..., Cloud] = edgel.read,
    ) -> None:
        self.sources = [Source(path, reading=reading, read=read) for path in paths]
        for source in self.sources:
            if [other.name for other in self.sources].count(source.name) > 1:
                source.name = printable(source.path)
        self.doing = ""
        self._settings = Settings()
        self._changed: Callable[[], None] = lambda: None
        self._detect = detect
        self._answers: dict[Run, Answer] = {}
        self._curves: dict[Answer, Curves] = {}
        self._last: dict[tuple[int, Method], Run] = {}
        self._selected: dict[tuple[int, Method], tuple[Any, Edges]] = {}
        self._closed = False
        self._worker = Latest(self._work, "edgel view detector")

    @property
    def settings(self) -> Settings:
        """What is asked for; assigning wakes the worker, and of many assignments only the last counts."""
        return self._settings

    @settings.setter
    def settings(self, settings: Settings) -> None:
        self._settings = settings
        self._worker.wake()

    def start(self, changed: Callable[[], None] = lambda: None) -> None:
        """Begin to read the files; `changed` is called, from the worker, whenever there is something new to show."""
        self._changed = changed
        self._worker.wake()

    def close(self) -> None:
        """Stop; a run under way ends at its next stage."""
        self._closed = True
        self._worker.close()

    def wait_idle(self, timeout: float | None = None) -> bool:
        """Wait until all that is asked for is there, at most `timeout` seconds, and say whether it is."""
        return self._worker.wait_idle(timeout)

    def panes(self, settings: Settings | None = None) -> list[Pane]:
        """Return what is to be seen now: one pane for each readable file and method, files first."""
        settings = settings or self._settings
        return [
            self._pane(number, method, settings)
            for number, source in enumerate(self.sources)
            if source.cloud is not None
            for method in settings.methods
        ]

    def _pane(self, number: int, method: Method, settings: Settings) -> Pane:
        source = self.sources[number]
        assert source.cloud is not None
        wanted = self._wanted_run(number, method, settings)
        run = wanted if wanted in self._answers else self._last.get((number, method))
        answer = None if run is None else self._answers.get(run)
        box = settings.box(source.low, source.high)
        edges = None
        if answer is not None and answer.edges is not None:
            edges = self._select(number, method, answer, settings)
        name = source.name
        if len(settings.methods) > 1:
            name += f" · {method}"
        curves = self._curves.get(answer) if answer is not None and settings.curves else None
        return Pane(name, source, source.cloud, method, run, answer, edges, box, run == wanted, curves)

    def _select(self, number: int, method: Method, answer: Answer, settings: Settings) -> Edges:
        """Return the edges of an answer that the settings show, the same object for as long as they are the same."""
        cloud, source = self.sources[number].cloud, self.sources[number]
        assert cloud is not None
        assert answer.edges is not None
        key = (answer, settings.strength, settings.angle, settings.kinds, settings.crop)
        last = self._selected.get((number, method))
        if last is None or last[0] != key:
            edges = select(answer.edges, cloud.xyz, settings, settings.box(source.low, source.high))
            last = self._selected[number, method] = key, edges
        return last[1]

    def _wanted_run(self, number: int, method: Method, settings: Settings) -> Run:
        return settings.run(number, method, has_color=self.sources[number].has_color)

    def _wanted(self) -> list[Run]:
        """Return the runs that the settings of this moment need."""
        settings = self._settings
        readable = [number for number, source in enumerate(self.sources) if source.cloud is not None]
        return [self._wanted_run(number, method, settings) for number in readable for method in settings.methods]

    def _work(self) -> None:
        for source in self.sources:
            if not (self._closed or source.is_done):
                self._say(f"reading {source.name}")
                source.load()
        for source in self.sources:
            if not self._closed and source.cloud is not None and source.normals is None:
                self._say(f"shading {source.name}")
                source.estimate_normals()
        while not self._closed and (missing := [run for run in self._wanted() if run not in self._answers]):
            self._answer(missing[0])
        while not self._closed and (untraced := self._untraced()):
            self._trace(*untraced[0])
        self._say("")

    def _untraced(self) -> list[tuple[Source, Answer]]:
        """Return the answers whose curves are asked for and not there yet."""
        if not self._settings.curves:
            return []
        found = [(self.sources[run.source], self._answers[run]) for run in self._wanted() if run.method == "edgel"]
        return [(source, answer) for source, answer in found if answer.edges is not None and answer not in self._curves]

    def _trace(self, source: Source, answer: Answer) -> None:
        self._say(f"tracing curves in {source.name}")
        assert source.cloud is not None
        assert answer.edges is not None
        kept = {old: curves for old, curves in self._curves.items() if old in self._answers.values()}
        self._curves = {**kept, answer: trace(source.cloud, answer.edges)}
        self._changed()

    def _answer(self, run: Run) -> None:
        """Run the detector and keep what comes of it."""
        cloud = self.sources[run.source].cloud
        assert cloud is not None

        def progress(stage: str) -> None:
            if self._closed or run not in self._wanted():
                raise Superseded
            self._say(f"finding edges in {self.sources[run.source].name}: {stage}")

        start = time.perf_counter()
        edges, error = None, ""
        try:
            progress("start")
            edges = self._detect(cloud, run, progress)
        except Superseded:
            return
        except MemoryError:
            error = "not enough memory for this cloud; a larger scale needs less"
        except (ValueError, TypeError) as problem:
            error = describe_error(problem).removeprefix("points: ")
        except Exception as problem:
            if sys.is_finalizing() or self._closed:
                return
            traceback.print_exc()
            error = f"an error inside edgel, not of your data ({type(problem).__name__}: {problem}); please report it"
        self._keep(run, Answer(edges, error, time.perf_counter() - start))

    def _keep(self, run: Run, answer: Answer) -> None:
        answers = {**self._answers, run: answer}
        needed = {*self._wanted(), *self._last.values(), run}
        spare = [old for old in answers if old not in needed]
        for old in spare[: max(len(answers) - _KEPT, 0)]:
            del answers[old]
        self._answers = answers  # a new one each time: other threads read it meanwhile
        self._last[run.source, run.method] = run
        self._changed()

    def _say(self, what: str) -> None:
        if what != self.doing:
            self.doing = what
            self._changed()
