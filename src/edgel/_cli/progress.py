"""Tell the user what takes time: the stage, and the kernels that are compiled on the first run."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType

from numba.core import event
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from edgel._cli.output import print_line, seconds, stderr_console
from edgel._kernels.ahead import expected_seconds
from edgel._kernels.cache import FINISHING, KernelCache
from edgel.io.errors import printable

COMPILING = "compiling kernels, first run only"
_TOLD_BY = ("numba:compile", FINISHING)


class Watch(event.Listener):
    """Show what runs on one line of stderr, and only on a terminal; say anywhere that kernels are being compiled.

    Call it with the name of each stage as it begins: it is the ``progress`` of the library's functions.

    Parameters
    ----------
    quiet : bool
        Whether to say nothing.

    Examples
    --------
    >>> with Watch() as watch:
    ...     watch("reading")
    """

    def __init__(self, *, quiet: bool = False) -> None:
        console = stderr_console()
        columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
        self._bar = Progress(*columns, console=console, transient=True) if console.is_terminal and not quiet else None
        self._task = None if self._bar is None else self._bar.add_task("starting", total=None)
        self._quiet = quiet
        self._count, self._name, self._stage = "", "", "starting"
        self._depth = 0  # a kernel that calls another compiles it meanwhile
        self._told = False
        self._began = 0.0
        self.compile_seconds = 0.0

    def __call__(self, stage: str) -> None:
        """Show the name of a stage."""
        self._stage = stage
        self._describe(stage)

    def begin(self, count: str, name: str = "") -> None:
        """Show which of several things the stages are of, from now on; where the line is too short its name is cut."""
        self._count, self._name = f"{count}: ", name and f", {name}"

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Clear the line while something else is printed."""
        if self._bar is not None:
            self._bar.stop()
        yield
        if self._bar is not None:
            self._bar.start()

    def __enter__(self) -> Watch:
        """Begin to watch."""
        # Numba tells of a kernel only when it compiles one: loading it from the disk cache is no event.
        for each in _TOLD_BY:
            event.register(each, self)
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Clear the line."""
        for each in _TOLD_BY:
            event.unregister(each, self)
        if self._bar is not None:
            self._bar.stop()
        if error is None and self._told and not self._quiet and self.compile_seconds > 1:
            later = (
                "start at once" if KernelCache.keeps else "will too: set NUMBA_CACHE_DIR to a folder to keep them in"
            )
            print_line(f"compiled kernels in {seconds(self.compile_seconds)}; later runs {later}", style="dim")

    def on_start(self, event: event.Event) -> None:
        """Tell of a kernel whose compilation begins; called by Numba."""
        self._depth += 1
        if self._depth > 1:
            return
        self._began = time.perf_counter()
        if self._bar is None and not self._told and not self._quiet:
            print_line(f"{COMPILING}, about {expected_seconds():.0f} s ...")
        self._told = True
        kernel = event.data["dispatcher"].py_func.__name__.strip("_").replace("_", " ")  # pyright: ignore[reportOptionalSubscript]
        self._describe(f"{self._stage}: {COMPILING}: {kernel}")

    def on_end(self, event: event.Event) -> None:
        """Take up the stage again; called by Numba."""
        self._depth -= 1
        if self._depth == 0:
            self.compile_seconds += time.perf_counter() - self._began
            self._describe(self._stage)

    def _describe(self, text: str) -> None:
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, description=printable(self._count + text + self._name))
