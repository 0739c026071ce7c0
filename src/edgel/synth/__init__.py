"""Parts with known edges, and a scanner that sees them: the ground truth of the method. Lengths in millimetres."""

from edgel.synth.edges import EDGE_KINDS, EdgeCurve, NearestEdge, nearest_edge
from edgel.synth.fittings import elbow, tee
from edgel.synth.part import Hits, Part
from edgel.synth.scanner import Scan, scan
from edgel.synth.surfaces import Bend, Pipe, Surface

__all__ = [
    "EDGE_KINDS",
    "Bend",
    "EdgeCurve",
    "Hits",
    "NearestEdge",
    "Part",
    "Pipe",
    "Scan",
    "Surface",
    "elbow",
    "nearest_edge",
    "scan",
    "tee",
]
