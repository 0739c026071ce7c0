"""What the commands print: tables and notices on stderr, JSON on stdout, and nothing that could steer the terminal."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from edgel.io.errors import describe_error, printable


class StdoutError(Exception):
    """Stdout took no more; `is_closed` where the program that read it has ended, which it may without a word."""

    def __init__(self, error: OSError) -> None:
        super().__init__(f"stdout: {describe_error(error)}; what was printed is not complete")
        self.is_closed = isinstance(error, BrokenPipeError)


@contextmanager
def _to_stdout() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StdoutError(error) from error


class PlainConsole(Console):
    """Prints text as it is: brackets in a file's name are no markup, and control characters are shown, not sent.

    Every string, also one in a cell of a table, comes through `render_str` before it is shown.
    """

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False, highlight=False)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print, or raise `StdoutError`; notices on stderr that nobody can read stop no work."""
        with suppress(OSError) if self.stderr else _to_stdout():
            super().print(*objects, **options)

    def on_broken_pipe(self) -> None:
        """Do as with any other stream that takes no more; called by Rich while it handles the error."""
        raise  # the BrokenPipeError itself

    def render_str(self, text: str, **style: Any) -> Text:
        """Turn a string into what is shown of it."""
        return super().render_str(printable(text), **style)


def stderr_console() -> Console:
    """Return a console for stderr, made anew each time: stderr may be replaced between two commands of a process."""
    return PlainConsole(stderr=True)


def stdout_console() -> Console:
    """Return the same for stdout."""
    return PlainConsole()


def print_line(text: str, *, style: str | None = None) -> None:
    """Print a notice on stderr as one line, however narrow the terminal, so that paths in it can be copied."""
    stderr_console().print(text, style=style, soft_wrap=True)


def print_table(title: str, rows: Iterable[tuple[str, ...]], *, console: Console | None = None) -> None:
    """Print rows of a name, an amount and perhaps a remark, on stderr unless another console is given."""
    console = console or stderr_console()
    console.print(title, style="bold", soft_wrap=True)
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column(justify="right", no_wrap=True)
    table.add_column(style="dim", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console.print(table)


SCHEMA_VERSION = 1
"""Of what ``--json`` prints (docs/command-line.md): one more when a field goes or changes meaning."""


def schema(name: str) -> dict[str, Any]:
    """Return the first fields of what ``--json`` prints: which schema it follows."""
    return {"schema": f"edgel.{name}", "schema_version": SCHEMA_VERSION}


def print_json(values: Mapping[str, Any]) -> None:
    """Print one JSON object on stdout, on one line; NaN and infinities, which JSON has no word for, become null.

    Strings stay exactly what they are, control characters and all beyond ASCII escaped.
    """
    text = json.dumps(_plain(values), allow_nan=False)
    with _to_stdout():
        sys.stdout.write(text + "\n")
        sys.stdout.flush()


def count(number: int) -> str:
    """Write a number of points.

    Examples
    --------
    >>> count(647984)
    '647,984'
    """
    return f"{number:,}"


def renamed(names: Mapping[str, str]) -> str:
    """Say under which names the input's own columns are kept.

    Examples
    --------
    >>> renamed({"nx": "input_nx", "ny": "input_ny"})
    "the input's own nx, ny: kept as input_nx, input_ny"
    """
    return f"the input's own {', '.join(names)}: kept as {', '.join(names.values())}"


def seconds(duration: float) -> str:
    """Write a time.

    Examples
    --------
    >>> seconds(0.0034), seconds(2.5), seconds(75.2)
    ('0.003 s', '2.50 s', '75.2 s')
    """
    if duration < 1:
        return f"{duration:.3f} s"
    return f"{duration:.2f} s" if duration < 10 else f"{duration:.1f} s"


def time_rows(by_stage: Mapping[str, float]) -> list[tuple[str, ...]]:
    """Return the rows of a table that say how long each stage took.

    Examples
    --------
    >>> time_rows({"reading": 0.5, "writing": 2})
    [('time', '2.50 s'), ('  reading', '0.500 s'), ('  writing', '2.00 s')]
    """
    rows = {"time": sum(by_stage.values()), **{f"  {name}": duration for name, duration in by_stage.items()}}
    return [(name, seconds(duration)) for name, duration in rows.items()]


def length(value: float) -> str:
    """Write a length in the cloud's unit, to six digits and never as a power of ten when it is a usual one.

    Examples
    --------
    >>> length(0.000742), length(637012.24), length(float("nan"))
    ('0.000742', '637012.24', '-')
    """
    if not math.isfinite(value):
        return "-"
    return f"{value:.2f}".rstrip("0").rstrip(".") if 1e5 <= abs(value) < 1e9 else f"{value:.6g}"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, str | int | float | bool | None) else str(value)
