"""What others offer, side by side with edgel, each with its documented defaults and a small grid to choose from."""

from .edges import RIVALS
from .interface import Found, NormalsRival, Rival
from .normals import NORMALS

__all__ = ["NORMALS", "RIVALS", "Found", "NormalsRival", "Rival"]
