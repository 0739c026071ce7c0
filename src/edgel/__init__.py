"""Find the edges of 3D point clouds, and their normals, without tuning."""

from edgel import paper
from edgel.cloud import Cloud
from edgel.detect import detect
from edgel.edges import EdgeKind, Edges
from edgel.io import FormatError, read, write
from edgel.normals import Normals, estimate_normals
from edgel.scale import detect_at_scale

__all__ = [
    "Cloud",
    "EdgeKind",
    "Edges",
    "FormatError",
    "Normals",
    "detect",
    "detect_at_scale",
    "estimate_normals",
    "paper",
    "read",
    "write",
]
