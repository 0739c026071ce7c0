"""Edges in the image that a sensor saw: views, range images, facets, steps in depth and rims."""

from edgel._range_image.near_far import SHOWN, pixel_size, raster, sides, sides_in, spreads_thin
from edgel._range_image.no_return import without_no_return
from edgel._range_image.range_image import RangeImage, organized, orthographic, pinhole, spherical, viewer_axes
from edgel._range_image.seen_edges import SeenEdges, see_edges
from edgel._range_image.view import FEW, METHODS, View, choose_view, direction_that_explains, explaining_view

__all__ = [
    "FEW",
    "METHODS",
    "SHOWN",
    "RangeImage",
    "SeenEdges",
    "View",
    "choose_view",
    "direction_that_explains",
    "explaining_view",
    "organized",
    "orthographic",
    "pinhole",
    "pixel_size",
    "raster",
    "see_edges",
    "sides",
    "sides_in",
    "spherical",
    "spreads_thin",
    "viewer_axes",
    "without_no_return",
]
