"""The one error of files that are not what they claim to be, and how what comes from outside is put into words."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Mapping

LONGEST = 800  # characters of a message; what is longer is no sentence, but the content of a file


def printable(text: object, longest: int = LONGEST) -> str:
    r"""Return a text from outside (a file's name, a field, a header line) as it may be shown anywhere.

    Whatever is no visible character (control characters, marks of the writing direction, line breaks, bytes of a name
    that are no text) is written as Python writes it, so that it can neither steer a terminal nor break a line. What is
    too long loses its middle, and says how much: messages end with the remedy.

    Examples
    --------
    >>> printable("a\x1b[31m.ply"), printable("two\nlines")
    ('a\\x1b[31m.ply', 'two\\nlines')
    >>> printable("a" * 1_000_000, 9)
    'aaaaaa ... (999,991 characters left out) ... aaa'
    """
    try:
        shown = str(text)
    except ValueError:  # an integer of more digits than Python turns into text
        return "a number of thousands of digits"
    if not shown.isprintable():
        shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in shown)
    if len(shown) <= longest:
        return shown
    start, end = longest - longest // 3, longest // 3
    return f"{shown[:start]} ... ({len(shown) - start - end:,} characters left out) ... {shown[-end:]}"


class FormatError(ValueError):
    """A file that cannot be read, or a cloud that a format cannot hold.

    The message names the file, what was found in it, and what to do; it is short and printable, whatever is in it.

    Examples
    --------
    >>> from edgel.io import FormatError
    >>> issubclass(FormatError, ValueError)
    True
    """

    def __init__(self, message: object) -> None:
        super().__init__(printable(message))


class FormatWarning(UserWarning):
    """What a written file holds otherwise than the cloud does, or not at all.

    Attributes
    ----------
    said : mapping of str to str
        What became of it: left out, renamed, rounded, and why; by the name of the attribute (of one of its columns
        ``name_0`` where it is split), or ``coordinates``.

    Examples
    --------
    >>> from edgel.io import FormatWarning
    >>> str(FormatWarning("a.las", {"tree": "left out, no numbers", "owner": "left out, no numbers"}))
    'a.las: tree, owner: left out, no numbers'
    """

    def __init__(self, path: object, said: Mapping[str, str]) -> None:
        self.said = dict(said)
        super().__init__(printable(f"{path}: {'; '.join(self.lines())}"))

    def lines(self) -> list[str]:
        """Return one line for each thing that became of attributes, with the names of them all."""
        names: dict[str, list[str]] = {}
        for name, what in self.said.items():
            names.setdefault(what, []).append(printable(name, 80))
        return [f"{', '.join(of_these)}: {what}" for what, of_these in names.items()]

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle and copy: the message is made of two parts."""
        path, _, _ = str(self).partition(": ")
        return type(self), (path, self.said)


def tell(path: object, said: Mapping[str, str]) -> None:
    """Warn of what a file does not hold as the cloud does, at the line outside of edgel that asked for it."""
    if not said:
        return
    level, frame = 1, sys._getframe()
    while frame is not None and str(frame.f_globals.get("__name__")).split(".")[0] == "edgel":
        level, frame = level + 1, frame.f_back
    warnings.warn(FormatWarning(path, said), stacklevel=level)


def describe_error(error: BaseException) -> str:
    """Return the message of an error as a sentence, an OSError's without its number."""
    message = str(error) or type(error).__name__
    if isinstance(error, OSError) and error.strerror:
        message = error.strerror[:1].lower() + error.strerror[1:]
        if isinstance(error.filename, str | bytes):
            message = f"{os.fsdecode(error.filename)}: {message}"
    return printable(message)
