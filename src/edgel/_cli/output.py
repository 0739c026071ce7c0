"""What the commands print: tables and notices on stderr, JSON on stdout."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table


def stderr_console() -> Console:
    """Return a console that prints text as it is: brackets in a file's name are no markup.

    It is made anew each time, because stderr may be replaced between two commands of one process.
    """
    return Console(stderr=True, markup=False, emoji=False, highlight=False)


def stdout_console() -> Console:
    """Return the same for stdout."""
    return Console(markup=False, emoji=False, highlight=False)


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


def print_json(values: Mapping[str, Any]) -> None:
    """Print one JSON object on stdout; NaN and infinities, which JSON has no word for, become null."""
    sys.stdout.write(json.dumps(_plain(values), indent=2, allow_nan=False, ensure_ascii=False) + "\n")
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
