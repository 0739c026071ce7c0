"""Measure one part of the experiment: how long each step takes, and how its edges compare with the truth."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

from edgel import paper
from edgel._demo.truth import FoundLength, Offsets
from edgel._neighbors.estimate import estimate_normals
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.normals import fit_planes
from edgel._neighbors.queries import anywhere, every_point
from edgel.cloud import Cloud
from edgel.paper import PaperEdges
from edgel.synth import Scene, Solid

NUM_NEIGHBORS = 16


@dataclass(frozen=True)
class Times:
    """Seconds on this machine, compilation not counted; medians of several rounds.

    Attributes
    ----------
    all_normals, edge_normals : float
        Normals at all points and at the edge points, each with the building of the neighbour index: of all points, and
        of those near edges alone.
    index : float
        The index of all points alone.
    all_fits, edge_fits : float
        The neighbour search and plane fits alone.
    image : float
        Projection, Canny and back-projection: what it takes to know the edge points.
    """

    all_normals: float
    edge_normals: float
    index: float
    all_fits: float
    edge_fits: float
    image: float

    @property
    def share(self) -> float:
        """Normals at the edge points against all, as the paper compares them."""
        return self.edge_normals / self.all_normals

    @property
    def share_with_image(self) -> float:
        """The same with the finding of the edge points counted."""
        return (self.edge_normals + self.image) / self.all_normals

    @property
    def share_of_fits(self) -> float:
        """The same without the index."""
        return self.edge_fits / self.all_fits


@dataclass(frozen=True, eq=False)
class Measurement:
    """Everything measured on one part: its scan, the edges, the times, and how they compare with the truth."""

    solid: Solid
    scan: Scene
    edges: PaperEdges
    times: Times
    found: tuple[FoundLength, ...]
    offsets: Offsets

    @property
    def name(self) -> str:
        """Name of the part."""
        return self.solid.name


def measure_times(
    clouds: Sequence[Cloud], found: Sequence[PaperEdges], repeats: int, tell: Callable[[str], None]
) -> list[Times]:
    """Time every part in turn, round by round, so that what else the machine does falls on all alike."""
    rounds: list[list[Times]] = [[] for _ in clouds]
    for number in range(repeats + 1):
        tell("warming up" if number == 0 else f"measuring, round {number} of {repeats}")
        for measured, cloud, edges in zip(rounds, clouds, found, strict=True):
            once = _measure_once(cloud, edges)
            if number > 0:
                measured.append(once)
    names = [one.name for one in fields(Times)]
    return [Times(**{name: statistics.median(getattr(one, name) for one in each) for name in names}) for each in rounds]


def _measure_once(cloud: Cloud, edges: PaperEdges) -> Times:
    xyz, rows = cloud.xyz, edges.index
    stages = paper.detect(cloud, num_neighbors=NUM_NEIGHBORS).seconds
    index = build_index(xyz)
    return Times(
        all_normals=_seconds(lambda: estimate_normals(cloud, num_neighbors=NUM_NEIGHBORS)),
        edge_normals=stages["normals"],
        index=_seconds(lambda: build_index(xyz)),
        all_fits=_seconds(lambda: fit_planes(index, every_point(index), NUM_NEIGHBORS)),
        edge_fits=_seconds(lambda: fit_planes(index, anywhere(xyz[rows]), NUM_NEIGHBORS)),
        image=sum(stages[name] for name in ("projection", "canny", "back-projection")),
    )


def _seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start
