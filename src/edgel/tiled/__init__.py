"""Clouds of any size, in tiles: the answer of the whole cloud, to the bit, with the points of one tile in memory.

`detect` takes the files of one cloud. Its passes: each file is read once into a spool that boxes can be read from; what
is said of the whole cloud is measured at a sample; each tile is classified with as much halo as its points ask for; the
line and the chains across seams are merged; each file's edge points are written.
"""

from edgel.tiled.passes import TileError
from edgel.tiled.run import Tiled, detect
from edgel.tiled.surroundings import is_run, surroundings

__all__ = ["TileError", "Tiled", "detect", "is_run", "surroundings"]
