"""The program as a shell starts it: its streams, its signals, and its exit code whatever happens."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import Any

from edgel._cli import app
from edgel._cli.errors import ExitCode
from edgel._cli.output import StdoutError, print_line
from edgel._cli.signals import Terminated, end_now, listen


def run() -> None:
    """Run the command that the arguments name, and end the process."""
    _open_streams()
    listen()
    try:
        code: Any = _exit_code()
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    except Terminated:
        code = ExitCode.TERMINATED
    if code in (ExitCode.INTERRUPTED, ExitCode.TERMINATED):
        end_now(int(code))
    sys.exit(code)


def _exit_code() -> Any:
    """Run the command and return what it ends with."""
    try:
        app()
        code: Any = ExitCode.OK
    except SystemExit as end:
        code = end.code
    except OSError as error:  # of help and version, which Typer prints itself
        print_line(f"edgel: {StdoutError(error)}", style="bold red")
        code = ExitCode.OUTPUT
    try:
        sys.stdout.flush()
    except OSError as error:
        if not code and not isinstance(error, BrokenPipeError):
            print_line(f"edgel: {StdoutError(error)}", style="bold red")
        code = code or ExitCode.OUTPUT
        # What is left goes nowhere: the interpreter flushes once more as it ends, and would complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _open_streams() -> None:
    """Let every stream be there, and take every character: one that was closed is empty, or takes nothing."""
    # In this order each gets the lowest number that is free, its own.
    if sys.stdin is None:
        sys.stdin = os.fdopen(os.open(os.devnull, os.O_RDONLY))
    if sys.stdout is None:  # writing to what is open for reading fails, as it should
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w")
    if sys.stderr is None:
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError):
            stream.reconfigure(errors="backslashreplace")  # pyright: ignore[reportAttributeAccessIssue]
