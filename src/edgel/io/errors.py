"""The one error of files that are not what they claim to be, and how what comes from outside is put into words."""

from __future__ import annotations

import os

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


def describe_error(error: BaseException) -> str:
    """Return the message of an error as a sentence, an OSError's without its number."""
    message = str(error) or type(error).__name__
    if isinstance(error, OSError) and error.strerror:
        message = error.strerror[:1].lower() + error.strerror[1:]
        if isinstance(error.filename, str | bytes):
            message = f"{os.fsdecode(error.filename)}: {message}"
    return printable(message)
