"""Exit codes, and how errors become messages: one line of what went wrong, and never a traceback for bad input."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum

import typer

from edgel._cli.output import StdoutError, print_json, print_line
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
        raise Failure(code, _about(subject, f"not enough memory; {remedy}")) from error
    except (ValueError, TypeError, ImportError, OSError) as error:
        message = describe_error(error)
        # The library's messages begin with the arguments that they are about.
        names, colon, rest = message.partition(": ")
        if colon and set(names.split(", ")) <= set(options):
            raise Failure(ExitCode.USAGE, f"{', '.join(map(as_option, names.split(', ')))}: {rest}") from error
        raise Failure(code, _about(subject, rest if names == "points" else message)) from error


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
    except Failure as failure:
        code, message = failure.code, str(failure)
        _show_traceback(debug)
    except MemoryError:
        code, message = ExitCode.DATA, "not enough memory; thin the cloud or cut it into parts"
        _show_traceback(debug)
    except Exception as error:
        code = ExitCode.INTERNAL
        advice = "please report it with what --debug shows"
        what = f"{type(error).__name__}: {printable(error, 400)}"
        message = f"an error inside edgel, not of your data ({what}); {advice}"
        _show_traceback(debug)
    else:
        return
    print_line(f"edgel: {message}", style="bold red")
    if as_json:
        with suppress(StdoutError):
            print_json({"error": message, "code": int(code)})
    raise typer.Exit(int(code))


def as_option(name: str) -> str:
    """Return the option that stands for an argument.

    Examples
    --------
    >>> as_option("num_neighbors")
    '--num-neighbors'
    """
    return "--" + name.replace("_", "-")


def _about(subject: str, message: str) -> str:
    subject = printable(subject)
    return message if not subject or subject in message else f"{subject}: {message}"


def _show_traceback(debug: bool) -> None:
    if debug:
        sys.stderr.writelines(printable(line, 10_000) + "\n" for line in traceback.format_exc().splitlines())
