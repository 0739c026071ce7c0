"""Find the edges of 3D point clouds, and their normals, without tuning."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from edgel import curves, matching, paper
    from edgel._depth import from_depth
    from edgel._detect import detect
    from edgel._intrinsics import Intrinsics
    from edgel._many import Detections, detect_many
    from edgel._neighbors.estimate import estimate_normals
    from edgel._neighbors.normals import Normals
    from edgel._probabilities import probabilities
    from edgel.cloud import Cloud
    from edgel.edges import EdgeKind, Edges
    from edgel.io import FormatError, FormatWarning, read, write
    from edgel.matching import Model, Registration, register

__version__ = "0.1.0"

__all__ = [
    "Cloud",
    "Detections",
    "EdgeKind",
    "Edges",
    "FormatError",
    "FormatWarning",
    "Intrinsics",
    "Model",
    "Normals",
    "Registration",
    "curves",
    "detect",
    "detect_many",
    "estimate_normals",
    "from_depth",
    "matching",
    "paper",
    "probabilities",
    "read",
    "register",
    "write",
]

# Where each name comes from. It is imported when it is first used: NumPy and Numba take a second, in which the command
# line already has to answer Ctrl-C.
_HOMES = {
    "Cloud": "edgel.cloud",
    "Detections": "edgel._many",
    "EdgeKind": "edgel.edges",
    "Edges": "edgel.edges",
    "FormatError": "edgel.io",
    "FormatWarning": "edgel.io",
    "Intrinsics": "edgel._intrinsics",
    "Model": "edgel.matching",
    "Normals": "edgel._neighbors.normals",
    "Registration": "edgel.matching",
    "detect": "edgel._detect",
    "detect_many": "edgel._many",
    "estimate_normals": "edgel._neighbors.estimate",
    "from_depth": "edgel._depth",
    "probabilities": "edgel._probabilities",
    "read": "edgel.io",
    "register": "edgel.matching",
    "write": "edgel.io",
}
_ROOMS = ("cloud", "curves", "edges", "export", "io", "matching", "metrics", "paper", "plot", "synth")


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    elif name in _ROOMS:
        value = import_module(f"edgel.{name}")
    else:
        raise AttributeError(f"module 'edgel' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES, *_ROOMS})
