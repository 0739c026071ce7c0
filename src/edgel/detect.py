"""The whole method on one screen: what `edgel.detect` does with a cloud."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from edgel import paper
from edgel.edges import Edges

PRESETS = ("default", "paper")


def detect(
    points: Any,
    *,
    preset: Literal["default", "paper"] = "default",
    num_neighbors: int = 16,
    viewpoint: Any = None,
    progress: Callable[[str], None] | None = None,
) -> Edges:
    """Find the edge points of a cloud, their kind, and their normals. (docstring to come)"""
    if preset == "paper":
        return paper.detect(points, num_neighbors=num_neighbors, progress=progress)
    raise NotImplementedError
