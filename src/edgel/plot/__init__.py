"""Pictures of clouds and their edges, drawn with NumPy: a z-buffer of discs, shaded so that the shape is seen."""

from edgel.plot.drawing import picture, save

__all__ = ["picture", "save"]
