"""Parts with known edges, and scanners that see them: the ground truth of the method. Lengths in millimetres."""

from edgel.synth.curved import bezier_ridge, cylinder, gear, lathe, plane, prism, sphere, torus, wavy_sheet
from edgel.synth.edges import EDGE_KINDS, EdgeCurve, NearestEdge, nearest_edge
from edgel.synth.fittings import elbow, tee
from edgel.synth.part import Hits, Part
from edgel.synth.polyhedra import cube_fractal, frustum, stepped_block, thin_plate, wedge_fan
from edgel.synth.sample import PATTERNS, sample
from edgel.synth.scanner import Scan, scan
from edgel.synth.solid import Solid, from_polygons, make_solid
from edgel.synth.surfaces import Bend, Pipe, Surface
from edgel.synth.truth import Scene, TrueEdges
from edgel.synth.view import PROJECTIONS, view

__all__ = [
    "EDGE_KINDS",
    "PATTERNS",
    "PROJECTIONS",
    "Bend",
    "EdgeCurve",
    "Hits",
    "NearestEdge",
    "Part",
    "Pipe",
    "Scan",
    "Scene",
    "Solid",
    "Surface",
    "TrueEdges",
    "bezier_ridge",
    "cube_fractal",
    "cylinder",
    "elbow",
    "from_polygons",
    "frustum",
    "gear",
    "lathe",
    "make_solid",
    "nearest_edge",
    "plane",
    "prism",
    "sample",
    "scan",
    "sphere",
    "stepped_block",
    "tee",
    "thin_plate",
    "torus",
    "view",
    "wavy_sheet",
    "wedge_fan",
]
