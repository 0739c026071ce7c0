"""Kinds of edges, by flags and by names."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntFlag

import numpy as np

LIKELY = 0.5
"""Strength of an edge that is as likely as not, whatever found it."""


class EdgeKind(IntFlag):
    """Why a point is an edge point; a point can be several at once."""

    BOUNDARY = 1
    """The surface ends, with nothing behind."""
    OCCLUDING = 2
    """The near side of a depth jump, seen from a view."""
    OCCLUDED = 4
    """The far side of a depth jump, seen from a view."""
    CREASE = 8
    """Two faces meet."""
    COLOR = 16
    """A step in color or intensity."""
    IMAGE = 32
    """An edge of the projected image, of a kind not told apart (the published method)."""
    FRAME = 64
    """The end of what the sensor sees, no edge of things: the first and last rows and columns of an organized cloud."""


OUTLINES = EdgeKind.BOUNDARY | EdgeKind.OCCLUDING | EdgeKind.OCCLUDED
"""The kinds where what is seen of a surface ends."""

ASKABLE = EdgeKind(127) & ~EdgeKind.IMAGE
"""The kinds that a detector can be asked for; `EdgeKind.IMAGE` is the published method's alone."""

NAMES = {str(kind.name).lower(): kind for kind in EdgeKind}


def as_kinds(kinds: EdgeKind | str | Iterable[str]) -> EdgeKind:
    """Check the kinds a detector is asked for and return them as flags.

    Parameters
    ----------
    kinds : EdgeKind, str, or iterable of str
        Flags, one name, or several; names in upper or lower case.

    Raises
    ------
    TypeError, ValueError
        If a name or a flag is no kind that can be asked for, or there is none.

    Examples
    --------
    >>> as_kinds(["boundary", "crease"]) == EdgeKind.BOUNDARY | EdgeKind.CREASE
    True
    """
    flags = EdgeKind(0)
    if isinstance(kinds, int | np.integer):
        if int(kinds) & ~int(ASKABLE):
            raise ValueError(f"kinds: expected some of {', '.join(kind_names(ASKABLE))}, got {kinds!r:.80}")
        flags = EdgeKind(int(kinds))
    else:
        for name in [kinds] if isinstance(kinds, str) else kinds:
            if not isinstance(name, str):
                raise TypeError(f"kinds: expected EdgeKind flags or names of kinds, got {name!r:.80} among them")
            if NAMES.get(name.lower(), EdgeKind.IMAGE) not in ASKABLE:
                raise ValueError(f"kinds: {name!r:.80} is unknown; choose from {', '.join(kind_names(ASKABLE))}")
            flags |= NAMES[name.lower()]
    if not flags:
        raise ValueError(f"kinds: none is asked for; choose from {', '.join(kind_names(ASKABLE))}")
    return flags


def kind_names(kinds: EdgeKind) -> list[str]:
    """Return the lower-case names of some kinds.

    Examples
    --------
    >>> kind_names(EdgeKind.CREASE | EdgeKind.BOUNDARY)
    ['boundary', 'crease']
    """
    return [name for name, kind in NAMES.items() if kind in kinds]
