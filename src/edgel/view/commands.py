"""The command line and the Python lines that find again what is seen."""

from __future__ import annotations

import math
import shlex
from pathlib import Path

import numpy as np

from edgel.detect import DEFAULT_KINDS, LIKELY
from edgel.edges import kind_names
from edgel.view.session import Pane
from edgel.view.settings import Settings

_HELPERS = ("detect_at_scale", "drop_blunt", "in_box")


def command_line(pane: Pane, settings: Settings) -> str:
    """Write the ``edgel detect`` that finds the edges of a pane, and what it cannot be told.

    Crop, least angle and scale are no options of that command: `python_lines` have them.
    """
    words = ["edgel", "detect", pane.source.path]
    if pane.source.intrinsics is not None:
        words += ["--intrinsics", str(pane.source.intrinsics)]
    missing = ["scale"] if settings.scale > 1 else []
    if pane.preset == "paper":
        words += ["--preset", "paper"]
    else:
        if not settings.kinds:
            return "# no kind of edge is chosen"
        if settings.kinds != DEFAULT_KINDS:
            words += ["--kinds", ",".join(kind_names(settings.kinds))]
        if settings.strength != LIKELY:
            words += ["--min-strength", f"{settings.strength:g}"]
        missing += ["least angle"] if settings.angle > 0 else []
    missing += ["crop"] if settings.is_cropped else []
    words += ["-o", output_name(pane)]
    remark = f"\n# without the {', '.join(missing)}, for which there is no option: the Python lines have it"
    return shlex.join(words) + (remark if missing else "")


def python_lines(pane: Pane, settings: Settings) -> str:
    """Write the Python that finds exactly the edges of a pane."""
    default = pane.preset == "default"
    if default and not settings.kinds:
        return "# no kind of edge is chosen"
    scaled, blunt = settings.scale > 1, default and settings.angle > 0
    options = []
    if default and settings.kinds != DEFAULT_KINDS:
        options.append(f"kinds={kind_names(settings.kinds)!r}")
    if default and settings.strength != LIKELY:
        options.append(f"min_strength={settings.strength:g}")
    if not default:
        options.append("preset='paper'")
    camera = "" if pane.source.intrinsics is None else f", intrinsics={str(pane.source.intrinsics)!r}"
    lines = [f"cloud = edgel.read({pane.source.path!r}{camera})"]
    function = f"detect_at_scale(cloud, {settings.scale:g}" if scaled else "edgel.detect(cloud"
    lines.append(f"edges = {', '.join([function, *options])})")
    if blunt:
        lines.append(f"edges = drop_blunt(edges, math.radians({math.degrees(settings.angle):g}))")
    if settings.is_cropped:
        lines.append(f"inside = in_box(cloud.xyz, np.array({_corners(pane.box)}))")
        lines.append("edges = edges.take(inside[edges.index])")
    lines.append(f"edgel.write({output_name(pane)!r}, edges.cloud(cloud))")
    names = [name for name in _HELPERS if f"{name}(" in "\n".join(lines)]
    head = [*(["import math"] if blunt else []), *(["import numpy as np"] if settings.is_cropped else [])]
    head += ["import edgel", *([f"from edgel.view import {', '.join(names)}"] if names else []), ""]
    return "\n".join(head + lines)


def output_name(pane: Pane, extension: str = ".ply") -> str:
    """Return a name for the edges of a pane, in no folder."""
    return f"{Path(pane.source.path).stem}_{'paper_' if pane.preset == 'paper' else ''}edges{extension}"


def _corners(box: np.ndarray) -> str:
    """Write the corners of a box so that the very same numbers come back."""
    rows = ["[" + ", ".join(_number(float(value)) for value in row) + "]" for row in box]
    return f"[{', '.join(rows)}]"


def _number(value: float) -> str:
    return repr(value) if math.isfinite(value) else ("-np.inf" if value < 0 else "np.inf")
