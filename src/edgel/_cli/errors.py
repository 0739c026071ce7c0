"""Exit codes, and how errors become messages: one line of what went wrong, and never a traceback for bad input."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum
from typing import Any

import typer

from edgel._cli.output import StdoutError, print_json, print_line, schema
from edgel._cli.signals import Terminated
from edgel.io.errors import describe_error, printable


class ExitCode(IntEnum):
    """What the exit code of every command means."""

    OK = 0
    INTERNAL = 1
    USAGE = 2
    INPUT = 3
    DATA = 4
    OUTPUT = 5
    INTERRUPTED = 130
    TERMINATED = 143


class Failure(Exception):  # noqa: N818 - it is what a command ends with, bad input mostly, not an error of its own
    """What ends a command early.

    Parameters
    ----------
    code : ExitCode
    message : str
        Names the file or option, what is wrong, and the remedy.
    """

    def __init__(self, code: ExitCode, message: str) -> None:
        super().__init__(printable(message))
        self.code = code


@contextmanager
def failing_as(code: ExitCode, subject: str, options: Collection[str] = ()) -> Iterator[None]:
    """Turn the errors that the library raises for bad input into a `Failure`.

    Parameters
    ----------
    code : ExitCode
    subject : str
        The file, put before messages that do not name it themselves.
    options : collection of str
        Arguments that come from the command line: what is wrong with them is wrong usage, whatever the code.
    """
    try:
        yield
    except Failure:
        raise
    except MemoryError as error:
        remedy = "thin the cloud or cut it into parts, or use a machine with more memory"
        raise Failure(code, about(subject, f"not enough memory; {remedy}")) from error
    except (ValueError, TypeError, ImportError, OSError) as error:
        message = describe_error(error)
        # The library's messages begin with the arguments that they are about.
        names, colon, rest = message.partition(": ")
        if colon and set(names.split(", ")) <= set(options):
            raise Failure(ExitCode.USAGE, f"{', '.join(map(as_option, names.split(', ')))}: {rest}") from error
        raise Failure(code, about(subject, rest if names == "points" else message)) from error


@contextmanager
def exit_codes(*, as_json: bool = False, debug: bool = False) -> Iterator[None]:
    """End the program with the code and the message of whatever goes wrong inside.

    Parameters
    ----------
    as_json : bool
        Whether the error also goes to stdout, as a JSON object.
    debug : bool
        Whether the traceback is shown.
    """
    try:
        yield
    except (typer.Exit, typer.Abort):
        raise
    except KeyboardInterrupt:
        code, message = ExitCode.INTERRUPTED, "interrupted; nothing was left half written"
    except Terminated:
        code, message = ExitCode.TERMINATED, "terminated; nothing was left half written"
    except StdoutError as error:
        if error.is_closed:
            raise typer.Exit(int(ExitCode.OUTPUT)) from error
        code, message, as_json = ExitCode.OUTPUT, str(error), False
    except Exception as error:
        code, message = verdict(error)
        if debug:
            show_traceback(traceback.format_exc())
    else:
        return
    tell(message)
    if as_json:
        with suppress(StdoutError):
            print_json(error_facts(None, code, message))
    raise typer.Exit(int(code))


def verdict(error: Exception) -> tuple[ExitCode, str]:
    """Return the exit code and the message of an error, whatever it is."""
    if isinstance(error, Failure):
        return error.code, str(error)
    if isinstance(error, MemoryError):
        return ExitCode.DATA, "not enough memory; thin the cloud or cut it into parts"
    what = f"{type(error).__name__}: {printable(error, 400)}"
    return (
        ExitCode.INTERNAL,
        f"an error inside edgel, not of your data ({what}); please report it with what --debug shows",
    )


def tell(message: str) -> None:
    """Print an error on stderr."""
    print_line(f"edgel: {message}", style="bold red")


def error_facts(source: str | None, code: ExitCode, message: str) -> dict[str, Any]:
    """Return what ``--json`` prints of an error, of one input or of the command."""
    return {**schema("error"), "input": source, "code": int(code), "error": message}


def show_traceback(text: str) -> None:
    """Print a traceback on stderr."""
    sys.stderr.writelines(printable(line, 10_000) + "\n" for line in text.splitlines())


def as_option(name: str) -> str:
    """Return the option that stands for an argument.

    Examples
    --------
    >>> as_option("num_neighbors")
    '--num-neighbors'
    """
    return "--" + name.replace("_", "-")


def about(subject: str, message: str) -> str:
    """Put what a message is about before it, unless it names it itself."""
    subject = printable(subject)
    return message if not subject or subject in message else f"{subject}: {message}"
