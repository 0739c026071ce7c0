"""Runs of a detector: which one, on what, and what came of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import edgel
from edgel._detect import DEFAULT_KINDS
from edgel.cloud import Cloud
from edgel.edges import EdgeKind, Edges

Method = Literal["edgel", "paper"]
METHODS: tuple[Method, ...] = get_args(Method)
"""The methods whose edges can be shown: `edgel.detect` and the published one, `edgel.paper.detect`."""

LEAST_STRENGTH = 0.2  # what `edgel.detect` is asked for; the slider goes no lower

_NONE = EdgeKind(0)


@dataclass(frozen=True)
class Run:
    """One run of a detector: everything else only filters what it found.

    Attributes
    ----------
    source : int
        Which file.
    method : {"edgel", "paper"}
    scale : float
        See `Settings`.
    more : EdgeKind
        Kinds that are looked for beside the usual ones: of color, and the frame.
    """

    source: int
    method: Method
    scale: float = 1.0
    more: EdgeKind = _NONE


@dataclass(frozen=True, eq=False)
class Answer:
    """What came of a run: edges, or why there are none; and the seconds it took."""

    edges: Edges | None
    error: str
    seconds: float


def find_edges(cloud: Cloud, run: Run, progress: Callable[[str], None]) -> Edges:
    """Run the detector on a cloud; `progress` is called with the name of each stage as it begins."""
    if run.method == "paper":
        return edgel.paper.detect(cloud, scale=run.scale, progress=progress)
    kinds = DEFAULT_KINDS | run.more
    return edgel.detect(cloud, kinds=kinds, min_strength=LEAST_STRENGTH, scale=run.scale, progress=progress)
