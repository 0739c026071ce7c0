"""The one error of files that are not what they claim to be, and how errors are put into words."""

from __future__ import annotations

import os


class FormatError(ValueError):
    """A file that cannot be read, or a cloud that a format cannot hold.

    The message names the file, what was found in it, and what to do.

    Examples
    --------
    >>> from edgel.io import FormatError
    >>> issubclass(FormatError, ValueError)
    True
    """


def describe_error(error: BaseException) -> str:
    """Return the message of an error as a sentence, an OSError's without its number."""
    if isinstance(error, OSError) and error.strerror:
        what = error.strerror[:1].lower() + error.strerror[1:]
        return f"{os.fsdecode(error.filename)}: {what}" if isinstance(error.filename, str | bytes) else what
    return str(error) or type(error).__name__
