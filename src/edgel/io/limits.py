"""What a file may promise: sizes and numbers in headers are held against the file before anything is allocated."""

from __future__ import annotations

import re

from edgel.io.errors import FormatError

# Packed data may unpack to 100 times the file, which no scan comes near, and small files to 64 MiB in any case.
_ALWAYS = 1 << 26
_MOST_RATIO = 100
# A line of points is some hundred characters long, with a histogram a few thousand.
LONGEST_LINE = 1 << 20
# A header is a few kilobytes; with an embedded protocol of the measurement perhaps a hundred.
LONGEST_HEADER = 1 << 20


def check_unpacked(path: str, promised: int, size: int, *, ratio: int = _MOST_RATIO) -> None:
    """Raise FormatError if a file of `size` bytes promises to unpack to more than any scan does."""
    if promised > _ALWAYS + ratio * size:
        raise FormatError(
            f"{path}: {size} bytes that promise to unpack to {promised}; the file is damaged, or made to fill the "
            "memory: get it again, or save it uncompressed"
        )


def whole_number(text: str) -> int | None:
    """Return the whole number that a word of a header is, None for anything else (and for more than 18 digits).

    Examples
    --------
    >>> whole_number("307200"), whole_number("-1"), whole_number("9" * 5000)
    (307200, None, None)
    """
    return int(text) if re.fullmatch(r"[0-9]{1,18}", text) else None
