"""Curves along the edges of a cloud: lines, arcs and circles measured on the faces beside them, and their drawings."""

from edgel.curves._curves import CurveKind, Curves
from edgel.curves._files import WRITERS, write
from edgel.curves._measures import COLUMNS, Parallels, measures, parallels
from edgel.curves._right_angles import right_angles
from edgel.curves._simplify import simplify
from edgel.curves._trace import FAINT, trace

__all__ = [
    "COLUMNS",
    "FAINT",
    "WRITERS",
    "CurveKind",
    "Curves",
    "Parallels",
    "measures",
    "parallels",
    "right_angles",
    "simplify",
    "trace",
    "write",
]
