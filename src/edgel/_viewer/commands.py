"""The command line and the Python lines that find again what is seen."""

from __future__ import annotations

import math
import os
import shlex
from pathlib import Path

from edgel._detect import DEFAULT_KINDS
from edgel._kinds import LIKELY
from edgel._viewer.session import Pane
from edgel._viewer.settings import Settings
from edgel.edges import kind_names

_NO_KIND = "# no kind of edge is chosen"


def command_line(pane: Pane, settings: Settings) -> str:
    """Write the ``edgel detect`` that finds exactly the edges of a pane."""
    words = ["edgel", "detect", pane.source.path]
    for name, value in pane.source.reading.items():
        words += ["--" + name.replace("_", "-"), str(value)]
    if settings.scale > 1:
        words += ["--scale", f"{settings.scale:g}"]
    if pane.method == "paper":
        words += ["--method", "paper"]
    else:
        if not settings.kinds:
            return _NO_KIND
        if settings.kinds != DEFAULT_KINDS:
            words += ["--kinds", ",".join(kind_names(settings.kinds))]
        if settings.strength != LIKELY:
            words += ["--min-strength", f"{settings.strength:g}"]
        if settings.angle > 0:
            words += ["--min-angle", f"{math.degrees(settings.angle):g}"]
    if settings.is_cropped:
        words += ["--crop", *map(repr, pane.box.ravel().tolist())]
    return " ".join(map(_word, [*words, "-o", output_name(pane)]))


def python_lines(pane: Pane, settings: Settings) -> str:
    """Write the Python that finds exactly the edges of a pane."""
    imports, blunt = ["import edgel"], []
    if pane.method == "paper":
        scale = f", scale={settings.scale:g}" if settings.scale > 1 else ""
        found = f"edgel.paper.detect(cloud{scale})"
    else:
        if not settings.kinds:
            return _NO_KIND
        found = f"edgel.detect({', '.join(['cloud', *_options(settings)])})"
        if settings.angle > 0:
            imports = ["import math", "", *imports]
            blunt = [f"edges = edges.drop_blunt(math.radians({math.degrees(settings.angle):g}))"]
    reading = "".join(f", {name}={value!r}" for name, value in pane.source.reading.items())
    lines = [*imports, "", f"cloud = edgel.read({pane.source.path!r}{reading})", f"edges = {found}", *blunt]
    if settings.is_cropped:
        corners = [", ".join(map(_number, corner)) for corner in pane.box.tolist()]
        lines.append(f"edges = edges.crop(cloud, [[{corners[0]}], [{corners[1]}]])")
    lines.append(f"edgel.write({output_name(pane)!r}, edges.to_cloud(cloud))")
    return "\n".join(lines)


def output_name(pane: Pane, extension: str = ".ply") -> str:
    """Return a name for the edges of a pane, in no folder."""
    return f"{Path(pane.source.path).stem}_{'paper_' if pane.method == 'paper' else ''}edges{extension}"


def _options(settings: Settings) -> list[str]:
    """Write the arguments of `edgel.detect` that are not its defaults."""
    options = []
    if settings.scale > 1:
        options.append(f"scale={settings.scale:g}")
    if settings.kinds != DEFAULT_KINDS:
        options.append(f"kinds={kind_names(settings.kinds)!r}")
    if settings.strength != LIKELY:
        options.append(f"min_strength={settings.strength:g}")
    return options


def _word(word: str) -> str:
    r"""Quote a word for the shell, so that no character of it acts on the way there.

    >>> _word("a b.ply"), _word("a\x1b[31m.ply")
    ("'a b.ply'", "$'a\\x1b[31m.ply'")
    """
    if word.isprintable():
        return shlex.quote(word)
    shown = (c if c.isprintable() and c not in "\\'" else "".join(f"\\x{b:02x}" for b in os.fsencode(c)) for c in word)
    return f"$'{''.join(shown)}'"


def _number(value: float) -> str:
    return repr(value) if math.isfinite(value) else f"float('{value}')"
