"""Curves along the edges of a cloud."""

from edgel.curves._curves import CurveKind, Curves
from edgel.curves._trace import trace

__all__ = ["CurveKind", "Curves", "trace"]
