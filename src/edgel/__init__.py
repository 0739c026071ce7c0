"""Find the edges of 3D point clouds, and their normals, without tuning."""

from edgel import paper
from edgel._detect import detect
from edgel._neighbors.normals import Normals, estimate_normals
from edgel.cloud import Cloud
from edgel.edges import EdgeKind, Edges
from edgel.io import FormatError, read, write

__version__ = "0.1.0.dev0"

__all__ = [
    "Cloud",
    "EdgeKind",
    "Edges",
    "FormatError",
    "Normals",
    "detect",
    "estimate_normals",
    "paper",
    "read",
    "write",
]
