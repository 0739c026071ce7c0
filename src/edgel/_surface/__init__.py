"""Edges by the neighbourhood of each point, from any side: screening, evidence at five scales, trained trees, faces.

The cheap evidence of every point says where an edge could be; only there the costly one is gathered, and only where
that makes an edge likely, the neighbours are asked too.
"""

from edgel._surface.classify import Classification, classify
from edgel._surface.line import Strengths
from edgel._surface.screen import screen
from edgel._surface.statistics import cloud_statistics
from edgel._surface.surface import Surface

__all__ = ["Classification", "Strengths", "Surface", "classify", "cloud_statistics", "screen"]
