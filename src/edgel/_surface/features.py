"""The features that the trees hear of: their names, columns, meaning and source.

Two layouts. That of the leaves of an octree is what the first screening looks at. That of the points grows from left
to right: the screening takes its first columns, the first classification more, the second all. The kernels write each
block by the constants beside its names; `training/train.py` stores the layouts' ids with the weights, and weights made
for another layout are refused.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType

from edgel._surface import context, leaves, minimal_planes, plane_scales, sectors, statistics, two_planes

VERSION = 2
"""To be counted up when a feature keeps its name and changes its meaning."""


@dataclass(frozen=True)
class Feature:
    """One column.

    Attributes
    ----------
    name : str
        Block and quantity, ``"two_planes_24.turn"``.
    meaning : str
    source : str
        The module whose kernel writes it.
    """

    name: str
    meaning: str
    source: str


@dataclass(frozen=True)
class Layout:
    """Named columns of an array of features."""

    name: str
    features: tuple[Feature, ...]

    def __len__(self) -> int:
        return len(self.features)

    @property
    def id(self) -> str:
        """What weights are held against: name, version, and a checksum of the names in their order."""
        names = "\n".join(feature.name for feature in self.features)
        return f"{self.name}-{VERSION}-{zlib.crc32(names.encode()):08x}"

    def column(self, name: str) -> int:
        """Return the column of a feature."""
        return [feature.name for feature in self.features].index(name)

    def block(self, name: str) -> slice:
        """Return the columns of the features whose block has this name, or begins with it and a number."""
        own = [i for i, feature in enumerate(self.features) if feature.name.split(".")[0].rstrip("_0123456789") == name]
        return slice(own[0], own[-1] + 1)


def _block(name: str, module: ModuleType, meanings: dict[str, str]) -> Iterator[Feature]:
    source = module.__name__.rsplit(".", 1)[-1]
    return (Feature(f"{name}.{quantity}", meaning, source) for quantity, meaning in meanings.items())


def _leaf_features() -> Iterator[Feature]:
    for count in leaves.GROUPS:
        yield from _block(f"leaves_{count}", leaves, leaves.OF_GROUP)
    yield from _block("leaf", leaves, leaves.OF_LEAF)
    yield from _block("cloud", statistics, statistics.FEATURES)


def _screen_features() -> Iterator[Feature]:
    for count in plane_scales.SCALES:
        yield from _block(f"plane_{count}", plane_scales, plane_scales.OF_SCALE)
    yield from _block("nearest", plane_scales, plane_scales.OF_POINT)
    yield from _block("cloud", statistics, statistics.FEATURES)


def _evidence_features() -> Iterator[Feature]:
    for count, _ in two_planes.FITS:
        yield from _block(f"two_planes_{count}", two_planes, two_planes.FEATURES)
    for number in range(len(minimal_planes.FITS)):
        yield from _block(f"minimal_planes_{number}", minimal_planes, minimal_planes.FEATURES)
    for count in sectors.COUNTS:
        yield from _block(f"sectors_{count}", sectors, sectors.FEATURES)


def _context_features() -> Iterator[Feature]:
    for kind in ("crease", "outline"):
        yield from _block(f"context_{kind}", context, context.FEATURES)


LEAF = Layout("leaf", tuple(_leaf_features()))
POINT = Layout("point", (*_screen_features(), *_evidence_features(), *_context_features()))

NUM_SCREEN = len(tuple(_screen_features()))
"""Columns of `POINT` that the screening takes."""
NUM_EVIDENCE = NUM_SCREEN + len(tuple(_evidence_features()))
"""Columns of `POINT` that the first classification takes."""
