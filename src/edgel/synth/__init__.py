"""Parts with known edges, and scanners that see them: the ground truth of the method. Lengths in millimetres."""

from edgel.synth.curved import (
    bezier_ridge,
    cylinder,
    gear,
    lathe,
    plane,
    prism,
    round_corners,
    sphere,
    torus,
    wavy_sheet,
)
from edgel.synth.edges import EDGE_KINDS, EdgeCurve, NearestEdge, nearest_edge
from edgel.synth.fittings import elbow, tee
from edgel.synth.polyhedra import blocks, cube_fractal, frustum, ridge, stepped_block, thin_plate, wedge_fan
from edgel.synth.sample import PATTERNS, poisson_disc, sample
from edgel.synth.scan import scan
from edgel.synth.sensors import SENSORS, Sensor, sense
from edgel.synth.solid import Solid, from_patches, from_polygons, make_solid
from edgel.synth.truth import Scene, TrueEdges
from edgel.synth.view import PROJECTIONS, view

__all__ = [
    "EDGE_KINDS",
    "PATTERNS",
    "PROJECTIONS",
    "SENSORS",
    "EdgeCurve",
    "NearestEdge",
    "Scene",
    "Sensor",
    "Solid",
    "TrueEdges",
    "bezier_ridge",
    "blocks",
    "cube_fractal",
    "cylinder",
    "elbow",
    "from_patches",
    "from_polygons",
    "frustum",
    "gear",
    "lathe",
    "make_solid",
    "nearest_edge",
    "plane",
    "poisson_disc",
    "prism",
    "ridge",
    "round_corners",
    "sample",
    "scan",
    "sense",
    "sphere",
    "stepped_block",
    "tee",
    "thin_plate",
    "torus",
    "view",
    "wavy_sheet",
    "wedge_fan",
]
